"""The program of a tracking step, built and solved by one compiled call in arrays made once, and its answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, brief, with_values
from wholebody.base.compiled import with_loops
from wholebody.figures.state import State
from wholebody.methods.qp.active_set import compiled_kernel as compiled_sets
from wholebody.methods.qp.quadratic_program import (
    NUMBERS,
    QuadraticProgram,
    Rows,
    StepParts,
    StepRoom,
    StepSize,
    Terms,
    work_size,
)
from wholebody.methods.qp.settings import CORRECTIONS, PROGRAM, STEP, WEIGHTS
from wholebody.methods.qp.solvers.base import ACTIVE_SET, WorkingSet
from wholebody.methods.qp.subproblem import Subproblem
from wholebody.methods.qp.turning import Turning
from wholebody.methods.qp.turning import compiled_kernel as compiled_turning
from wholebody.problem import Problem
from wholebody.scene.moving_obstacles import Collision
from wholebody.scene.workspace import Workspace
from wholebody.tasks.base import Constraint
from wholebody.terms.linearisation import ConstraintValues, PackedLinearisation


class Answer(NamedTuple):
    """Answer to the program of a step."""

    x: Array  # (n,) displacement; overwritten by the next program
    motion: float  # longest way of any point of any piece, metres, to first order
    turn: float  # largest turn of a piece, radians
    worst: float  # largest violation of an elastic row at x = 0, metres
    # least distance beyond its clearance that a contact has after the displacement, metres, to first order; negative
    # infinite where it is not known
    spare: float
    missed: float  # largest violation of an elastic row after the displacement, metres or radians, to first order
    asked: float  # least clearance asked of a contact, metres; infinite without contacts
    exact: bool  # see `QPSolution`, like the next two
    iterations: int  # of the solver
    by: str  # what closed the program


class StepProgram:
    """Builds and solves the programs of one tracker; `goals` is the number of the goals' rows."""

    def __init__(self, problem: Problem, workspace: Workspace, working_set: WorkingSet, dt: float) -> None:
        """Take the terms of a problem, for steps of `dt` s; `working_set` solves what the compiled call does not."""
        state, self._working_set = workspace.state, working_set
        self.turning, self._subproblem, self._kernel = Turning(workspace), Subproblem(problem, state), compiled_kernel()
        self._given = terms = self._subproblem.terms
        self._even = with_values(terms, share=np.ones(len(terms.share)))
        self.goals, self._mixed = len(terms.share), bool((terms.share < 1.0).any())
        self._held = np.flatnonzero(terms.kind == 0)
        self._variables, self._soft = state.model.nv, self.goals + len(self._held)
        self._settled, self._curving, self._bend = False, False, 0.0
        self._holding, self._among = _holding(problem, state, self._held)
        self._holds = ConstraintValues([problem.constraints[k] for k in self._holding], state)
        self._asked = terms.bound[0, self._held]
        self._there = State(state.model)
        self._workspace = workspace
        table, length = workspace.table, state.model.nq + self._soft + 2
        self._places = np.concatenate([[len(terms.kind)], terms.kind, *self.turning.joints])
        self._fixed = np.concatenate([
            numbers_of(self._subproblem.scale), terms.share, terms.bound.ravel(), table.reach,
            np.zeros(18 * state.model.njoints + 2 * length),
        ])  # fmt: skip
        self._share = self._fixed[NUMBERS : NUMBERS + self.goals]
        self._before, self._after = self._fixed[len(self._fixed) - 2 * length :].reshape(2, length)
        """See `tracking_kernel.solve`, like the arrays before."""
        self._ended_at = self._before[: state.model.nq]
        self._sizes, self._laid_out = (0, 0), dict[tuple[int, int], StepParts]()
        self.take(dt)
        self._grow(64)

    def take(self, seconds: float) -> None:
        """Make the next steps take so long, for what measures do meanwhile."""
        # without goals the measures are the task
        gain = min(1.0, seconds / STEP.settling) if self.goals else 1.0
        self._fixed[4] = gain

    def hold(self, constraints: Sequence[Constraint]) -> bool:
        """Take constraints of the same classes and frames, or do nothing; whether it did. The last step is lost."""
        self._before[-1], self._curving, self._bend = 0.0, False, 0.0
        return self._holds.take([constraints[k] for k in self._holding])

    def solve(self, at: PackedLinearisation, measures: bool) -> Answer:
        """The answer of the step from where the workspace's state is, and its pieces' placements."""
        # Goals have equal weights, so that all progress; their own weights count in a conflict.
        answer, damping = self._damped(at, measures, self._even)
        given = self._even
        if self._mixed and self._trades(answer.x):
            given = self._given
            answer, damping = self._damped(at, measures, given)
        bend, self._bend = self._bend, answer.motion * answer.turn
        if len(self._held) and (self._curving or abs(self._bend - bend) > STEP.bent):
            self._curving = self._predict_curving(at, answer.x)
            if self._curving:
                answer, _, _ = self._once(at, measures, given, damping)
        return answer

    def ended(self, q: Array, displacement: Array, whole: bool) -> None:
        """Remember a step that ended at q (nq,) by a displacement (nv,), the last program's answer if `whole`."""
        if not (whole and self._settled):
            rows, program, after = self._parts.rows, self._parts.program, self._after
            gone = rows.soft @ displacement
            left = (gone - program.target)[: self.goals]
            after[len(q) : -2] = rows.soft_error + gone
            after[-2], after[-1] = sqrt(left @ left), 1.0
        self._before[:] = self._after
        self._ended_at[:] = q

    @property
    def rows(self) -> Rows:
        """The rows of the last program; overwritten by the next."""
        return self._parts.rows

    @property
    def program(self) -> QuadraticProgram:
        """The last program; overwritten by the next."""
        return self._parts.program

    def bounded(self, at: PackedLinearisation) -> tuple[Array, Array]:
        """Rows (k, nv) of the constraints, and how far (k,) they are from their bounds; less than zero beyond."""
        value, rows = at.value[at.goals :], at.jacobian[at.goals : len(at.value)]
        lower, upper = self._given.bound
        low, high = np.isfinite(lower), np.isfinite(upper)
        return (
            np.concatenate([rows[low], -rows[high]]),
            np.concatenate([value[low] - lower[low], upper[high] - value[high]]),
        )

    def _damped(self, at: PackedLinearisation, measures: bool, given: Terms) -> tuple[Answer, float]:
        """An answer with as much damping as it asks for itself, and the damping."""
        answer, damping, asked = self._once(at, measures, given, 0.0)
        for _ in range(STEP.again):
            if asked <= STEP.worse * max(damping, STEP.little):
                break
            answer, damping, asked = self._once(at, measures, given, asked)
        return answer, damping

    def _trades(self, x: Array) -> bool:
        """Whether the displacement x (nv,) improves goals of small weight at the expense of goals of large weight."""
        # True if the weighted error falls relatively by less than half as much as the unweighted error.
        rows = self._parts.rows
        error = rows.soft_error[: self.goals]
        after = error + rows.soft[: self.goals] @ x
        shares = (self._even.share, self._given.share)
        even, weighted = (sqrt(by @ after**2) / max(sqrt(by @ error**2), STEP.resting) for by in shares)
        return 1.0 - weighted < STEP.traded * (1.0 - even)

    def _once(
        self, at: PackedLinearisation, measures: bool, given: Terms, least_damping: float
    ) -> tuple[Answer, float, float]:
        """An answer, the damping of its program, and what it asks for."""
        own, working, contacts = self._subproblem, self._working_set, at.contacts
        own.check_rows(at.goals, len(at.value) - at.goals)
        k = own.one_sided + len(at.gap)
        if 5 * k > len(self._room.integers):
            self._grow(2 * k)
        self._sizes = (k, own.one_sided + len(contacts.distance))
        if working.held is not self._last:
            self._last[:] = False if working.held is None else working.held
        fixed = self._fixed
        if self._mixed:
            self._share[:] = given.share
        fixed[2], fixed[3] = least_damping, measures
        arrays = (
            at.value, at.jacobian, at.gap, at.gap_contact, at.clearance, at.measure, at.box, at.q, contacts.number,
        )  # fmt: skip
        solved, count, motion, turn, worst, spare, missed, least, damping, asked = self._kernel.solve(
            arrays, self._workspace.state.columns, contacts.placements, working.pushing, fixed, self._places,
            self._buffers, working.solver.hot_start,
        )  # fmt: skip
        self._settled = solved
        if solved:
            working.pushing = self._room.integers[2 * k : 2 * k + count].copy()
            working.held, by = self._last, working.solver.count(ACTIVE_SET)
            return Answer(self._x, motion, turn, worst, spare, missed, least, True, 0, by), damping, asked
        if working.solver.hot_start:
            working.reset()  # what was known of the last one did not settle
        rows, program = self._parts.rows, self._parts.program
        answer = working.solve(program, rows.key)
        motion, turn = self.turning.motion(at, answer.x)
        room = rows.elastic @ answer.x - rows.elastic_violation
        missed, spare = -float(room.min(initial=0.0)), float(room[k - len(at.gap) :].min(initial=np.inf))
        remains = (rows.soft @ answer.x - program.target)[: self.goals]
        left, error = sqrt(remains @ remains), sqrt(at.value[: self.goals] @ at.value[: self.goals])
        asked = STEP.damping * min(1.0, left / max(error, 1e-12)) if left > STEP.resting else 0.0
        answered = (answer.exact, answer.iterations, answer.by)
        return Answer(answer.x, motion, turn, worst, spare, missed, least, *answered), damping, asked

    def _predict_curving(self, at: PackedLinearisation, displacement: Array) -> bool:
        """Correct held terms for the curvature of a displacement (nv,); whether the last program's differs."""
        state, rows = self._there.update(pin.integrate(self._there.model, at.q, displacement)), self._parts.rows
        there = self._holds.at(state)[self._among] - self._asked
        curved = there - (rows.soft_error + rows.soft @ displacement)[self.goals :]
        other: bool = self._kernel.run_ahead(curved, rows.soft_error, self.goals, at.q, STEP, self._before)
        return other

    @property
    def _parts(self) -> StepParts:
        """The last program in its room."""
        found = self._laid_out.get(self._sizes)
        if found is None:
            layout = self._kernel.parts.py_func  # a compiled loop would look up each record's class to return it
            sizes = (self._variables, self.goals, self._soft, *self._sizes)
            found = layout(self._room, *sizes)
            self._laid_out[self._sizes] = found
        return found

    def _grow(self, elastic: int) -> None:
        """Make room for so many elastic rows."""
        n, m = self._variables, self._soft
        room = 5 * n + 3 * m + m * n + elastic * (n + 3) + work_size(n, m, elastic)  # see `tracking_kernel.parts`
        self._room = StepRoom(
            np.zeros(room), np.zeros(5 * elastic, dtype=np.intp), np.zeros(2 * (n + elastic), dtype=bool)
        )
        self._buffers = tuple(self._room)
        self._x, self._last = self._room.floats[:n], self._room.masks[: 2 * n].reshape(2, n)
        self._laid_out.clear()


