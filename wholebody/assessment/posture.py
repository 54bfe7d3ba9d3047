"""The assessment of any method's answer, computed from the posture alone.

Independent of every method: it looks at all pairs without culling and without memory of earlier postures, and takes
contact normals' derivatives from Pinocchio's own joint Jacobians. Optimality and what stands in the way are computed
when they are asked for.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields
from math import inf, sqrt
from typing import Any

import numpy as np

from wholebody.assessment.all_pairs import AllPairs, all_pairs
from wholebody.assessment.first_order import ACTIVE, MET, Blocker, FirstOrder
from wholebody.assessment.motion import limit_violation
from wholebody.base.arrays import Array, brief
from wholebody.base.checks import a, number, posture
from wholebody.base.errors import InputError, TermError
from wholebody.figures.state import State
from wholebody.problem import Problem
from wholebody.tasks.answers import is_own, limit, one
from wholebody.tasks.base import Constraint, Goal
from wholebody.tasks.checks import values_and_rows

STILL = 1e-2  # rad, m: optimality below which a posture counts as the nearest to goals that it does not meet
NAMED = 4  # most blockers that a message names


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
            f"goals missed by {1e3 * self.goal_error:.3g} mm and {np.degrees(self.goal_angle):.3g} degrees; "
            f"deepest overlap {1e3 * self.penetration:.3g} mm, limits off by {self.limit_violation:.3g}, "
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
    def in_the_way(self) -> str:
        """The strongest blockers in words, to append to a sentence; empty if goals are met and everything holds."""
        if not self.blockers:
            stretched = not self.met(MET) and self.optimality <= STILL
            return "; nothing pushes back: the limbs do not reach" if stretched else ""
        names = [str(blocker) for blocker in self.blockers[:NAMED]]
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
        first_order=FirstOrder(problem, pairs, fits, short > -2.0 * ACTIVE),
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
