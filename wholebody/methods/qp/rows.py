"""What the programs of a descent and of a tracker are made of: rows, their weights, and how far a step may go.

These are records, which compiled loops take as they are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram, Room
from wholebody.methods.qp.settings import PROGRAM

NUMBERS = 29  # of `step_program.numbers_of`
SAME = 0.99  # cosine of the angle between two rows from which on they count as one


class StepSize(NamedTuple):
    """What a program says of the step beside its rows.

    Attributes:
        radius: about the largest entry of the step, radians and metres.
        pull: largest error of a goal that is asked for, metres and radians; 0 asks for all of them.
        damping: while a goal is far, times a metre of lever, the share of the largest weighted error that is added to
            the curvature; where all is asked for, of the weighted squared error (Sugihara 2011).
        measures: whether they count; without them the nearest posture to the goals is sought.
        gain: share of its tangential part that the step has.
    """

    radius: float
    pull: float
    damping: float
    measures: bool
    gain: float = 1.0


class Terms(NamedTuple):
    """What a problem says of the rows of its terms.

    Attributes:
        kind: (c,) of each constraint's value: whether it is an equality (0), has a lower bound (1), an upper bound (2),
            both (3) or none (-1).
        bound: (2, c) lower and upper bounds of the values.
        share: (g,) weights of the goals' rows, as shares of the largest.
        weights: (5,) `settings.Weights`.
    """

    kind: Indices
    bound: Array
    share: Array
    weights: Array


class LinearRows(NamedTuple):
    """Rows of the terms and of the contacts at a posture; see `Linearisation`.

    Attributes:
        error, error_jacobian: of the goals.
        value, value_jacobian: of the constraints.
        gap, gap_jacobian, gap_contact, clearance: of the contacts' rows.
        number: (contacts,) of each contact's pair.
    """

    error: Array
    error_jacobian: Array
    value: Array
    value_jacobian: Array
    gap: Array
    gap_jacobian: Array
    gap_contact: Indices
    clearance: Array
    number: Indices


class Violation(NamedTuple):
    """Violation of goals and constraints at a posture: metres and radians.

    Attributes:
        goal: norm of the goal errors, each times the root of its weight's share of the largest.
        hold: norm of the equality constraints' errors.
        elastic: sum of the violations of clearances and inequalities.
        left: norm of the goal errors, without weights.
    """

    goal: float
    hold: float
    elastic: float
    left: float

    @property
    def total(self) -> float:
        """One figure, in which overlap counts most."""
        return self.goal + PROGRAM.hold_share * self.hold + PROGRAM.elastic_share * self.elastic

    @property
    def worst(self) -> float:
        """What is compared with the tolerance."""
        return max(self.left, self.hold, self.elastic)


class Rows(NamedTuple):
    """A linearisation sorted into soft rows (goals, then equalities) and elastic ones (inequalities, then gaps).

    Attributes:
        soft: (m, nv) goals' and equalities' rows.
        soft_error: (m,) their errors.
        soft_weight: (m,) their weights.
        goals: how many of them are goals'.
        elastic: (k, nv) rows of inequalities and gaps.
        elastic_violation: (k,) by how much they are violated; negative where they hold with room to spare.
        contact: (k,) rows of one contact share its number; the worst of them counts.
        contacts: how many numbers there are.
        key: (k,) names a row from one linearisation to the next.
        elastic_weight: (k,) their weights.
    """

    soft: Array
    soft_error: Array
    soft_weight: Array
    goals: int
    elastic: Array
    elastic_violation: Array
    contact: Indices
    contacts: int
    key: Indices
    elastic_weight: Array


class Multipliers(NamedTuple):
    """Multipliers of a program's rows, in units of the measures for each metre or radian; see `multipliers`.

    Attributes:
        soft: (m,) y, of goals and equalities.
        elastic: (k,) z, of inequalities and gaps: positive where they push, else 0.
        key: (k,) names of the elastic rows.
    """

    soft: Array
    elastic: Array
    key: Indices

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
    """The joints of a figure and the pieces that they carry, at a posture.

    Attributes:
        columns: (c, 6) of the joint Jacobian at the world's origin.
        place: (c,) entry of the tangent that each column belongs to.
        column_joint: (c,) its joint.
        parents: (njoints,) of the joints.
        joint: (p,) that carries each piece.
        placement: (p, 4, 3) see `Contacts.placements`.
        reach: (p,) farthest point of each piece from there, metres.
        twists: (3, njoints, 6) room.
    """

    columns: Array
    place: Indices
    column_joint: Indices
    parents: Indices
    joint: Indices
    placement: Array
    reach: Array
    twists: Array


class Seen(NamedTuple):
    """What bounds how much nearer a pair gets by turning.

    Attributes:
        room: times what a pair may be nearer by within which it counts.
        band: how much farther than the witness point the points without rows are, metres.
        lever: how far beyond its clearance a pair is at most for this to hold, metres.
        off: by how many radians its normal may be off.
        least, most: what is unseen, metres.
    """

    room: float
    band: float
    lever: float
    off: float
    least: float
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
    """The program of a step, in room that the next one overwrites.

    Attributes:
        x: (n,) its answer.
        columns: (4, n) diagonal, linear, lower and upper of the program.
        rows: it is made of.
        program: the program.
        active: active set of the answer.
        pushing: (k,) first the keys of the rows that push, in ascending order.
        room: of the active sets.
    """

    x: Array
    columns: Array
    rows: Rows
    program: QuadraticProgram
    active: ActiveSet
    pushing: Indices
    room: Room
