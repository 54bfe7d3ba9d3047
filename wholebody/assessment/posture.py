"""The assessment of any method's answer, computed from the posture alone.

It shares nothing with the methods. Optimality and blockers are computed when they are asked for.
`judged_postures` is the same in arrays, for many problems of one scene that are alike but for numbers.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, fields
from math import inf, sqrt
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.assessment.all_pairs import AllPairs, all_pairs
from wholebody.assessment.first_order import ACTIVE, MET, Blocker, FirstOrder
from wholebody.assessment.motion import limit_violation
from wholebody.base.arrays import Array, Indices, brief
from wholebody.base.checks import a, number, posture
from wholebody.base.errors import InputError, TermError, millimetres
from wholebody.figures.state import State
from wholebody.problem import Problem
from wholebody.tasks.answers import is_own, limit, one
from wholebody.tasks.base import Constraint, Goal
from wholebody.tasks.checks import values_and_rows
from wholebody.tasks.inputs import WORLD, Place
from wholebody.tasks.point import Point


@dataclass(frozen=True)
class Assessment:
    """How good a posture is for a problem.

    Attributes:
        goal_error: largest remaining distance of a goal, metres.
        goal_angle: largest remaining angle of a goal, radians.
        penetration: depth of the deepest overlap of any pair, metres; 0 if nothing overlaps.
        least_distance: least signed distance of any pair, metres; inf without pairs.
        clearance_violation: largest shortfall of a pair from its required distance, metres.
        limit_violation: largest violation of a joint limit, radians or metres.
        constraint_violation: largest violation of a constraint, metres or radians.
        measure: weighted sum of the measures.
        goal_errors: (goals,) norm of each goal's error, metres or radians (whichever is larger).
        first_order: optimality and blockers, computed when they are asked for.
        seconds: wall time that the judgement itself took; a method's own time is its solution's less this.

    Examples:
        >>> judged = wb.assess(problem, solution.q)
        >>> judged.goal_error < 1e-5, judged.penetration < 1e-5
        (True, True)
    """

    goal_error: float
    goal_angle: float
    penetration: float
    least_distance: float
    clearance_violation: float
    limit_violation: float
    constraint_violation: float
    measure: float
    goal_errors: tuple[float, ...]
    first_order: FirstOrder = field(compare=False, repr=False)
    seconds: float = field(default=0.0, compare=False, repr=False)

    __repr__ = brief

    @property
    def optimality(self) -> float:
        """First-order optimality, radians or metres, 0 at a perfect posture.

        What no goal, limit, constraint or contact balances of the objective's gradient, divided by the objective's
        curvature; largest entry. The objective is the measures where the goals are met, else the squared goal errors.
        """
        return self.first_order.optimality

    def __str__(self) -> str:
        return (
            f"goals missed by {millimetres(self.goal_error)} and {np.degrees(self.goal_angle):.3g} degrees; "
            f"deepest overlap {millimetres(self.penetration)}, distances short by "
            f"{millimetres(self.clearance_violation)}, limits off by {self.limit_violation:.3g}, "
            f"constraints by {self.constraint_violation:.3g}"
        )

    @property
    def blockers(self) -> tuple[Blocker, ...]:
        """What stands in the way, the hardest first; none where goals are met and everything holds."""
        return self.first_order.blockers

    def summary(self) -> dict[str, Any]:
        """All of it as plain numbers, texts, lists and dictionaries."""
        numbers = {part.name: getattr(self, part.name) for part in fields(self) if part.name != "first_order"}
        return {**numbers, "optimality": self.optimality, "blockers": [asdict(blocker) for blocker in self.blockers]}

    def holds(self, tolerance: float) -> bool:
        """Whether limits, constraints and clearances hold to a tolerance, metres and radians."""
        tolerance = number(tolerance, "tolerance", 0.0, inf)
        return (  # NaN holds nothing
            self.limit_violation <= tolerance
            and self.constraint_violation <= tolerance
            and self.clearance_violation <= tolerance
            and self.penetration <= tolerance
        )

    def met(self, tolerance: float) -> bool:
        """Whether the goals are met to a tolerance, metres and radians."""
        tolerance = number(tolerance, "tolerance", 0.0, inf)
        return all(error <= tolerance for error in (self.goal_error, self.goal_angle, *self.goal_errors))

    @property
    def nearest(self) -> bool:
        """Whether to first order no motion that is free leaves less than 98 % of the goals' errors."""
        # at minima it is 0.995 or more, where a method stopped short 0.95 or less
        return self.first_order.nearer >= 0.98

    @property
    def in_the_way(self) -> str:
        """The strongest blockers in words, to append to a sentence; empty if goals are met and everything holds."""
        if not self.blockers:
            # a posture this near to first-order optimal [rad, m] counts as the nearest to goals that it misses
            stretched = not self.met(MET) and self.optimality <= 1e-2
            return "; nothing pushes back: the limbs do not reach" if stretched else ""
        names = [str(blocker) for blocker in self.blockers[:4]]
        more = len(self.blockers) - len(names)
        return f"; in the way: {', '.join(names)}" + (f" and {more} more" if more else "")


