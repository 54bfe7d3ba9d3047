"""Everything that counts at a posture, to first order: the one thing a method asks of a problem."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, with_values
from wholebody.base.compiled import with_loops
from wholebody.base.errors import InputError, UndefinedTermError
from wholebody.figures.description import Limits
from wholebody.figures.state import State, Wrench
from wholebody.geometry.contact_rows import LENGTHS, MOST_ENDS
from wholebody.geometry.memory_views import RESULT_DOUBLES
from wholebody.geometry.proximity import ContactBuffer, Contacts
from wholebody.scene.workspace import Workspace
from wholebody.tasks.answers import is_own
from wholebody.tasks.base import MOST_PLANES, Bound, Constraint, Expansion, Goal, Term
from wholebody.tasks.bounds import StepLimit
from wholebody.tasks.checks import check_row_count, undefined
from wholebody.terms.plan import OtherTerm, TermPlan, Terms, checked_count, make_plan


class TermPlanes(NamedTuple):
    """Supporting planes of all terms; see `Goal.supporting_planes`."""

    value: Array  # (p,) not positive where the terms are met
    jacobian: Array  # (p, nv)
    row: Indices  # (p,) the first row of the term that a plane is of, goals' before constraints'
    key: Indices  # (p,) names a plane from one posture to the next
    bend: Array  # (b, nv) rows b with the second derivatives of the terms' rows as sums of b' b
    bend_row: Indices  # (b,) the row that a bend is of, goals' before constraints'


def term_planes(terms: Sequence[Goal | Constraint], counts: Sequence[int], state: State) -> TermPlanes | None:
    """Supporting planes of resolved terms, of so many rows each, where a state is; None where none has any."""
    found: list[TermPlanes] = []
    row = 0
    for term, count in zip(terms, counts, strict=True):
        planes = term.supporting_planes(state)
        if planes is not None:
            rows, key = np.full(len(planes.value), row, dtype=np.intp), planes.key + row * MOST_PLANES
            found.append(TermPlanes(planes.value, planes.jacobian, rows, key, planes.bend, planes.bend_row + row))
        row += count
    return TermPlanes(*(np.concatenate(part) for part in zip(*found, strict=True))) if found else None


class Linearisation(NamedTuple):
    """A problem at one posture, to first order in the tangent displacement dq of shape (nv,)."""

    q: Array  # (nq,) the posture
    goal_error: Array  # (g,) errors of the goals, metres and radians; ``goal_error + goal_jacobian @ dq`` should vanish
    goal_jacobian: Array  # (g, nv)
    value: Array  # (c,) values of the constraints, to stay between the problem's lower and upper
    value_jacobian: Array  # (c, nv)
    contacts: Contacts  # the pairs near enough to count
    gap: Array  # (r,) gaps of the contact rows, metres; the first k are the distances of the k contacts
    gap_jacobian: Array  # (r, nv); ``gap + gap_jacobian @ dq`` is to be at least `clearance`
    gap_contact: Indices  # (r,) the contact a row belongs to
    clearance: Array  # (r,) least gap asked of each row
    measure: float  # weighted sum of the measures
    gradient: Array  # (nv,) its derivative
    curvature: Array  # (nv,) its positive diagonal
    # lower and upper: (nv,) bounds on dq
    lower: Array
    upper: Array
    # (s, nv) rows S of measures that are sums of squares (`Measure.squares`), with the second derivative S' S
    squares: Array = np.zeros((0, 0))
    # (nv,) their part of the curvature, which stands for S' S where rows are not taken; zero without rows
    squared: Array = np.zeros(0)
    planes: TermPlanes | None = None  # supporting planes of the terms; None where no term has any


NO_LIMITS = Limits(*np.zeros((2, 0), dtype=np.intp), *np.zeros((2, 0)))
_NONE, _POINTS, _INDEX, _PAIR = (
    np.zeros(0),
    np.zeros((0, 3)),
    np.zeros(0, dtype=np.intp),
    np.zeros((0, 2), dtype=np.intp),
)
NO_PIECES = np.zeros((0, 4, 3))
NO_CONTACTS = (
    (np.zeros((0, RESULT_DOUBLES)), _INDEX, _PAIR, _NONE, np.zeros((2, 0)), 0.0), np.zeros((2, 0)),
    (np.zeros(0, dtype=bool), _INDEX, LENGTHS, _POINTS, _INDEX, np.zeros((0, 4)), _INDEX, _NONE, _POINTS),
    (_NONE, np.zeros((3, 0, 3)), _INDEX, _PAIR, _NONE, np.zeros((0, 6)), _NONE, _INDEX, _PAIR, _NONE), 0,
)  # fmt: skip
"""What `kernel.linearise` takes where no pair counts: `asked` to `known`."""


class PackedLinearisation(NamedTuple):
    """A linearisation in as few arrays as can be, which the next one overwrites; `Linearisation` says what they mean.

    `value` (g + c,) has errors of the goals, of `goals` rows, then values of the constraints; `jacobian` their rows,
    then those of the gaps. `measure` (2, nv + 1) is derivative and curvature of the measures, with their sum in the
    last column; `box` (2, nv) has lower and upper bounds on dq.
    """

    q: Array
    goals: int
    value: Array
    jacobian: Array
    contacts: Contacts
    gap: Array
    gap_contact: Indices
    clearance: Array
    measure: Array
    box: Array


class Lineariser:
    """Linearises one problem at many postures, in the room of one run.

    Attributes:
        workspace: moves from posture to posture, and sees things where they were when the run began.
        goals: what is linearised; see `take`.
    """

    def __init__(
        self,
        workspace: Workspace,
        limits: Limits,
        terms: Terms,
        clearances: Array,
        dt: float | None = None,
        plan: TermPlan | None = None,
    ) -> None:
        """Take resolved terms, clearances (pairs,) [m], a workspace, a step `dt` [s], and a plan or None to make it."""
        self.workspace, self.state, self._limits = workspace, workspace.state, limits
        self.goals, self.constraints, self.bounds, self.measures = terms
        self.dt = dt
        self._kernel = compiled_kernel()
        self._no_squares = np.zeros((0, self.state.model.nv))
        self._plan = self._planned(self.goals) if plan is None else self._again(plan, self.goals)
        if self._plan.seldom:
            seldom_kernel()  # not in the middle of a solve
        self._own = self._own_terms()
        self._box, self._measure = np.empty((2, self.state.model.nv)), np.empty((2, self.state.model.nv + 1))
        self._grow(64)
        self._approach = self._largest_approach()
        self._clearances, self._given = np.empty((2, len(workspace.table.pairs))), b"none"
        self.take(self.goals, clearances)

    def take(self, goals: Sequence[Goal], clearances: Array, constraints: Sequence[Constraint] | None = None) -> bool:
        """Take other goals and clearances, and constraints where given; whether clearances are others than before."""
        if clearances.shape != (len(self.workspace.table.pairs),):
            count = len(self.workspace.table.pairs)
            raise InputError(f"clearances have shape {clearances.shape}; give one for each of the {count} pairs")
        others = None if constraints is self.constraints else constraints
        if others is not None or (goals is not self.goals and not self._plan.put(goals, self.goals, self.state.model)):
            self.constraints = self.constraints if others is None else others
            before, self._plan = self._plan, self._again(self._plan, goals, others)
            if before.others or self._plan.others:
                self._own = self._own_terms()
            if (before.goal_rows, before.value_rows) != (self._plan.goal_rows, self._plan.value_rows):
                self._grow(self._near.size)
        self.goals, self.clearances = goals, clearances
        given = clearances.tobytes()  # entries may have been set
        if given == self._given:
            return False
        self._given, self._clearances[0] = given, clearances
        np.add(clearances, self._approach, out=self._clearances[1])
        self._largest = float(np.maximum.reduce(clearances)) if len(clearances) else 0.0
        return True

    @property
    def plan(self) -> TermPlan:
        """The terms as arrays."""
        return self._plan

    def relaxed(self, depth: float) -> Lineariser:
        """The same, with less distance asked of every pair by `depth` metres; both move one workspace."""
        other = copy(self)
        other._plan = self._plan.copied()  # `take` writes into it
        other._clearances, other._given = np.empty_like(self._clearances), b"none"
        other.take(self.goals, self.clearances - depth)
        return other

    def at(self, q: Array, within: float, planes: bool = False) -> Linearisation:
        """Everything at q (nq,), with the pairs nearer than `within` plus their clearance, and planes if asked for."""
        # With bounded speeds and `dt`, pairs that cannot come as near as their clearance are omitted.
        nv, rows = self.state.model.nv, len(self._value)
        squares = np.empty((self._plan.squares, nv))
        value, box, measure = np.empty(rows), np.empty((2, nv)), np.empty((3 if len(squares) else 2, nv + 1))
        contacts, count, expansions = self._pass(q, within, (value, box, measure, squares))
        jacobian = self._jacobian[: rows + count].copy()
        squared = measure[2, :nv] if len(squares) else np.zeros(nv)
        for weight, (_, _, curvature, slopes) in expansions:
            if slopes is not None:
                squares = np.vstack([squares, sqrt(2.0 * weight) * slopes])
                squared = squared + weight * curvature
        goals = self._plan.goal_rows
        gap, contact, clearance = (part[:count].copy() for part in self._gaps)
        contacts = Contacts(*[part.copy() for part in contacts])
        return Linearisation(
            self.state.q.copy(), value[:goals], jacobian[:goals], value[goals:], jacobian[goals:rows], contacts, gap,
            jacobian[rows:], contact, clearance, float(measure[0, nv]), measure[0, :nv], measure[1, :nv], box[0],
            box[1], squares, squared, self._planes() if planes else None,
        )  # fmt: skip

    def with_planes(self, at: Linearisation) -> Linearisation:
        """A linearisation that was made without planes, with them."""
        if self._plan.others and not np.array_equal(self.state.q, at.q):
            self.state.update(at.q)
        return with_values(at, planes=self._planes())

    def _planes(self) -> TermPlanes | None:
        terms: list[Goal | Constraint] = [*self.goals, *self.constraints]
        return term_planes(terms, self._plan.rows, self.state) if self._plan.others else None

    def packed(self, q: Array, within: float) -> PackedLinearisation:
        """What `at` returns, in arrays that the next question to the workspace overwrites."""
        value, box, measure = self._value, self._box, self._measure
        contacts, count, _ = self._pass(q, within, (value, box, measure, self._no_squares))
        front = self._front.get(count)
        if front is None:
            gap, contact, clearance = self._gaps
            front = self._jacobian[: len(value) + count], gap[:count], contact[:count], clearance[:count]
            self._front[count] = front
        jacobian, gap, contact, clearance = front
        return PackedLinearisation(
            self.state.q, self._plan.goal_rows, value, jacobian, contacts, gap, contact, clearance, measure, box
        )

    def _pass(
        self, q: Array, within: float, room: tuple[Array, Array, Array, Array]
    ) -> tuple[Contacts, int, list[tuple[float, Expansion]]]:
        """Contacts and rows at a posture, until the next call, and other measures with weights; `room` takes values."""
        state, plan, near, within = self.state.update(q), self._plan, self.workspace.proximity, within + self._largest
        index, placed = near.ask(state.data, within, self._clearances[1])
        if len(index) > self._near.size:
            self._grow(2 * len(index))
        value, box, measure, squares = room
        there = state.joints, state.columns, state.q, placed
        asked = near.results_of(index), index, *near.known, within
        written = self._term_wrench, value, self._jacobian, box, measure, squares
        given = self._clearances, self.workspace.rows.arrays, self._rows
        count, gaps, broken = self._kernel.linearise(there, plan[:4], asked, *given, -1, written)
        contacts = self._near.contacts(count, placed)
        if broken:
            near.repair_normals(contacts)
            _, gaps, _ = self._kernel.linearise(there, plan[:4], asked, *given, count, written)
        if plan.seldom:
            more = self._term_wrench, value, self._jacobian, measure, squares
            seldom_kernel().add_seldom(state.joints, state.columns, state.q, plan[:4], more)
        if plan.others:
            self._evaluate(plan.others, value, self._jacobian)
        if plan.other_bounds:
            self._bound(plan.other_bounds, box)
        expansions = [(term.weight, term.expansion(state)) for term in plan.other_measures]
        for weight, found in expansions:
            measure[0, -1] += weight * found.value
            measure[0, :-1] += weight * found.gradient
            measure[1, :-1] += weight * found.curvature
        return contacts, gaps, expansions

    def undefined(self, q: Array) -> UndefinedTermError | None:
        """Why a term of one's own is not finite at a posture (nq,); None where all are, or where there are none."""
        return undefined(self._own, self.state.update(q), self.dt) if self._own else None

    def _own_terms(self) -> list[Term]:
        """Terms of one's own: built-in ones are finite everywhere."""
        plan = self._plan
        asked = [*(other.term for other in plan.others), *plan.other_bounds, *plan.other_measures]
        return [term for term in asked if is_own(term)]

    def defined(self, postures: Iterable[Array]) -> Iterator[Array]:
        """Those of some postures (nq,) where all terms of one's own are finite."""
        return (q for q in postures if self.undefined(q) is None)

    def _planned(self, goals: Sequence[Goal]) -> TermPlan:
        return make_plan(self._limits, Terms(goals, self.constraints, self.bounds, self.measures), self.dt, self.state)

    def _again(
        self, plan: TermPlan, goals: Sequence[Goal], constraints: Sequence[Constraint] | None = None
    ) -> TermPlan:
        """The plan with other terms; made anew where they, or terms of one's own, have other rows than before."""
        again = plan.with_terms(goals, self.state.model, constraints)
        if again is None or any(np.size(term.value(self.state)) != term.rows for term in again.others):
            return self._planned(goals)
        return again

    def _largest_approach(self) -> Array:
        """Most by which every pair (pairs,) can come nearer in a step; infinite where speeds are not bounded."""
        limits = [bound for bound in self.bounds if type(bound) is StepLimit]
        if self.dt is None or not limits:
            return np.full(len(self.workspace.table.pairs), np.inf)
        most = np.min([bound.bounds(self.state, self.dt)[1] for bound in limits], axis=0)
        # m: that pairs may come nearer than their bound; for postures that are put back into their limits first
        return self.workspace.largest_approach(most) + 1e-3

    def _grow(self, contacts: int) -> None:
        """Make room for the rows of so many contacts, and for those of the terms."""
        rows, terms = contacts * (1 + MOST_ENDS), self._plan.goal_rows + self._plan.value_rows
        self._near = ContactBuffer(contacts)
        self._gaps = np.zeros(rows), np.zeros(rows, dtype=np.intp), np.zeros(rows)
        gap, contact, clearance = self._gaps
        joints = np.zeros((rows, 2), dtype=np.intp)
        self._rows = *self._near.arrays, np.zeros(contacts), np.zeros((rows, 6)), gap, contact, joints, clearance
        self._jacobian, self._value = np.empty((terms + rows, self.state.model.nv)), np.empty(terms)
        self._term_wrench = np.empty((terms, 6))
        self._front: dict[int, tuple[Array, Array, Indices, Array]] = {}  # views of the first so many gaps

    def _evaluate(self, others: Sequence[OtherTerm], value: Array, jacobian: Array) -> None:
        """Write values and rows of terms of other classes."""
        state = self.state
        for term, evaluate, row, rows in others:
            part, derivative = term.value_and_jacobian(state, evaluate)
            part = part if type(part) is np.ndarray and part.ndim == 1 else np.atleast_1d(part)
            checked_count(term, len(part), rows)
            check_row_count(term, part, derivative, state.model.nv)
            value[row : row + rows] = part
            if isinstance(derivative, Wrench):
                wrenches = np.ascontiguousarray(derivative.rows, dtype=float)
                joint, against, mine = derivative.joint, derivative.against, jacobian[row : row + rows]
                self._kernel.wrench_rows(wrenches, joint, against, state.columns, self._plan[:4], mine)
            else:
                jacobian[row : row + rows] = derivative

    def _bound(self, bounds: Sequence[Bound], box: Array) -> None:
        for bound in bounds:
            # a joint out of its limits comes back no faster than the bound lets it
            low, high = bound.bounds(self.state, self.dt)
            np.clip(box, low, high, out=box)


