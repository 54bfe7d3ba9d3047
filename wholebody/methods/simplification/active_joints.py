"""The active joints of a problem, and a bound on the cost of locking the others.

The joints that move a goal are active. So is every joint of an equality (a held foot, a closed loop) that an active
joint moves: without it the equality would lock the others. A joint beyond its limits is active, and one between two
pieces that are too near at the start, because they need repair. A joint that a measure combines with others is active,
because the measure would have no bound; a square of `Rhythm` or of a ball joint does so only where one of its joints is
active, because it is never less than zero. All other joints stay where they start.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Mask
from wholebody.figures.self_pairs import random_postures
from wholebody.figures.state import State, Wrench
from wholebody.geometry.pieces import COAL_ACCURACY
from wholebody.problem import Problem
from wholebody.tasks.base import Constraint, Goal, Measure
from wholebody.tasks.checks import defined
from wholebody.tasks.discomfort import Discomfort
from wholebody.tasks.distance import Displacement, Effort, RotationEffort
from wholebody.tasks.rhythm import Rhythm

SEPARABLE = (Effort, Displacement, Discomfort)  # measures that are sums over joints; `Rhythm` is one over its squares
NOTHING = 1e-9  # entries of a Jacobian below this are rounding


@dataclass(frozen=True)
class ActiveJoints:
    """The joints of a problem: active, frozen, or locked."""

    moving: Mask  # (njoints,) the active joints
    frozen: Mask  # (njoints,) the joints that a bound keeps in place
    helpers: tuple[str, ...]  # names of the inequalities that a locked joint could have helped to keep
    excess: float  # the measures of the locked joints alone minus their least value


def active_joints(problem: Problem, lock: bool = True) -> ActiveJoints:
    """Find the active joints of a problem; without `lock` all that are not frozen."""
    model = problem.scene.model
    walk = _Walk(problem)
    joint_of = np.repeat(np.arange(1, model.njoints), [joint.nv for joint in list(model.joints)[1:]])
    frozen = _frozen(problem, walk.start(), joint_of)
    moving = np.zeros(model.nv, dtype=bool)
    for goal in problem.goals:
        moving |= _columns(goal, walk).any(axis=0)
    for measure in problem.measures:
        if not isinstance(measure, (*SEPARABLE, Rhythm, RotationEffort)):
            moving |= _slopes(measure, walk)
    moving |= _out_of_limits(problem) | _too_near(problem, walk.start())
    rows = [(term, _columns(term, walk), *_kinds(term, walk.start())) for term in problem.constraints]
    squares = _squares(problem)
    moving = _closed(moving & ~frozen[joint_of], rows, squares, frozen[joint_of])
    joints = np.zeros(model.njoints, dtype=bool)
    joints[joint_of[moving]] = True
    if not (lock and joints.any()):
        joints = ~frozen
        joints[0] = False
    locked = ~joints[joint_of] & ~frozen[joint_of]
    helpers = [type(term).__name__ for term, columns, equal, _ in rows if columns[~equal][:, locked].any()]
    kept = sum(value for places, value in squares if locked[places].any() and not joints[joint_of[places]].any())
    return ActiveJoints(joints, frozen, tuple(dict.fromkeys(helpers)), _excess(problem, walk.state, locked) + kept)


def _squares(problem: Problem) -> list[tuple[list[int], float]]:
    """Places in the tangent and value at the start of each square of `Rhythm`, and of ball joints in an effort."""
    found: list[tuple[list[int], float]] = []
    for term in problem.measures:
        if isinstance(term, Rhythm):
            found += [
                (places, term.weight * weight * excess * excess)
                for weight, excess, places, _ in term.parts(problem.start)
            ]
        elif isinstance(term, RotationEffort):
            found += [(list(ball.idx_v), 0.0) for ball in term.balls]  # efforts count from the start
    return found


def _closed(
    moving: Mask, rows: list[tuple[Constraint, Mask, Mask, Mask]], squares: list[tuple[list[int], float]], frozen: Mask
) -> Mask:
    """Add joints until none is new.

    They are those of equalities and squares that move already, and of inequalities that need repair.
    """
    while True:
        before = moving.copy()
        for _, columns, equal, broken in rows:
            for row in np.flatnonzero(equal | broken):
                if broken[row] or (columns[row] & moving).any():
                    moving |= columns[row] & ~frozen
        for places, _ in squares:
            if moving[places].any():
                moving[places] |= ~frozen[places]
        if (moving == before).all():
            return moving


class _Walk:
    """The start, and random postures with the root as at the start: one state that moves from one to the next."""

    def __init__(self, problem: Problem) -> None:
        self.state = State(problem.scene.model)
        self.postures = np.vstack([problem.start, random_postures(problem.scene.model, 3, seed=0)])
        for root in problem.scene.figure.roots.values():
            first = int(problem.scene.model.joints[root].idx_q)
            self.postures[:, first : first + 7] = problem.start[first : first + 7]

    def start(self) -> State:
        return self.state.update(self.postures[0])

    def __iter__(self) -> Iterator[State]:
        return (self.state.update(q) for q in self.postures)


def _columns(term: Goal | Constraint, states: Iterable[State]) -> Mask:
    """(m, nv) degrees of freedom on which each row depends: exact for wrenches, otherwise from the sampled postures."""
    found: Mask | None = None
    for state in defined(term, states):
        jacobian = term.jacobian(state)
        if isinstance(jacobian, Wrench):
            between = _dofs(state, state.support[jacobian.joint] != state.support[jacobian.against])
            return np.tile(between, (len(jacobian.rows), 1))
        shown = np.abs(np.atleast_2d(jacobian)) > NOTHING
        found = shown if found is None else found | shown
    assert found is not None
    return found


def _dofs(state: State, columns: Mask) -> Mask:
    """(nv,) degrees of freedom to which these columns of the joint Jacobian belong."""
    return np.asarray(state.folded(columns[None].astype(float))[0] > 0.0)


def _slopes(measure: Measure, states: Iterable[State]) -> Mask:
    return np.asarray(np.any([np.abs(measure.gradient(state)) > NOTHING for state in defined(measure, states)], axis=0))


def _kinds(term: Constraint, state: State) -> tuple[Mask, Mask]:
    """The rows that are equalities, and the rows that do not hold at the start."""
    value = np.atleast_1d(term.value(state))
    lower, upper = np.broadcast_to(term.lower, value.shape), np.broadcast_to(term.upper, value.shape)
    return lower == upper, (value < lower - COAL_ACCURACY) | (value > upper + COAL_ACCURACY)


def _frozen(problem: Problem, state: State, joint_of: NDArray[np.intp]) -> Mask:
    """(njoints,) joints none of whose degrees of freedom may move from the state at the start."""
    still = np.zeros(len(joint_of), dtype=bool)
    for bound in problem.bounds:
        low, high = bound.bounds(state, None)
        still |= (low == 0.0) & (high == 0.0)
    frozen = np.zeros(problem.scene.model.njoints, dtype=bool)
    for joint in range(1, len(frozen)):
        frozen[joint] = still[joint_of == joint].all()
    return frozen


def _out_of_limits(problem: Problem) -> Mask:
    low, high = problem.scene.figure.tangent_bounds(problem.start)
    return np.asarray((low > 0.0) | (high < 0.0))


def _too_near(problem: Problem, state: State) -> Mask:
    """Degrees of freedom between the pieces of pairs that are nearer at the start than their clearance."""
    scene = problem.scene
    near = scene.contacts(problem.start, problem.clearance + COAL_ACCURACY)
    wrong = near.pair[near.distance < problem.clearances[near.number] - COAL_ACCURACY]
    joint = scene.pair_table.joint
    between = state.support[joint[wrong[:, 0]]] != state.support[joint[wrong[:, 1]]]
    return _dofs(state, between.any(axis=0))


def _excess(problem: Problem, state: State, locked: Mask) -> float:
    """The locked joints' share of the separable measures minus its least value within their limits.

    All of them move to a limit together: the gradient has the slope of every joint's own share.
    """
    figure = problem.scene.figure
    terms = [measure for measure in problem.measures if isinstance(measure, SEPARABLE)]
    idx_q, idx_v, low, high = figure.limits
    chosen = locked[idx_v] & np.isfinite(low) & np.isfinite(high)
    if not terms or not chosen.any():
        return 0.0
    idx_q, idx_v, low, high = idx_q[chosen], idx_v[chosen], low[chosen], high[chosen]
    begin = np.clip(problem.start[idx_q], low, high)
    turn = np.linspace(0.0, np.pi, 101)  # the shares of the way are dense at the limits, where discomfort is steep
    step = 0.5 * np.sin(turn)[:, None] * turn[1]
    least, q = np.zeros(len(idx_v)), problem.start.copy()
    for end in (low, high):
        slopes = []
        for part in 0.5 - 0.5 * np.cos(turn):
            q[idx_q] = begin + part * (end - begin)
            state.update(q)
            slopes.append(sum((term.weight * term.gradient(state)[idx_v] for term in terms), np.zeros(len(idx_v))))
        slope = np.array(slopes) * (end - begin) * step
        least = np.minimum(least, np.cumsum(0.5 * (slope[1:] + slope[:-1]), axis=0).min(axis=0))
    return -float(least.sum())
