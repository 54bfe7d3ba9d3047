"""Multistart: one loop over starts, and the starts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.figures.hand import opened_for_a_bar
from wholebody.figures.state import State
from wholebody.methods.contradictions import Contradiction
from wholebody.methods.control import Control
from wholebody.problem import Problem
from wholebody.tasks.bounds import allowed
from wholebody.tasks.checks import is_a
from wholebody.tasks.contact_parts import Over
from wholebody.tasks.defaults import UPRIGHT, free_arms
from wholebody.tasks.distance import Effort
from wholebody.tasks.grasp import Grasp
from wholebody.tasks.inputs import body_of
from wholebody.tasks.sit import Sit
from wholebody.tasks.stand import Stand

SPREADS = (0.3, 0.6, 1.0)  # largest distance from the first start, as a share of each joint's range, in turn
AT_LIMIT = 0.02  # rad: a joint nearer to its limit than this counts as at it
BEND = 0.3  # rad: distance by which such a joint is moved off its limit
TURN = 2.0 * np.pi  # rad: range of those
YAWS = np.radians((0, 45, -45, 90, -90, 135, -135, 180))
LEVEL = {"shoulder_flexion": 0.2, "elbow_flexion": 1.8, "elbow_pronation": 1.1}  # rad: of arms with forearms level
HEADINGS = [pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), np.zeros(3)) for yaw in YAWS]  # those turned least first

End = TypeVar("End")


class Attempt(NamedTuple, Generic[End]):
    """A part of a search."""

    starts: Iterable[Array]  # (nq,) postures to begin at
    stage: Callable[[Array], End | None]  # where it leads from one; None where that is given up
    how: str  # what the message says of an answer that it found


class Multistart(ABC, Generic[End]):
    """One loop over attempts, which keeps the best of their ends.

    Attributes:
        tried: starts of attempts.
        how: what the message says of the best.
        contradictions: of the problem, as far as it was looked for any.
    """

    def __init__(self, control: Control) -> None:
        self.control, self.tried, self.how = control, 0, ""
        self.contradictions = tuple[Contradiction, ...]()
        self._best: End | None = None

    @property
    def best(self) -> End:
        """The best end so far."""
        assert self._best is not None
        return self._best

    def search(self, attempts: Iterable[Attempt[End]]) -> None:
        """Try one start after the other until an end solves the problem, or others are not worth a try."""
        for attempt in attempts:
            for q in attempt.starts:
                self.tried += 1
                found = attempt.stage(q)
                if found is not None and self.accept(found, attempt.how):
                    return
                if self.control.over or self.enough():
                    return

    def accept(self, found: End, how: str = "") -> bool:
        """Keep the better one; whether the problem is solved now."""
        if self._best is None or self.better(found, self._best):
            self._best, self.how = found, how or self.how
        return self.solves(self._best)

    @abstractmethod
    def better(self, one: End, other: End) -> bool:
        """Whether one end is better than the other."""

    @abstractmethod
    def solves(self, end: End) -> bool:
        """Whether an end solves the problem."""

    @abstractmethod
    def enough(self) -> bool:
        """Whether no other start is worth a try, although the problem is not solved."""


def off_limits(problem: Problem, state: State, start: Array) -> Array | None:
    """The start (nq,) with every joint at a limit moved off it; None if no joint is at a limit. It moves the state."""
    limits = problem.scene.figure.limits
    value = start[limits.idx_q]
    move = np.zeros(problem.scene.model.nv)
    move[limits.idx_v[value < limits.lower + AT_LIMIT]] = BEND
    move[limits.idx_v[value > limits.upper - AT_LIMIT]] = -BEND
    moved = _moved(problem, state, start, move)
    return None if np.array_equal(moved, start) else moved


def restarts(problem: Problem, state: State, start: Array, rng: np.random.Generator, count: int) -> Iterator[Array]:
    """Random postures (nq,) within limits and bounds, as far as `SPREADS`, shares of the ranges, say in turn."""
    lower, upper = _ranges(problem, start)
    span = upper - lower
    for number in range(count):
        spread = SPREADS[number % len(SPREADS)]
        yield _moved(problem, state, start, rng.uniform(-0.5, 0.5, len(span)) * spread * span)


def halfway(problem: Problem, state: State, start: Array) -> Array:
    """The start (nq,) half way to the middle of every joint's range: stretched limbs are bent. It moves the state."""
    lower, upper = _ranges(problem, start)
    return _moved(problem, state, start, 0.25 * (lower + upper))


def least_effort(problem: Problem, state: State) -> list[Array]:
    """The postures (nq,) from which efforts count, but the start: of who kneels, one that kneels; moves the state."""
    start, model = problem.scene.figure.clamp(problem.start), problem.scene.model
    rests = [each.distance.reference for each in problem.measures if type(each) is Effort]
    found = [_moved(problem, state, start, pin.difference(model, start, q)) for q in rests if (q != start).any()]
    return [q for q in found if (q != start).any()]