@with_loops("wholebody.terms.kernel")
def compiled_kernel(term_kernel: Any) -> None:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    state = State(pin.buildSampleModelManipulator())
    plan = make_plan(NO_LIMITS, Terms(), None, state)
    nv = state.model.nv
    wrenches, rows, box, measure = np.zeros((0, 6)), np.zeros((0, nv)), np.zeros((2, nv)), np.zeros((2, nv + 1))
    term_kernel.linearise(
        (state.joints, state.columns, state.q, NO_PIECES), plan[:4], *NO_CONTACTS,
        (wrenches, _NONE, rows, box, measure, rows),
    )  # fmt: skip
    term_kernel.wrench_rows(wrenches, 0, 0, state.columns, plan[:4], rows)


@with_loops("wholebody.terms.seldom_kernel")
def seldom_kernel(kernel: Any) -> None:
    """The module of those loops that few problems need, compiled or read back with the first that does."""
    kernel.compiled_kernel()


class ConstraintValues:
    """Values of some constraints, and of nothing else, at any state of one model."""

    def __init__(self, constraints: Sequence[Constraint], state: State) -> None:
        """Take resolved constraints; `state` tells how many rows terms of one's own have, and stays where it is."""
        self._kernel = compiled_kernel()
        self._plan = plan = make_plan(NO_LIMITS, Terms(constraints=constraints), None, state)
        self._model, rows, nv = state.model, plan.value_rows, state.model.nv
        self._wrench, self._jacobian = np.empty((rows, 6)), np.empty((rows, nv))
        self._value, self._box, self._measure = np.empty(rows), np.empty((2, nv)), np.empty((2, nv + 1))
        self._no_squares = np.zeros((0, nv))

    def take(self, constraints: Sequence[Constraint]) -> bool:
        """Put others in their place; False, and nothing is done, where these are not of the same classes and frames."""
        plan = self._plan.with_terms((), self._model, constraints)
        self._plan = self._plan if plan is None else plan
        return plan is not None

    def at(self, state: State) -> Array:
        """The values (c,) at a state; the next call overwrites them."""
        plan, value = self._plan, self._value
        self._kernel.linearise(
            (state.joints, state.columns, state.q, NO_PIECES), plan[:4], *NO_CONTACTS,
            (self._wrench, value, self._jacobian, self._box, self._measure, self._no_squares),
        )  # fmt: skip
        if plan.seldom:
            more = self._wrench, value, self._jacobian, self._measure, self._no_squares
            seldom_kernel().add_seldom(state.joints, state.columns, state.q, plan[:4], more)
        for term, evaluate, row, rows in plan.others:
            part = np.atleast_1d(evaluate(state))
            checked_count(term, len(part), rows)
            value[row : row + rows] = part
        return value
