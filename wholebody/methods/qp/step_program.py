"""The program of a tracking step: built and solved by one compiled call, in arrays made once.

What the compiled call does not settle, and what other solvers are to solve, goes to the working set as any program.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.methods.qp.quadratic_program import QuadraticProgram
from wholebody.methods.qp.solvers.base import ACTIVE_SET
from wholebody.methods.qp.subproblem import (
    BOX,
    ELASTIC_WEIGHT,
    ERROR_CLAMP,
    FORCE,
    LEAST_CURVATURE,
    LEVER,
    MOST_ROWS,
    PROXIMAL_SHARE,
    Rows,
    Subproblem,
)
from wholebody.methods.qp.subproblem import compiled_kernel as compiled_subproblem
from wholebody.methods.qp.working_set import LIMITS, WorkingSet
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.base import Constraint
from wholebody.terms.constraint_values import ConstraintValues
from wholebody.terms.linearisation import PackedLinearisation

RADIUS = 0.1  # rad, m: what a goal that jumps may ask of one step, before velocity bounds
DAMPING = 2.0
"""Of the pull of goals out of reach. Larger is calmer, and more steps end up to 0.08 mm short of a clearance. Reaches
into a block at four places: accelerations of 0.58 to 0.63 rad/s^2 with 2, and 1 step of 800 short by more than 1e-3
mm; 0.54 to 0.60 and 3 steps with 2.5; 0.53 to 0.57 and 3 steps with 3. At one of them 0.80 with 1, 0.71 with 1.5."""

SETTLING = 1.0  # s: measures lessen by 1/e in it: longer = slower to settle, shorter = jolts at bounds, then swinging
RESTING = 1e-5  # m, rad: a goal missed by less than this, and more than foreseen, rests; less left of one is reached
CURVED = 1e-4  # m, rad: by how much a step runs ahead of a hold as the last one was curved; more overshoots after jumps
LITTLE = 0.01  # damping that makes no difference to how a step looks
WORSE = 2.0  # times the damping of a program that its answer may ask for before it is solved again with that
BENT = 5e-5  # m rad: change of motion times turn above which it is looked at how a step curves what is held
STRAIGHT = 1.5e-6  # m, rad: by which what is held may be curved other than as foreseen without another program
TRADED = 0.5  # see `StepProgram.solve`: greater = weights count in more steps, and light goals wait in more
AGAIN = 2  # times that a program is solved again at most; with 1 a goal that is just blocked makes limbs jump


class Answer(NamedTuple):
    """Answer to the program of a step.

    Attributes:
        x: (n,) displacement; overwritten by the next program.
        motion: longest way of any point of any piece, metres, to first order.
        turn: largest turn of a piece, radians.
        worst: largest violation of an elastic row at x = 0, metres.
        spare: least distance beyond its clearance that a contact has after the displacement, metres, to first order;
            negative infinite where it is not known.
        missed: largest violation of an elastic row after the displacement, metres or radians, to first order.
        asked: least clearance asked of a contact, metres; infinite without contacts.
        exact: see `QPSolution`, like the next two.
        iterations: of the solver.
        by: what closed the program.
    """

    x: Array
    motion: float
    turn: float
    worst: float
    spare: float
    missed: float
    asked: float
    exact: bool
    iterations: int
    by: str


class StepProgram:
    """Builds and solves the programs of one tracker.

    Attributes:
        goals: number of the goals' rows.
    """

    def __init__(self, problem: Problem, workspace: Workspace, working_set: WorkingSet, dt: float) -> None:
        """Take the terms of a problem.

        Args:
            problem: what is asked.
            workspace: of the run; its state is moved to the problem's start.
            working_set: solves what the compiled call does not.
            dt: seconds a step.
        """
        state, self._working_set = workspace.state, working_set
        self._workspace, self._subproblem = workspace, Subproblem(problem, state)
        self._kernel, self._motion = compiled_kernel(), compiled_subproblem().motion
        self.goals = len(self._subproblem.goal_share)
        self._share = self._even = np.ones(self.goals)
        self._mixed = bool((self._subproblem.goal_share < 1.0).any())
        self._soft = self.goals + int((self._subproblem.kind == 0).sum())
        self._variables, self._columns, self._elastic = state.model.nv, len(state.column_joint), 0
        self._settled, self._curving, self._bend = False, False, 0.0
        self._held = np.flatnonzero(self._subproblem.kind == 0)
        self._holding, self._among = _holding(problem, state, self._held)
        self._holds = ConstraintValues([problem.constraints[k] for k in self._holding], state)
        self._asked = self._subproblem.bound[0, self._held]
        self._there = State(state.model)
        self._twist = np.empty((state.model.njoints, 6))
        self._unknown = np.zeros((2, self._variables), dtype=bool)
        places = np.arange(state.model.nv, dtype=float)
        self._joints = np.concatenate(
            [state.spread(places).astype(np.intp), state.column_joint, state.parents, workspace.table.joint]
        )
        self.take(dt)
        self._before = np.zeros(state.model.nq + self._soft + 2)
        """See `tracking_kernel.solve`."""
        self._after = self._before.copy()
        self._grow(64)

    def take(self, seconds: float) -> None:
        """Make the next steps take so long, for what measures do meanwhile."""
        # without goals the measures are the task
        gain = min(1.0, seconds / SETTLING) if self.goals else 1.0
        self._numbers = numbers_of(self._subproblem.scale, gain)

    def hold(self, constraints: Sequence[Constraint]) -> bool:
        """Take others in place of the problem's constraints, with the same bounds; the last step is forgotten.

        Returns:
            Whether they are of the same classes and frames; if not, nothing is done.
        """
        self._before[-1], self._curving, self._bend = 0.0, False, 0.0
        return self._holds.take([constraints[k] for k in self._holding])

    def solve(self, at: PackedLinearisation, measures: bool) -> Answer:
        """The answer of the step from where the workspace's state is, and its pieces' placements.

        Goals weigh alike, so that light ones do not wait for heavy ones. Where that would lessen light ones at the
        expense of heavy ones, which conflict then, weights count.

        Args:
            at: linearisation there.
            measures: whether the measures count; without them the nearest posture to the goals is sought.
        """
        self._share = self._even
        answer, damping = self._damped(at, measures)
        if self._mixed and self._trades(answer.x):
            self._share = self._subproblem.goal_share
            answer, damping = self._damped(at, measures)
        bend, self._bend = self._bend, answer.motion * answer.turn
        if len(self._held) and (self._curving or abs(self._bend - bend) > BENT):
            self._curving = self._foresee(at, answer.x)
            if self._curving:
                answer, _, _ = self._once(at, measures, damping)
        return answer

    def ended(self, q: Array, displacement: Array, whole: bool) -> None:
        """Remember a step.

        Args:
            q: (nq,) the posture where it ended.
            displacement: (nv,).
            whole: whether that is the last program's answer as it was.
        """
        after = self._after
        if not (whole and self._settled):
            gone = self._soft_rows @ displacement
            left = gone[: self.goals] - self._target[: self.goals]
            after[len(q) : -2] = self._soft_values[0] + gone
            after[-2], after[-1] = sqrt(left @ left), 1.0
        after[: len(q)] = q
        self._before, self._after = after, self._before

    def rows(self, at: PackedLinearisation) -> Rows:
        """The rows of the last program; overwritten by the next."""
        k, first = self._elastic, self._first_elastic
        after = first + k * self._variables
        return Rows(
            self._soft_rows, self._soft_values[0], self._soft_values[1], self.goals,
            self._floats[first:after].reshape(k, self._variables), self._floats[after : after + k], self._integers[:k],
            self._subproblem.one_sided + len(at.contacts.distance), self._integers[k : 2 * k],
        )  # fmt: skip

    def program(self) -> QuadraticProgram:
        """The last program; overwritten by the next."""
        n, k, ends = self._variables, self._elastic, self._ends()
        elastic, least, weight = (self._floats[ends[i - 1] : ends[i]] for i in (7, 9, 10))
        return QuadraticProgram(
            self._entries[0], self._entries[1], self._soft_rows, self._target, self._soft_values[1],
            elastic.reshape(k, n), least, weight, self._entries[2], self._entries[3],
        )  # fmt: skip

    def bounded(self, at: PackedLinearisation) -> tuple[Array, Array]:
        """Rows (k, nv) of the constraints, and how far (k,) they are from their bounds; less than zero beyond."""
        value, rows = at.value[at.goals :], at.jacobian[at.goals : len(at.value)]
        lower, upper = self._subproblem.bound
        low, high = np.isfinite(lower), np.isfinite(upper)
        return (
            np.concatenate([rows[low], -rows[high]]),
            np.concatenate([value[low] - lower[low], upper[high] - value[high]]),
        )

    def motion(self, at: PackedLinearisation, displacement: Array) -> tuple[float, float]:
        """Longest way of any point of any piece, metres, and largest turn, to first order in the displacement (nv,).

        The workspace's state is where the linearisation is.
        """
        state, table = self._workspace.state, self._workspace.table
        way, turn = self._motion(
            state.spread(displacement), state.columns, state.column_joint, state.parents, table.joint,
            at.contacts.placements, table.reach, self._twist,
        )  # fmt: skip
        return way, turn

    def _damped(self, at: PackedLinearisation, measures: bool) -> tuple[Answer, float]:
        """An answer with as much damping as it asks for itself, and the damping."""
        answer, damping, asked = self._once(at, measures, 0.0)
        for _ in range(AGAIN):
            if asked <= WORSE * max(damping, LITTLE):
                break
            answer, damping, asked = self._once(at, measures, asked)
        return answer, damping

    def _trades(self, x: Array) -> bool:
        """Whether the displacement x (nv,) lessens light goals at the expense of heavy ones.

        It does where the weighted error lessens by a smaller share than half of that of the error without weights.
        """
        error = self._soft_values[0, : self.goals]
        after, share = error + self._soft_rows[: self.goals] @ x, self._subproblem.goal_share
        even, weighted = (sqrt(by @ after**2) / max(sqrt(by @ error**2), RESTING) for by in (self._even, share))
        return 1.0 - weighted < TRADED * (1.0 - even)

    def _once(self, at: PackedLinearisation, measures: bool, least_damping: float) -> tuple[Answer, float, float]:
        """An answer, the damping of its program, and what it asks for.

        Raises:
            InputError: the terms have other numbers of rows than at the start.
        """
        own, working, workspace = self._subproblem, self._working_set, self._workspace
        own.check_rows(at.goals, len(at.value) - at.goals)
        k = self._elastic = own.one_sided + len(at.gap)
        if 5 * k > len(self._integers):
            self._grow(2 * k)
        held = working.held if working.hot else self._unknown
        solved, count, motion, turn, worst, spare, missed, least, damping, asked = self._kernel.solve(
            at.value, at.jacobian, at.gap, at.gap_contact, at.clearance, at.contacts.number, at.measure, at.box, at.q,
            self._before, self._after, own.kind, own.bound, self._share, held, working.pushing,
            workspace.state.columns, self._joints, at.contacts.placements, workspace.table.reach, self._twist,
            self._floats, self._integers, self._masks, self._numbers, measures, working.hot, least_damping,
        )  # fmt: skip
        self._settled = solved
        if solved:
            working.pushing = self._integers[2 * k : 2 * k + count].copy()
            by = working.solver.count([ACTIVE_SET])
            return Answer(self._x, motion, turn, worst, spare, missed, least, True, 0, by), damping, asked
        rows = self.rows(at)
        answer = working.solve(self.program(), rows.key)
        motion, turn = self.motion(at, answer.x)
        missed = float((rows.elastic_violation - rows.elastic @ answer.x).max(initial=0.0))
        remains = self._soft_rows[: self.goals] @ answer.x - self._target[: self.goals]
        left, error = sqrt(remains @ remains), sqrt(at.value[: self.goals] @ at.value[: self.goals])
        asked = DAMPING * min(1.0, left / max(error, 1e-12)) if left > RESTING else 0.0
        answered = (answer.exact, answer.iterations, answer.by)
        return Answer(answer.x, motion, turn, worst, spare, missed, least, *answered), damping, asked

    def _foresee(self, at: PackedLinearisation, displacement: Array) -> bool:
        """Have what is held run ahead of as this displacement (nv,) is curved, not as that of the last step was.

        Returns:
            Whether that is another curve than the last program ran ahead of.
        """
        state = self._there.update(pin.integrate(self._there.model, at.q, displacement))
        other: bool = self._kernel.run_ahead(
            self._holds.at(state)[self._among], self._asked, self._soft_values[0], self._soft_rows, displacement, at.q,
            self.goals, 2.0 * RESTING, CURVED, STRAIGHT, self._before,
        )  # fmt: skip
        return other

    def _ends(self) -> Any:
        """See `tracking_kernel.parts`."""
        return self._kernel.parts(self._variables, self._soft, self._elastic, self._columns)

    def _grow(self, elastic: int) -> None:
        """Make room for so many elastic rows."""
        n, m = self._variables, self._soft
        ends = self._kernel.parts(n, m, elastic, self._columns)
        self._floats = floats = np.zeros(ends[-1])
        self._integers, self._masks = np.zeros(5 * elastic, dtype=np.intp), np.zeros(2 * (n + elastic), dtype=bool)
        self._x, self._target = floats[:n], floats[ends[2] : ends[3]]
        self._soft_values = floats[ends[3] : ends[4]].reshape(2, m)
        self._entries = floats[ends[4] : ends[5]].reshape(4, n)
        self._soft_rows, self._first_elastic = floats[ends[5] : ends[6]].reshape(m, n), ends[6]


def _holding(problem: Problem, state: State, held: NDArray[np.intp]) -> tuple[list[int], NDArray[np.intp]]:
    """Numbers of constraints with equalities, and where these rows, `held` among those of all, are among theirs."""
    sizes = [np.size(constraint.value(state)) for constraint in problem.constraints]
    owner = np.repeat(np.arange(len(sizes)), sizes)
    holding = np.unique(owner[held])
    return holding.tolist(), np.searchsorted(np.flatnonzero(np.isin(owner, holding)), held)


def numbers_of(scale: float, gain: float) -> Array:
    """What `tracking_kernel.solve` takes of the constants.

    Args:
        scale: of the measures.
        gain: share of the way to the least measures that a step is to go.

    Returns:
        What `subproblem_kernel.program` takes (10), damping, what counts
        as rest, weight of elastic rows, most rows of a contact, force of goals (4), limits of the working set
        (6), how far what is held is run ahead of.
    """
    program = (
        scale,
        LEAST_CURVATURE,
        PROXIMAL_SHARE,
        RADIUS,
        ERROR_CLAMP * RADIUS,
        0.0,
        LEVER,
        BOX * RADIUS,
        ERROR_CLAMP * RADIUS,
    )
    own = (gain, DAMPING, RESTING, ELASTIC_WEIGHT, MOST_ROWS)
    return np.array([*program, *own, *FORCE, *LIMITS, CURVED])


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.methods.qp import tracking_kernel

    none, index = np.zeros(0), np.zeros(0, dtype=np.intp)
    ends = tracking_kernel.parts(1, 0, 0, 1)
    tracking_kernel.solve(
        none, np.zeros((0, 1)), none, index, none, index, np.zeros((2, 2)), np.zeros((2, 1)), none, np.zeros(2),
        np.zeros(2), index, np.zeros((2, 0)), none, np.zeros((2, 1), dtype=bool), index, np.zeros((1, 6)),
        np.zeros(4, dtype=np.intp), np.zeros((1, 4, 3)), np.ones(1), np.zeros((1, 6)), np.zeros(ends[-1]), index,
        np.zeros(2, dtype=bool), numbers_of(1.0, 1.0), True, False, 0.0,
    )  # fmt: skip
    ahead = np.zeros((2, 0))
    tracking_kernel.run_ahead(none, none, ahead[0], np.zeros((0, 1)), none, none, 0, 0.0, 0.0, 0.0, np.zeros(2))
    return tracking_kernel