def assess(problem: Problem, q: Array) -> Assessment:
    """Judge a posture q (nq,) for a problem.

    Raises:
        InputError: q has the wrong shape or a value that is not finite.
        TermError: a term of one's own answers what is not finite there, or no numbers of its shape; it is named.

    Examples:
        >>> wb.assess(problem, solution.q).goal_error < 1e-5
        True
    """
    began = time.perf_counter()
    if not isinstance(problem, Problem):
        raise InputError(f"assess: problem is {a(type(problem))}, not a Problem; state one with wb.Problem(scene)")
    q = posture(q, problem.scene.model.nq)
    problem.scene.figure.warn_of_angles(q, "assess: q")
    problem.check_fresh()
    return judged(problem, q, began)


def judged(problem: Problem, q: Array, began: float | None = None) -> Assessment:
    """What `assess` answers for a problem and a posture (nq,) that are checked, as at the end of a solve."""
    began = time.perf_counter() if began is None else began
    built = problem.scene.built
    problem.check_scene()
    with all_pairs(built).borrow() as pairs:
        try:
            return _judged(problem, pairs, q, began)
        except TermError as error:
            raise problem.placed(error) from None


def _judged(problem: Problem, pairs: AllPairs, q: Array, began: float) -> Assessment:
    pairs.move(q)
    state = pairs.state
    distance, angle, each = goal_errors(problem, state)
    pairs.ask(problem.clearances)
    short = float(np.maximum.reduce(problem.clearances - pairs.distance, initial=-inf))
    violation = max(0.0, short)
    missed = largest_violation(problem, state)
    fits = distance <= MET and angle <= MET and violation <= MET and missed <= MET
    return Assessment(
        goal_error=distance,
        goal_angle=angle,
        penetration=max(0.0, -pairs.least),
        least_distance=pairs.least,
        clearance_violation=violation,
        limit_violation=limit_violation(problem.scene.figure, q),
        constraint_violation=missed,
        measure=sum([one(term, "value", term.weight * term.value(state)) for term in problem.measures], 0.0),
        goal_errors=each,
        first_order=FirstOrder(problem, pairs, fits, short > -2.0 * ACTIVE, each),
        seconds=time.perf_counter() - began,
    )


def goal_errors(problem: Problem, state: State) -> tuple[float, float, tuple[float, ...]]:
    """The largest distance [m] and the largest angle [rad] of goals from their targets, and the larger of each goal."""
    distances, angles = list[float](), list[float]()
    for goal in problem.goals:
        distance, angle = distance_and_angle(goal, state)
        distances.append(distance or 0.0)
        angles.append(angle or 0.0)
    return max(distances, default=0.0), max(angles, default=0.0), tuple(map(max, distances, angles))


def distance_and_angle(goal: Goal, state: State) -> tuple[float | None, float | None]:
    """Distance [m] and angle [rad] of a goal from its target; None for a goal without a position or a direction."""
    error, angular = _values(goal, goal.error, state), goal.angular
    if angular.shape != error.shape:
        angular = np.zeros(error.shape, dtype=bool) | angular
    far, turned = error[~angular], error[angular]
    return sqrt(far.dot(far)) if len(far) else None, sqrt(turned.dot(turned)) if len(turned) else None


def largest_violation(problem: Problem, state: State) -> float:
    """The largest violation of a constraint, metres or radians."""
    worst = 0.0
    for constraint in problem.constraints:
        value = _values(constraint, constraint.value, state)
        least, most = (limit(constraint, side, getattr(constraint, side)) for side in ("lower", "upper"))
        worst = max(worst, float(np.maximum(least - value, value - most).max(initial=0.0)))
    return worst


def _values(term: Goal | Constraint, evaluate: Callable[[State], Array], state: State) -> Array:
    """Values (m,) of a goal or constraint; one of one's own must have as many rows as values here too."""
    return values_and_rows(term, evaluate, state)[0] if is_own(term) else evaluate(state)


def violations(problem: Problem, q: Array) -> Array:
    """Largest violations (n,) of limits, constraints and clearances at postures (n, nq), metres and radians.

    They are those that `assess` finds at each; of arrays, coal is asked for pairs alone that nothing else tells apart.
    """
    problem.check_scene()
    with all_pairs(problem.scene.built).borrow() as pairs:
        _, _, short = pairs.shortfalls(q, np.broadcast_to(problem.clearances, (len(q), len(problem.clearances))))
        missed = [largest_violation(problem, pairs.state.update(each)) for each in q]
    return np.asarray(np.array([short, missed, _beyond(problem, q)]).max(axis=0))


def _beyond(problem: Problem, q: Array) -> Array:
    """Largest violations (n,) of joint limits at postures (n, nq), radians or metres."""
    limits = problem.scene.figure.limits
    values = q[:, limits.idx_q]
    return np.asarray(np.maximum(limits.lower - values, values - limits.upper).max(axis=1, initial=0.0))


_UNTURNED, _UNMOVED = np.eye(3), np.zeros(3)