def _holding(problem: Problem, state: State, held: NDArray[np.intp]) -> tuple[list[int], NDArray[np.intp]]:
    """Numbers of constraints with equalities, and where these rows, `held` among those of all, are among theirs."""
    sizes = [np.size(constraint.value(state)) for constraint in problem.constraints]
    owner = np.repeat(np.arange(len(sizes)), sizes)
    holding = np.unique(owner[held])
    return holding.tolist(), np.searchsorted(np.flatnonzero(np.isin(owner, holding)), held)


def numbers_of(scale: float) -> Array:
    """The numbers of a tracker's programs, (27,), in the order in which `tracking_kernel` reads them."""
    size = StepSize(STEP.radius, PROGRAM.error_clamp * STEP.radius, 0.0, True)
    return np.concatenate([
        size, PROGRAM, CORRECTIONS, WEIGHTS, (scale, STEP.damping, STEP.resting, STEP.curved),
    ])  # fmt: skip


@with_loops("wholebody.methods.qp.tracking_kernel")
def compiled_kernel(tracking_kernel: Any) -> None:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    compiled_turning()
    compiled_sets()
    none, index = np.zeros(0), np.zeros(0, dtype=np.intp)
    tracking_kernel.solve(
        (none, np.zeros((0, 1)), none, index, none, np.zeros((2, 2)), np.zeros((2, 1)), none, index),
        np.zeros((1, 6)), np.zeros((0, 4, 3)), index, np.append(numbers_of(1.0), np.zeros(18 + 4)),
        np.zeros(4, dtype=np.intp), (np.zeros(5 + work_size(1, 0, 0)), index, np.zeros(2, dtype=bool)), False,
    )  # fmt: skip
    tracking_kernel.run_ahead(none, none, 0, none, STEP, np.zeros(2))


class QPStep(NamedTuple):
    """Answer of one step."""

    q: Array  # (nq,) the next posture
    displacement: Array  # (nv,) tangent displacement to it, radians and metres
    velocity: Array  # (nv,) displacement / dt
    contacts: int  # how many pairs had rows
    rows: int  # how many contact rows
    exact: bool  # whether the program was solved to rounding
    iterations: int  # iterations of the QP solver
    by: str  # the solver that closed the last program, see `QPSolution`
    programs: Mapping[str, int]  # programs that each solver closed: one a step, more if it was checked twice
    # how much of the program's displacement was gone: less than 1 where it was longer than what was looked at
    share: float
    # what things that move (`Scene.move` with `over`) passed through, or are inside of; empty if nothing.
    collisions: tuple[Collision, ...] = ()
    # shares of the step, from 0 to 1, and the postures (nq,) there, if things moved; otherwise empty
    path: tuple[tuple[float, Array], ...] = ()
    # which term of one's own is not finite where the step would have ended, so that it was cut; else empty
    note: str = ""

    def __repr__(self) -> str:
        return brief(self)
