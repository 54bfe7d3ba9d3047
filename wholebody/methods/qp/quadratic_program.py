"""The quadratic program of one step, which always has exactly one answer, and the records that it is made of.

    minimise    1/2 x' D x + g' x  +  1/2 sum_i w_i (t_i x - e_i)^2  +  1/2 sum_j v_j max(0, l_j - c_j x)^2
    subject to  lower <= x <= upper

The soft rows t carry goals and equalities, the elastic rows c contacts and inequalities: docs/theory/qp_programs.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask, with_values
from wholebody.methods.qp.settings import PROGRAM

NUMBERS = 27  # of `step_program.numbers_of`
SAME = 0.99  # cosine of the angle between two rows from which on they count as one


class QuadraticProgram(NamedTuple):
    """Data of one program in n variables; compiled loops take it as it is."""

    diagonal: Array  # (n,) D, positive
    linear: Array  # (n,) g
    rows: Array  # (m, n) soft rows t
    target: Array  # (m,) their targets e
    weight: Array  # (m,) their weights w, positive
    elastic: Array  # (k, n) elastic rows c
    least: Array  # (k,) their least values l
    elastic_weight: Array  # (k,) their weights v, positive
    lower: Array  # (n,) the box, finite, lower <= upper
    upper: Array

    def check_shapes(self, active: ActiveSet) -> None:
        """Raise ValueError where sizes do not fit together: compiled loops do not look, and read beyond an end."""
        n, m, k = len(self.diagonal), len(self.target), len(self.least)
        if not (
            len(self.linear) == len(self.lower) == len(self.upper) == len(active.lower) == len(active.upper) == n
            and self.rows.shape == (m, n)
            and len(self.weight) == m
            and self.elastic.shape == (k, n)
            and len(self.elastic_weight) == len(active.elastic) == k
        ):
            raise ValueError(f"a program of {n} variables, {m} soft and {k} elastic rows has parts of other sizes")

    def packed(self) -> QuadraticProgram:
        """The program in arrays without gaps, as compiled loops take it."""
        return self if all(part.flags.c_contiguous for part in self) else type(self)(*map(np.ascontiguousarray, self))

    def with_squares(self, rows: Array, weight: Array) -> QuadraticProgram:
        """The program with squares of more rows (k, n), with weights (k,), in its objective."""
        target = np.concatenate([self.target, np.zeros(len(rows))])
        rows, weight = np.vstack([self.rows, rows]), np.concatenate([self.weight, weight])
        return with_values(self, rows=rows, target=target, weight=weight)

    @property
    def is_computable(self) -> bool:
        """Whether numbers and squares are finite, weights positive and bounds ordered; user terms may give NaN."""
        with np.errstate(all="ignore"):
            curvature = self.diagonal + self.weight @ self.rows**2 + self.elastic_weight @ self.elastic**2
            targets = self.weight @ self.target**2 + self.elastic_weight @ self.least**2
            bounds = np.concatenate([self.lower, self.upper])
            bounds = bounds[~np.isinf(bounds)]  # one of these may be missing
            largest = curvature.sum() + targets + self.linear @ self.linear + bounds @ bounds
            least = min(part.min(initial=np.inf) for part in (self.diagonal, self.weight, self.elastic_weight))
            # sum of the squares in a program from which on it is not solved: solvers take 1e30 for infinite.
            return bool(largest < 1e30 and least > 0.0 and (self.lower <= self.upper).all())

    @property
    def size(self) -> int:
        """Number of variables n."""
        return len(self.diagonal)

    def gradient(self, x: Array) -> Array:
        """Derivative of the objective at x, shape (n,); it is continuous."""
        residual = self.rows @ x - self.target
        violated = np.maximum(self.least - self.elastic @ x, 0.0)
        result: Array = (
            self.diagonal * x
            + self.linear
            + (self.weight * residual) @ self.rows
            - (self.elastic_weight * violated) @ self.elastic
        )
        return result

    def optimality(self, x: Array) -> float:
        """Largest entry of x - clip(x - gradient / scale), in units of x; the scale is the curvature there."""
        violated = self.least - self.elastic @ x > 0.0
        scale = self.diagonal + self.weight @ self.rows**2 + (self.elastic_weight * violated) @ self.elastic**2
        moved = np.clip(x - self.gradient(x) / scale, self.lower, self.upper)
        return float(np.abs(moved - x).max(initial=0.0))


class ActiveSet(NamedTuple):
    """Which bounds hold x and which elastic rows push."""

    lower: Mask
    upper: Mask
    elastic: Mask


class Room(NamedTuple):
    """Room of the compiled loops for a program with k elastic rows."""

    work: Array  # see `work_size`
    places: Indices  # (2 k or more,)
    chosen: Mask  # (k or more,)


def work_size(variables: int, soft: int, elastic: int) -> int:
    """Floats that `face_kernel.face` lays out for a program of so many variables, soft rows and elastic rows."""
    rows = soft + elastic
    return 2 * rows * variables + rows * rows + 3 * rows + elastic + 3 * variables


class QPSolution(NamedTuple):
    """Answer to a program."""

    x: Array  # (n,) the minimiser
    active: ActiveSet  # the active set it was found with
    exact: bool  # whether the optimality conditions hold to rounding; otherwise x is the best found
    iterations: int  # iterations of the solver that was used; 0 where none was
    # what closed the program: "active set" where one that was known led to the answer, the solver's name, "semismooth
    # newton" where the solver's answer did not lead to an exact one, or "not exact"
    by: str = ""


class StepSize(NamedTuple):
    """What a program says of the step beside its rows."""

    radius: float  # about the largest entry of the step, radians and metres
    pull: float  # largest error of a goal that is asked for, metres and radians; 0 asks for all of them
    # while a goal is far, times a metre of lever, the share of the largest weighted error that is added to the
    # curvature; where all is asked for, of the weighted squared error (Sugihara 2011)
    damping: float
    measures: bool  # whether they count; without them the nearest posture to the goals is sought
    gain: float = 1.0  # share of its tangential part that the step has


class Terms(NamedTuple):
    """What a problem says of the rows of its terms."""

    # (c,) of each constraint's value: whether it is an equality (0), has a lower bound (1), an upper bound (2), both
    # (3) or none (-1)
    kind: Indices
    bound: Array  # (2, c) lower and upper bounds of the values
    share: Array  # (g,) weights of the goals' rows, as shares of the largest
    weights: Array  # (5,) `settings.Weights`.


class LinearRows(NamedTuple):
    """Rows of the terms and of the contacts at a posture; see `Linearisation`."""

    error: Array  # of the goals
    error_jacobian: Array
    value: Array  # of the constraints
    value_jacobian: Array
    gap: Array  # of the contacts' rows
    gap_jacobian: Array
    gap_contact: Indices
    clearance: Array
    number: Indices  # (contacts,) of each contact's pair


class Violation(NamedTuple):
    """Violation of goals and constraints at a posture: metres and radians."""

    goal: float  # norm of the goal errors, each times the root of its weight's share of the largest
    hold: float  # norm of the equality constraints' errors
    elastic: float  # sum of the violations of clearances and inequalities
    left: float  # norm of the goal errors, without weights

    @property
    def total(self) -> float:
        """One figure, in which overlap counts most."""
        return self.goal + PROGRAM.hold_share * self.hold + PROGRAM.elastic_share * self.elastic

    @property
    def worst(self) -> float:
        """What is compared with the tolerance."""
        return max(self.left, self.hold, self.elastic)


class Rows(NamedTuple):
    """A linearisation sorted into soft rows (goals, then equalities) and elastic ones (inequalities, then gaps)."""

    soft: Array  # (m, nv) goals' and equalities' rows
    soft_error: Array  # (m,) their errors
    soft_weight: Array  # (m,) their weights
    goals: int  # how many of them are goals'
    elastic: Array  # (k, nv) rows of inequalities and gaps
    elastic_violation: Array  # (k,) by how much they are violated; negative where they hold with room to spare
    contact: Indices  # (k,) rows of one contact share its number; the worst of them counts
    contacts: int  # how many numbers there are
    key: Indices  # (k,) names a row from one linearisation to the next
    elastic_weight: Array  # (k,) their weights


class Multipliers(NamedTuple):
    """Multipliers of a program's rows, in units of the measures for each metre or radian; see `multipliers`."""

    soft: Array  # (m,) y, of goals and equalities
    elastic: Array  # (k,) z, of inequalities and gaps: positive where they push, else 0
    key: Indices  # (k,) names of the elastic rows

    def net(self, rows: Rows) -> Array:
        """(m,) y without what elastic rows of the same direction take back: a gap of zero that must not be negative."""
        pushing = np.flatnonzero(self.elastic > 0.0)
        long = np.linalg.norm(rows.soft, axis=1), np.linalg.norm(rows.elastic[pushing], axis=1)
        along = (rows.soft @ rows.elastic[pushing].T) / np.maximum(np.outer(*long), 1e-12)
        return np.asarray(self.soft - (along > SAME) @ self.elastic[pushing])

    def change(self, program: QuadraticProgram, x: Array) -> float:
        """What errors and violations add to L, to first order, with the displacement x (n,): y' A x - z' C x."""
        soft = program.rows[: len(self.soft)] @ x
        return float(self.soft @ soft - self.elastic @ (program.elastic @ x))


