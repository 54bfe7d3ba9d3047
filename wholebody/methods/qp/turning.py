"""Which steps turn some pair nearer than its rows predict: those are looked at where they end, and others are not.

Rows are straight and bodies turn. How much nearer a pair gets by that is bounded for each pair by itself, from what the
joints between the root and its two pieces do; an arm that is far from everything costs nothing, however it turns.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.geometry.contact_rows import BAND, LEVER_DISTANCE
from wholebody.methods.qp.rows import Rows
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
        point = np.array([len(own) == 1 for own in points], dtype=bool)
        self._swept = np.array([reach, point], dtype=float).reshape(2, -1)
        self._lengths = np.array([
            TRACKING.room, BAND, LEVER_DISTANCE, TRACKING.off, TRACKING.inside, TRACKING.unseen,
        ])  # fmt: skip
        place = state.spread(np.arange(state.model.nv, dtype=float)).astype(np.intp)
        self.joints = np.concatenate([place, state.column_joint, state.parents, table.joint])
        self.twists = np.empty((3, workspace.model.njoints, 6))

    def motion(self, at: PackedLinearisation, displacement: Array) -> tuple[float, float]:
        """Longest way of any point of any piece, metres, and largest turn, to first order in the displacement (nv,)."""
        way, turn = self._kernel.motion(
            displacement, self._workspace.state.columns, self.joints, at.contacts.placements,
            self._workspace.table.reach, self.twists,
        )  # fmt: skip
        return way, turn

    def linearisation_error(self, at: PackedLinearisation, rows: Rows, displacement: Array) -> float:
        """Largest share of `unseen_by_rows` by which a pair that may end too near can be nearer than its rows say.

        Args:
            at: where the step begins, and the workspace's state is.
            rows: of its program.
            displacement: (nv,) of the step.

        Returns:
            0 where every pair keeps its distance to that, and more than 1 where one may not.
        """
        contacts = at.contacts
        share: float = self._kernel.linearisation_error(
            displacement, self._workspace.state.columns, self.joints, contacts.placements, self._swept, self._lengths,
            self.twists, contacts.pair, contacts.distance, contacts.normal, at.clearance, rows.elastic,
            rows.elastic_violation, rows.contact, rows.contacts - len(contacts.distance),
        )  # fmt: skip
        return share


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.methods.qp import turning_kernel

    none, index, columns, places = np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros((1, 6)), np.zeros((0, 4, 3))
    joints, twists = np.zeros(3, dtype=np.intp), np.zeros((3, 1, 6))
    turning_kernel.motion(np.zeros(1), columns, joints, places, none, twists)
    turning_kernel.linearisation_error(
        np.zeros(1), columns, joints, places, np.zeros((2, 0)), np.ones(6), twists, index.reshape(0, 2), none,
        np.zeros((0, 3)), none, np.zeros((0, 1)), none, index, 0,
    )  # fmt: skip
    return turning_kernel


def least_unseen(asked: float) -> float:
    """The least of `unseen_by_rows` where at least this distance is asked of all contacts."""
    return min(max(asked, TRACKING.inside), TRACKING.unseen)


def unseen_by_rows(asked: Array) -> Array:
    """By how much each contact (k,) may end nearer than its rows say, where this distance (k,) is asked of it."""
    unseen: Array = np.minimum(np.maximum(asked, TRACKING.inside), TRACKING.unseen)
    return unseen


def predicted_distances(rows: Rows, asked: Array, displacement: Array) -> Array:
    """Distance (k,) of each contact after a displacement (nv,) as its rows have it, at most the required one (k,)."""
    violated = np.zeros(rows.contacts)
    np.maximum.at(violated, rows.contact, rows.elastic_violation - rows.elastic @ displacement)
    return np.asarray(asked - violated[rows.contacts - len(asked) :])
