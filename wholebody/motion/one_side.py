"""Postures on one side of what motions between them pass: a limb inside of a ring in one frame and outside in the next.

Postures that were found one by one may be on either side of a thin thing, and no rows of contact free the motion from
one side to the other. From the frame before such a motion the original motion is followed, in contact with what is in
the way, until the motion to the next frame passes nothing.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.motion.dips import dip_depth, dipping
from wholebody.motion.faults import depth
from wholebody.motion.following import SHALLOW, Follower
from wholebody.motion.frame_terms import FrameTerms
from wholebody.workspace import Workspace

PASSED = 1e-2
"""Metres: a motion that is deeper passes through something. Others are mostly arcs between two postures in contact,
which rows free; less changes more frames, more leaves more to the rows."""


def one_sided(terms: FrameTerms, follower: Callable[[], Follower], workspace: Workspace, q: Array) -> Array:
    """Postures (n, nq) of a clip of which fewer motions pass something; the given ones where that is not found.

    Motions that pass are gone through from the first to the last one, each side being that of the frame before, and
    from the last to the first one. The better way is taken.

    Args:
        terms: original postures, and what is held.
        follower: makes or gives that of the clip; called where something is passed.
        workspace: of this run alone.
        q: (n, nq) postures; they stay as they are.
    """
    best, passing = q, _passing(workspace, q, range(len(q) - 1))
    for side in (1, -1):
        if not passing:
            break
        found = _kept(terms, follower(), workspace, q, side)
        left = _passing(workspace, found, range(len(q) - 1))
        if len(left) < len(passing):
            best, passing = found, left
    return best


def _passing(workspace: Workspace, q: Array, gaps: range) -> list[int]:
    """Frames whose motion to the next one passes something."""
    return [gap for gap in dipping(workspace, q, gaps) if dip_depth(workspace, q[gap], q[gap + 1]) > PASSED]


def _kept(terms: FrameTerms, follower: Follower, workspace: Workspace, q: Array, side: int) -> Array:
    """Postures (n, nq) that are kept on the side of the frame before, or after for `side` -1."""
    model, figure, q = workspace.model, terms.scene.figure, np.array(q)
    waiting = _passing(workspace, q, range(len(q) - 1))[::-side]
    while waiting:
        gap = waiting.pop()
        here, frame = (gap, gap + 1) if side > 0 else (gap + 1, gap)
        kept = q.copy()
        while 0 <= frame < len(q):
            away = pin.difference(model, terms.q[here], kept[here])
            start = figure.clamp(np.asarray(pin.integrate(model, terms.q[frame], away)))
            kept[frame] = follower.frame(frame, start)
            if depth(workspace, kept[frame]) > SHALLOW:
                break
            here, frame = frame, frame + side
            if not 0 <= frame < len(q) or dip_depth(workspace, kept[here], q[frame]) <= PASSED:
                q = kept
                break
        waiting = [gap for gap in waiting if (gap - frame) * side >= 0]
    return q