class Numbers(NamedTuple):
    """What k problems with g goals each ask: places and rotations of frames, a squared distance, and clearances."""

    offsets: Array  # (k, g, 3) of what is placed, in its frame
    targets: Array  # (k, g, 3) where
    undo: Array  # (k, g, 3, 3) inverses of the rotations that are asked for
    references: Array  # (k, nq) posture of which the measure is the squared distance
    clearances: Array  # (k, pairs) metres

    @classmethod
    def of(cls, problems: Sequence[Problem]) -> Numbers:
        """What these ask, whose goals are `Point`, `Frame`, `Orientation` or `Relative`."""
        goals = [[_numbers(goal) for goal in problem.goals] for problem in problems]
        offsets, targets, undo = (np.array([[goal[part] for goal in each] for each in goals]) for part in range(3))
        references = np.array([_distance(problem).reference for problem in problems])
        return cls(offsets, targets, undo, references, np.array([problem.clearances for problem in problems]))

    def of_some(self, rows: Indices) -> Numbers:
        """What some of them (m,) ask."""
        return Numbers(*(part[rows] for part in self))


class Judged(NamedTuple):
    """Arrays (k,) with a number a posture; see `Assessment`."""

    goal_error: Array
    goal_angle: Array
    penetration: Array
    clearance_violation: Array
    limit_violation: Array
    constraint_violation: Array
    measure: Array

    def meets(self, tolerance: float) -> Any:
        """Which (k,) meet their goals with everything held to a tolerance, metres and radians."""
        return np.maximum.reduce(self[:-1]) <= tolerance

    def put(self, rows: Indices, other: Judged) -> None:
        """Replace some rows (m,) by those of another judgement."""
        for part, new in zip(self, other, strict=True):
            part[rows] = new


def judged_postures(problem: Problem, numbers: Numbers, q: Array) -> Judged:
    """Judge postures q (k, nq) of one problem without constraints and bounds, each with its own numbers."""
    model, built = problem.scene.model, problem.scene.built
    with all_pairs(built).borrow() as pairs:
        # more bounds of pairs at once take more memory than the processor keeps near
        step = max(1, 50_000 // max(1, len(built.table.pairs)))
        parts = [pairs.shortfalls(q[k : k + step], numbers.clearances[k : k + step]) for k in range(0, len(q), step)]
    joints, penetration, short = (np.concatenate(each) for each in zip(*parts, strict=True))
    far, turned = np.zeros((2, 1 + len(problem.goals), len(q)))
    for g, goal in enumerate(problem.goals):
        far[g], turned[g] = _errors(goal, joints, [part[:, g] for part in numbers[:3]])
    if model.nq == model.nv:
        away = q - numbers.references
    else:
        away = np.array([pin.difference(model, *each) for each in zip(numbers.references, q, strict=True)])
    measure = problem.measures[0].weight * ((away * away) @ _distance(problem).weights)
    return Judged(
        far.max(axis=0), turned.max(axis=0), penetration, short, _beyond(problem, q), np.zeros(len(q)), measure
    )


def _distance(problem: Problem) -> Any:
    measure: Any = problem.measures[0]
    return measure.distance


def _numbers(goal: Any) -> tuple[Array, Array, Array]:
    """Offset (3,), target (3,), and the inverse (3, 3) of the target's rotation of a goal."""
    if type(goal) is Point:
        return goal.resolved_offset, goal.resolved_target, _UNTURNED
    return _UNMOVED, goal.residual.placement.translation, goal.residual.placement.rotation.T


def _errors(goal: Any, joints: Array, asked: Sequence[Array]) -> tuple[Array, Array]:
    """Distances and angles (k,) of a goal from its targets, with the joints (k, njoints, 4, 3) there."""
    offset, target, undo = asked
    if type(goal) is Point:
        place, base, position, orientation = goal.place, WORLD, True, False
    else:
        place, _, base, position, orientation = goal.residual
    turn, at = _placed(place, joints)
    at = at + (turn @ offset[:, :, None])[:, :, 0]
    if base.frame:
        back, origin = _placed(base, joints)
        back = back.transpose(0, 2, 1)
        turn, at = back @ turn, (back @ (at - origin)[:, :, None])[:, :, 0]
    none = np.zeros(len(joints))
    far = np.linalg.norm(at - target, axis=1) if position else none
    if not orientation:
        return far, none
    left = turn @ undo
    sine = np.stack([left[:, (k + 2) % 3, (k + 1) % 3] - left[:, (k + 1) % 3, (k + 2) % 3] for k in range(3)])
    return far, np.arctan2(np.linalg.norm(sine, axis=0), np.trace(left, axis1=1, axis2=2) - 1.0)


def _placed(place: Place, joints: Array) -> tuple[Array, Array]:
    """Rotations (k, 3, 3) and origins (k, 3) of a frame in the world."""
    at, joint = place.placement, joints[:, place.joint]
    turn = joint[:, :3].transpose(0, 2, 1)
    return turn @ at.rotation, joint[:, 3] + turn @ at.translation
