"""Which steps turn some pair nearer than its rows predict: those are looked at where they end, and others are not."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import with_loops
from wholebody.geometry.contact_rows import BAND, LEVER_DISTANCE
from wholebody.methods.qp.quadratic_program import Bodies, Rows, Seen
from wholebody.methods.qp.settings import TRACKING
from wholebody.scene.workspace import Workspace
from wholebody.terms.linearisation import PackedLinearisation


class Turning:
    """How the pieces of one run move in a step, and a bound on what it turns nearer."""

    def __init__(self, workspace: Workspace) -> None:
        """Take the pieces of a workspace, whose state is where the steps begin."""
        state, self._workspace, table = workspace.state, workspace, workspace.table
        self._kernel = compiled_kernel()
        points = [swept.points for swept in table.swept]
        reach = [np.linalg.norm(own, axis=1).max() if len(own) else reach
                 for own, reach in zip(points, table.reach, strict=True)]  # fmt: skip
        self._reach = np.array(reach, dtype=float)
        self._single = np.array([len(own) == 1 for own in points], dtype=bool)
        seen = Seen(TRACKING.room, BAND, LEVER_DISTANCE, TRACKING.off, TRACKING.inside, TRACKING.unseen)
        self._lengths = np.array(seen)
        place: Indices = state.spread(np.arange(state.model.nv, dtype=float)).astype(np.intp)
        self.joints = place, state.column_joint, state.parents, np.asarray(table.joint)
        self._twists = np.empty((3, workspace.model.njoints, 6))

    def bodies(self, placements: Array) -> Bodies:
        """The joints where the state is, and the pieces at their placements."""
        state, table = self._workspace.state, self._workspace.table
        return Bodies(state.columns, *self.joints, placements, table.reach, self._twists)

    def motion(self, at: PackedLinearisation, displacement: Array) -> tuple[float, float]:
        """Longest way of any point of any piece, metres, and largest turn, to first order in the displacement (nv,)."""
        length, turn = self._kernel.moved(displacement, self.bodies(at.contacts.placements))
        return length, turn

    def linearisation_error(self, at: PackedLinearisation, rows: Rows, displacement: Array) -> float:
        """Largest share of `unseen_by_rows` by which a pair can be nearer after `displacement` than its rows say."""
        contacts = at.contacts
        bodies = self._workspace.state.columns, *self.joints, contacts.placements, self._reach, self._twists
        near = contacts.pair, contacts.distance, contacts.normal, at.clearance
        return float(self._kernel.linearisation_error(displacement, bodies, self._single, self._lengths, near, rows[:]))


@with_loops("wholebody.methods.qp.turning_kernel")
def compiled_kernel(turning_kernel: Any) -> None:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    none, index, three = np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros((0, 3))
    joint, matrix = np.zeros(1, dtype=np.intp), np.zeros((0, 1))
    bodies = Bodies(np.zeros((1, 6)), joint, joint, joint, index, np.zeros((0, 4, 3)), none, np.zeros((3, 1, 6)))
    rows = Rows(matrix, none, none, 0, matrix, none, index, 0, index, none)
    turning_kernel.moved(np.zeros(1), bodies)
    turning_kernel.linearisation_error(
        np.zeros(1), bodies[:], np.zeros(0, dtype=bool), np.ones(6), (index.reshape(0, 2), none, three, none), rows[:],
    )  # fmt: skip


def unseen_by_rows(asked: Array) -> Array:
    """By how much each contact (k,) may end nearer than its rows say, where this distance (k,) is asked of it."""
    unseen: Array = np.minimum(np.maximum(asked, TRACKING.inside), TRACKING.unseen)
    return unseen


def predicted_distances(rows: Rows, asked: Array, displacement: Array) -> Array:
    """Distance (k,) of each contact after a displacement (nv,) as its rows have it, at most the required one (k,)."""
    violated = np.zeros(rows.contacts)
    np.maximum.at(violated, rows.contact, rows.elastic_violation - rows.elastic @ displacement)
    return np.asarray(asked - violated[rows.contacts - len(asked) :])
