"""What is wrong with the frames of a clip, as the methods see it: with culled distances, which are fast."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.motion.dips import dipping
from wholebody.motion.frame_terms import FrameTerms
from wholebody.scene.workspace import Workspace

DEPTH = 5e-5  # m: of an overlap that is to go; half of what counts as a collision
MISSED = 1e-4  # m, rad: by which a held constraint is missed
BEYOND = 1e-6  # rad, m: by which a joint is beyond its limit


def depth(workspace: Workspace, q: Array, clearance: float = 0.0) -> float:
    """By how much the nearest pair at a posture (nq,) is nearer than the clearance, metres; at least 0."""
    return clearance - float(workspace.near(q, clearance).distance.min(initial=clearance))


def faults(
    workspace: Workspace, terms: FrameTerms, q: Array, clearance: float = 0.0, first: int = 0
) -> tuple[Array, Mask, list[int]]:
    """What is wrong with postures (n, nq) of a clip.

    Args:
        workspace: of this run alone.
        terms: what is held.
        q: (n, nq) postures.
        clearance: least distance asked of every pair, metres.
        first: frame of the clip that the first posture belongs to.

    Returns:
        (n,) depths in metres; (n,) frames that overlap, miss a limit or miss what is held; gaps between other frames
        that dip.
    """
    limits = terms.scene.figure.limits
    depths = np.array([depth(workspace, posture, clearance) for posture in q])
    values = q[:, limits.idx_q]
    beyond = np.maximum(limits.lower - values, values - limits.upper).max(axis=1, initial=0.0)
    wrong = (depths > DEPTH) | (beyond > BEYOND)
    if terms.holds:
        state = workspace.state
        wrong |= np.array(
            [terms.missed(frame, state.update(posture)) > MISSED for frame, posture in enumerate(q, first)]
        )
    quiet = [frame for frame in range(len(q) - 1) if not (wrong[frame] or wrong[frame + 1])]
    return depths, wrong, list(dipping(workspace, q, quiet))
