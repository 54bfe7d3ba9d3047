"""Records of the programs of a descent and of a tracker: rows, their weights, and how far a step may go."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram, Room
from wholebody.methods.qp.settings import PROGRAM

NUMBERS = 29  # of `step_program.numbers_of`
SAME = 0.99  # cosine of the angle between two rows from which on they count as one


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
