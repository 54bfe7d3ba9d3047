"""Whether a motion jumped over something: a bound for most pairs, a continuous sweep for the others.

Two convex pieces that are apart before a motion and after it can only have changed sides if they moved against each
other by more than both are wide. Pairs that moved farther are swept.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.geometry.sweep import FirstContact
from wholebody.workspace import Workspace

Array = NDArray[np.float64]

ARC = 1.1  # length of an arc over its chord, at the most, for the turns that one motion makes
OVERLAP = 2e-3  # m: overlap on the way that does not count; what is shown in the end is swept more closely


def jump(workspace: Workspace, before: Array, after: Array, q0: Array, q1: Array, apart: Array) -> FirstContact | None:
    """First contact on the way of a pair that is apart again at its end; None where nothing was jumped over.

    Args:
        workspace: of the run.
        before: (n, 4, 3) placements of the pieces before the motion; see `Contacts.placements`.
        after: those after it.
        q0: (nq,) posture before it.
        q1: (nq,) posture after it.
        apart: (pairs,) bool: which pairs are apart after it.
    """
    table = workspace.table
    shift = after - before
    center = np.sqrt(np.einsum("ij,ij->i", shift[:, 3], shift[:, 3]))
    # |R1 - R0| in the Frobenius norm is 2 sqrt(2) sin(angle / 2): no point moves more than 1/sqrt(2) of it times reach
    turn = np.sqrt(0.5 * np.einsum("ijk,ijk->i", shift[:, :3], shift[:, :3]))
    reach = np.where(np.isfinite(table.reach), table.reach, 0.0)
    way = ARC * (center + turn * reach)
    first, second = table.pairs[:, 0], table.pairs[:, 1]
    doubtful = np.flatnonzero(apart & (way[first] + way[second] > table.widths))
    if len(doubtful):
        between = before[first[doubtful], 3] - before[second[doubtful], 3]
        gap = np.sqrt(np.einsum("ij,ij->i", between, between)) - (table.reach[first] + table.reach[second])[doubtful]
        doubtful = doubtful[
            way[first[doubtful]] + way[second[doubtful]] > table.widths[doubtful] + np.maximum(gap, 0.0)
        ]
    if not len(doubtful):
        return None
    return workspace.sweep.first_contact(q0, q1, table.pairs[doubtful], OVERLAP)
