"""The one thing a method asks of a problem at a posture: everything that counts, to first order.

One pass of Pinocchio, one cull, coal for the pairs that survive, and one compiled pass over all built-in terms and
contacts. Terms of other classes join through their own methods, and cost only themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import copy
from functools import lru_cache
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import InputError, UndefinedTermError
from wholebody.figures.description import Limits
from wholebody.figures.state import State, Wrench
from wholebody.geometry.contact_rows import MOST_ENDS
from wholebody.geometry.proximity import Contacts
from wholebody.scene.workspace import Workspace
from wholebody.tasks.answers import is_own
from wholebody.tasks.base import MOST_PLANES, Bound, Constraint, Goal, Measure, Term
from wholebody.tasks.bounds import StepLimit
from wholebody.tasks.checks import undefined
from wholebody.terms.plan import OtherTerm, TermPlan, Terms, checked_rows, make_plan


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


_NO_CONTACTS = Contacts(
    np.zeros((0, 2), dtype=np.intp), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)),
    np.zeros(0, dtype=np.intp), np.zeros((0, 4, 3)),
)  # fmt: skip


NO_LIMITS = Limits(*np.zeros((2, 0), dtype=np.intp), *np.zeros((2, 0)))
NO_WRENCHES, NO_JOINTS = np.zeros((0, 6)), np.zeros((0, 2), dtype=np.intp)


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
        """Take the resolved terms of a problem, and a workspace of this run alone.

        Clearances (pairs,) are asked of every collision pair, metres; `dt` is the step in seconds for bounds that need
        one. The plan is of the same constraints, bounds, measures and step, and of any goals; None to make it here.
        """
        self.workspace, self.state, self._limits = workspace, workspace.state, limits
        self.goals, self.constraints, self.bounds, self.measures = terms
        self.dt = dt
        self._kernel = compiled_kernel()
        self._no_squares = np.zeros((0, self.state.model.nv))
        self._plan = self._planned(self.goals) if plan is None else self._again(plan, self.goals)
        self._own = self._own_terms()
        self._term_wrench = np.empty((self._plan.goal_rows + self._plan.value_rows, 6))
        self._packed: PackedLinearisation | None = None
        self._grow(64)
        self._approach = self._largest_approach()
        self._most: Array | None = None
        self.take(self.goals, clearances)

    def take(self, goals: Sequence[Goal], clearances: Array, constraints: Sequence[Constraint] | None = None) -> None:
        """Put other goals and clearances in the place of the present ones, and constraints where they are given."""
        if clearances.shape != (len(self.workspace.table.pairs),):
            count = len(self.workspace.table.pairs)
            raise InputError(f"clearances have shape {clearances.shape}; give one for each of the {count} pairs")
        others = None if constraints is self.constraints else constraints
        if goals is not self.goals or others is not None:
            self.constraints = self.constraints if others is None else others
            before, self._plan = self._plan, self._again(self._plan, goals, others)
            self._own = self._own_terms()
            if (before.goal_rows, before.value_rows) != (self._plan.goal_rows, self._plan.value_rows):
                self._term_wrench, self._packed = np.empty((self._plan.goal_rows + self._plan.value_rows, 6)), None
        self.goals, self.clearances = goals, clearances
        self._largest_clearance = float(np.maximum.reduce(clearances)) if len(clearances) else 0.0
        if self._approach is not None:
            self._most = np.add(clearances, self._approach, out=self._most)

    @property
    def plan(self) -> TermPlan:
        """The terms as arrays."""
        return self._plan

    def rows(self) -> list[int]:
        """How many rows each goal, and then each constraint, has."""
        others = iter(self._plan.others)
        return [
            next(others).rows if entries is None else sum(entry.rows for entry in entries)
            for entries in (*self._plan.goals, *self._plan.constraints)
        ]

    def relaxed(self, depth: float) -> Lineariser:
        """The same, with less distance asked of every pair by `depth` metres; both move one workspace."""
        other = copy(self)
        other._most = None  # it needs its own room
        other.take(self.goals, self.clearances - depth)
        return other

    def at(self, q: Array, within: float, planes: bool = False) -> Linearisation:
        """Everything at the posture q, shape (nq,), with the pairs nearer than `within` metres plus their clearance.

        Pairs that cannot come as near as their clearance are left out, where speeds are bounded and `dt` is given.
        Supporting planes of the terms are added if they are asked for.

        Raises:
            InputError: q is no posture, or a term of one's own has another number of rows than at the start.
        """
        contacts, clearance, count = self._contacts(self.workspace.near, q, within)
        nv, rows = self.state.model.nv, self._plan.goal_rows + self._plan.value_rows
        value, jacobian = np.empty(rows), np.empty((rows + count, nv))
        squares = np.empty((self._plan.squares, nv))
        box, measure = np.empty((2, nv)), np.empty((3 if len(squares) else 2, nv + 1))
        self._terms(count, value, jacobian, box, measure, squares)
        squared = measure[2, :nv] if len(squares) else np.zeros(nv)
        for term in self._plan.other_measures:
            part = term.squares(self.state)
            if part is not None:
                squares = np.vstack([squares, sqrt(2.0 * term.weight) * part[1]])
                squared = squared + term.weight * term.curvature(self.state)
        goals, contact = self._plan.goal_rows, self._contact[:count].copy()
        terms: list[Goal | Constraint] = [*self.goals, *self.constraints]
        found = term_planes(terms, self.rows(), self.state) if planes and self._plan.others else None
        return Linearisation(
            self.state.q.copy(), value[:goals], jacobian[:goals], value[goals:], jacobian[goals:rows], contacts,
            self._gap[:count].copy(), jacobian[rows:], contact, clearance[contact], float(measure[0, nv]),
            measure[0, :nv], measure[1, :nv], box[0], box[1], squares, squared, found,
        )  # fmt: skip

    def packed(self, q: Array, within: float) -> PackedLinearisation:
        """What `at` returns, in arrays that the next call of this overwrites."""
        contacts, clearance, count = self._contacts(self.workspace.near_views, q, within)
        if self._packed is None or len(self._packed.jacobian) < len(self._packed.value) + count:
            self._packed = self._buffers()
        room = self._packed
        jacobian = room.jacobian[: len(room.value) + count]
        self._terms(count, room.value, jacobian, room.box, room.measure, self._no_squares)
        contact = self._contact[:count]
        return PackedLinearisation(
            self.state.q, room.goals, room.value, jacobian, contacts, self._gap[:count], contact, clearance[contact],
            room.measure, room.box,
        )  # fmt: skip

    def _buffers(self) -> PackedLinearisation:
        nv, rows = self.state.model.nv, self._plan.goal_rows + self._plan.value_rows
        none = np.zeros(0)
        return PackedLinearisation(
            none, self._plan.goal_rows, np.empty(rows), np.empty((rows + len(self._gap), nv)), _NO_CONTACTS, none,
            none.astype(np.intp), none, np.empty((2, nv + 1)), np.empty((2, nv)),
        )  # fmt: skip

    def _contacts(
        self, near: Callable[[Array, float, Array | None], Contacts], q: Array, within: float
    ) -> tuple[Contacts, Array, int]:
        """Contacts at a posture by a query, the clearance asked of each, and how many rows were written of them."""
        contacts = near(q, within + self._largest_clearance, self._most)
        clearance = self.clearances[contacts.number]
        if len(clearance) * (1 + MOST_ENDS) > len(self._gap):
            self._grow(2 * len(clearance))
        count = self.workspace.rows.write(contacts, clearance, self._room)
        return contacts, clearance, count

    def _terms(self, count: int, value: Array, jacobian: Array, box: Array, measure: Array, squares: Array) -> None:
        """Write all terms where the state is, and the Jacobian of `count` rows of contacts."""
        state, plan = self.state, self._plan
        self._kernel.linearise(
            (state.joints, state.columns, state.q), plan[:4], count, self._contact_rows,
            (self._term_wrench, value, jacobian, box, measure, squares),
        )  # fmt: skip
        if plan.others:
            self._evaluate(plan.others, value, jacobian)
        if plan.other_bounds:
            self._bound(plan.other_bounds, box)
        if plan.other_measures:
            self._measure(plan.other_measures, measure)

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

    def _largest_approach(self) -> Array | None:
        """Most by which every pair (pairs,) can come nearer in a step; None where speeds are not bounded."""
        limits = [bound for bound in self.bounds if type(bound) is StepLimit]
        if self.dt is None or not limits:
            return None
        most = np.min([bound.bounds(self.state, self.dt)[1] for bound in limits], axis=0)
        # m: that pairs may come nearer than their bound; for postures that are put back into their limits first
        return self.workspace.largest_approach(most) + 1e-3

    def _grow(self, contacts: int) -> None:
        """Make room for the rows of so many contacts."""
        rows = contacts * (1 + MOST_ENDS)
        self._wrench, self._gap = np.zeros((rows, 6)), np.zeros(rows)
        self._contact, self._joints = np.zeros(rows, dtype=np.intp), np.zeros((rows, 2), dtype=np.intp)
        self._room, self._contact_rows = (
            (self._wrench, self._gap, self._contact, self._joints),
            (self._wrench, self._joints),
        )
        self._packed = None

    def _evaluate(self, others: Sequence[OtherTerm], value: Array, jacobian: Array) -> None:
        """Write values and rows of terms of other classes."""
        state = self.state
        for term, evaluate, row, rows in others:
            part, derivative = term.value_and_jacobian(state, evaluate)
            if np.ndim(part) != 1:
                part = np.atleast_1d(part)
            checked_rows(term, part, derivative, rows)
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

    def _measure(self, measures: Sequence[Measure], measure: Array) -> None:
        state = self.state
        for term in measures:
            measure[0, -1] += term.weight * term.value(state)
            measure[0, :-1] += term.weight * term.gradient(state)
            measure[1, :-1] += term.weight * term.curvature(state)


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.terms import kernel as term_kernel

    state = State(pin.buildSampleModelManipulator())
    plan = make_plan(NO_LIMITS, Terms(), None, state)
    rows = np.zeros((0, state.model.nv))
    box, measure = np.zeros((2, state.model.nv)), np.zeros((2, state.model.nv + 1))
    term_kernel.linearise(
        (state.joints, state.columns, state.q), plan[:4], 0, (NO_WRENCHES, NO_JOINTS),
        (NO_WRENCHES, np.zeros(0), rows, box, measure, rows),
    )  # fmt: skip
    term_kernel.wrench_rows(NO_WRENCHES, 0, 0, state.columns, plan[:4], rows)
    return term_kernel