def hooked_hands(problem: Problem, state: State, start: Array) -> Iterator[Array]:
    """The start with hooked fingers of every hand that takes a bar by a power grip, shape (nq,); nothing without."""
    figure, terms = problem.scene.figure, (*problem.goals, *problem.constraints)
    grips = [term for term in terms if isinstance(term, Grasp) and term.kind == "power"]
    for angles in opened_for_a_bar(sorted({term.frame.removesuffix("_palm") for term in grips})):
        if angles.keys() <= set(figure.joints):
            move = pin.difference(figure.model, start, figure.with_joints(start, angles))
            yield _moved(problem, state, start, move)


def crouched(problem: Problem, state: State, start: Array) -> Iterator[Array]:
    """The start with everybody who balances in the posture "squatting", shape (nq,); none with nobody.

    Who has feet that slide faces each of `HEADINGS`.
    """
    figure, moves = problem.scene.figure, list[list[Array]]()
    upright = [term for term in problem.constraints if is_a(term, UPRIGHT) and getattr(term, "balance", True)]
    for term in upright:
        body = body_of(problem.scene, term.feet)
        if getattr(term, "knees", None) or (root := _root_at(problem, start, body)) is None:
            continue
        usual, low = _root_at(problem, figure.neutral, body), _root_at(problem, start, body, f"{body}squatting")
        if usual is not None and low is not None:
            turns, down = HEADINGS if isinstance(term, Stand) else HEADINGS[:1], usual.inverse() * low
            made = [_to_posture(problem, start, body, "squatting", root * turn * down) for turn in turns]
            moves.append(made * (len(HEADINGS) // len(turns)))
    found = [np.sum(each, axis=0) for each in zip(*moves, strict=True)]
    for number, move in enumerate(found):
        if not number or (move != found[0]).any():  # feet that are held face one way
            yield _moved(problem, state, start, move)


def seated(problem: Problem, state: State, start: Array, ahead: float = 0.0, arms: str = "sitting") -> Iterator[Array]:
    """The start (nq,) with who sits on something in the posture "sitting" there, facing each of `HEADINGS`.

    The pelvis is in the middle of the seat, or `ahead` of it: 1 is as near to the edge as it may be. Arms that reach
    are as in a posture by name: ahead of who sits, they are above a desk and not below it. Of several who sit one after
    the other does, then all at once, each turned by as much.
    """
    figure, moves = problem.scene.figure, list[list[Array]]()
    stated: tuple[Any, ...] = (*problem.goals, *problem.stated)
    for term in (term for term in stated if isinstance(term, Sit)):
        body = body_of(problem.scene, [term.pelvis])
        if body is None or (usual := _root_at(problem, start, body, f"{body}sitting")) is None:
            continue
        over = next(part for part in term.parts if isinstance(part, Over))
        if not np.isfinite(over.high).all():  # on a floor one place is as good as another
            continue
        place, face, high = over.place, over.face, over.high[2]
        middle, axes = face.at(state.update(start))
        pelvis = figure.placement(figure.posture(f"{body}sitting"), figure.model.frames[place.frame].name)
        at = middle + high * axes[2]
        reaching = _reaching(problem, start, body)
        moves.append([])
        for turn in HEADINGS:
            heading = axes[:2] @ turn.rotation[:, 0]
            edge = ahead * (over.high[:2] / np.maximum(np.abs(heading), 1e-9)).min() * heading @ axes[:2]
            root = pin.SE3(np.eye(3), at + edge) * turn * pin.SE3(np.eye(3), -pelvis.translation) * usual
            moves[-1].append(_to_posture(problem, start, body, "sitting", root))
            moves[-1][-1][reaching] = pin.difference(figure.model, start, figure.posture(f"{body}{arms}"))[reaching]
    together = [np.sum(each, axis=0) for each in zip(*moves, strict=True)] if len(moves) > 1 else []
    for move in (*chain.from_iterable(moves), *together):
        yield _moved(problem, state, start, move)


def arms_ahead(problem: Problem, state: State, start: Array, level: bool = False) -> Iterator[Array]:
    """The start (nq,) with all arms that reach as in the posture "arms_forward", or with level forearms, over a desk.

    Nothing where no arm reaches.
    """
    figure, move = problem.scene.figure, np.zeros(problem.scene.model.nv)
    for body in figure.bodies:
        angles = {f"{body}{side}_{joint}": angle for side in ("left", "right") for joint, angle in LEVEL.items()}
        if (name := f"{body}arms_forward") in figure.postures and {*angles} <= {*figure.joints}:
            q = figure.with_joints(start, angles) if level else figure.posture(name)
            reaching = _reaching(problem, start, body)
            move[reaching] = pin.difference(figure.model, start, q)[reaching]
    if move.any():
        yield _moved(problem, state, start, move)


def _reaching(problem: Problem, start: Array, body: str) -> Indices:
    """Degrees of freedom of those arms of a body that a term moves."""
    figure, terms = problem.scene.figure, tuple[Any, ...]((*problem.goals, *problem.stated))
    free = {arm.replace("_upper", "") for arm in free_arms(problem.scene, start, terms, problem.bounds, {body})}
    groups = [f"{body}{side}_arm" for side in ("left", "right")]
    return figure.dofs([arm for arm in groups if arm in figure.groups and arm not in free])


def _root_at(problem: Problem, q: Array, body: str | None, posture: str = "") -> pin.SE3 | None:
    """Where the free root of a body is at q (nq,) or in a posture by name; None without such a posture or root."""
    figure = problem.scene.figure
    root = figure.roots.get(f"{body}root")
    if root is None or (posture and posture not in figure.postures):
        return None
    idx = int(figure.model.joints[root].idx_q)
    return pin.XYZQUATToSE3((figure.posture(posture) if posture else q)[idx : idx + 7])


def _to_posture(problem: Problem, start: Array, body: str | None, name: str, root: pin.SE3) -> Array:
    """The move (nv,) of one body from the start (nq,) to a posture by name, its root at a placement."""
    figure, move = problem.scene.figure, np.zeros(problem.scene.model.nv)
    q, idx = figure.posture(f"{body}{name}"), int(figure.model.joints[figure.roots[f"{body}root"]].idx_q)
    q[idx : idx + 7] = pin.SE3ToXYZQUAT(root)
    own = figure.bodies[str(body)]
    first, last = (figure.model.joints[joint] for joint in (own[0], own[-1]))
    dofs = slice(first.idx_v, last.idx_v + last.nv)
    move[dofs] = pin.difference(figure.model, start, q)[dofs]
    return move


def throughout(problem: Problem, state: State, start: Array, rng: np.random.Generator, count: int) -> Iterator[Array]:
    """Postures within limits, shape (nq,), of which each joint has every part of its range once.

    A Latin hypercube (M. D. McKay, R. J. Beckman, W. J. Conover, "A comparison of three methods for selecting values of
    input variables", Technometrics 21, 1979). Joints without limits stay near the start; the state is moved.
    """
    lower, upper = _ranges(problem, start)
    parts = rng.permuted(np.tile(np.arange(count), (len(lower), 1)), axis=1)
    for share in ((parts + rng.uniform(size=parts.shape)) / count).T:
        yield _moved(problem, state, start, lower + share * (upper - lower))


def alike(ends: Sequence[float]) -> bool:
    """Whether three ends of descents are the least and equally far from the goals: others are no nearer."""
    return len(ends) >= 3 and sorted(ends)[2] <= 1.1 * min(ends)


def _ranges(problem: Problem, start: Array) -> tuple[Array, Array]:
    """The least and the largest move (nv,) of each degree of freedom from a posture (nq,), all of them finite."""
    lower, upper = problem.scene.figure.tangent_bounds(start)
    # m and rad, for joints without limits, but those that turn about one axis, or carry a figure to its goals
    spread, figure, carriers = np.full(len(lower), 0.2), problem.scene.figure, list[tuple[int, int, float]]()
    free = set() if problem.stated or problem.bounds else set(figure.roots.values())
    for number, joint in enumerate(figure.model.joints):
        kind, first = joint.shortname(), joint.idx_v
        if number and kind.startswith("JointModelR"):  # the first is the world
            spread[first] = TURN
        elif kind == "JointModelPlanar":
            carriers.append((first, 2, 0.1))
            spread[first + 2] = TURN
        elif kind.startswith("JointModelP"):
            carriers.append((first, 1, 0.1))
        elif number in free:
            carriers.append((first, 3, 1.0))  # m: what is nearer is in the reach of limbs
    missed = _missed(problem, start) if carriers else 0.0
    for first, count, least in carriers:
        if missed > least:
            spread[first : first + count] = 2.0 * missed
    limited = np.isfinite(upper - lower)
    return np.where(limited, lower, -0.5 * spread), np.where(limited, upper, 0.5 * spread)


def _missed(problem: Problem, start: Array) -> float:
    """The farthest that a goal is from being met at a posture (nq,), metres."""
    with problem.scene.figure.posed(start) as state:
        missed = [np.where(goal.angular, 0.0, goal.error(state)) for goal in problem.goals]
    return max((float(np.linalg.norm(each)) for each in missed), default=0.0)


def _moved(problem: Problem, state: State, start: Array, move: Array) -> Array:
    """The start moved by (nv,) as far as limits and bounds allow."""
    figure = problem.scene.figure
    box = allowed(problem.bounds, figure.limits, state.update(start), None)
    return figure.clamp(np.asarray(pin.integrate(figure.model, start, np.clip(move, *box))))