class Bodies(NamedTuple):
    """The joints of a figure and the pieces that they carry, at a posture."""

    columns: Array  # (c, 6) of the joint Jacobian at the world's origin
    place: Indices  # (c,) entry of the tangent that each column belongs to
    column_joint: Indices  # (c,) its joint
    parents: Indices  # (njoints,) of the joints
    joint: Indices  # (p,) that carries each piece
    placement: Array  # (p, 4, 3) see `Contacts.placements`.
    reach: Array  # (p,) farthest point of each piece from there, metres
    twists: Array  # (3, njoints, 6) room


class Seen(NamedTuple):
    """What bounds how much nearer a pair gets by turning."""

    room: float  # times what a pair may be nearer by within which it counts
    band: float  # how much farther than the witness point the points without rows are, metres
    lever: float  # how far beyond its clearance a pair is at most for this to hold, metres
    off: float  # by how many radians its normal may be off
    least: float  # what is unseen, metres
    most: float


class Near(NamedTuple):
    """Contacts of a linearisation: pieces (k, 2), distance (k,), normal (k, 3), and least clearance (k or more,)."""

    pair: Indices
    distance: Array
    normal: Array
    asked: Array


class PackedRows(NamedTuple):
    """The arrays of a `PackedLinearisation`, and the numbers (contacts,) of its pairs."""

    value: Array
    jacobian: Array
    gap: Array
    gap_contact: Indices
    clearance: Array
    measure: Array
    box: Array
    q: Array
    number: Indices


class StepRoom(NamedTuple):
    """Room of a step's program, see `tracking_kernel.parts`: integers (5 k,), masks (2 n + 2 k,)."""

    floats: Array
    integers: Indices
    masks: Mask


class StepParts(NamedTuple):
    """The program of a step, in room that the next one overwrites."""

    x: Array  # (n,) its answer
    columns: Array  # (4, n) diagonal, linear, lower and upper of the program
    rows: Rows  # it is made of
    program: QuadraticProgram  # the program
    active: ActiveSet  # active set of the answer
    pushing: Indices  # (k,) first the keys of the rows that push, in ascending order
    room: Room  # of the active sets
