"""Postures on one side of what motions between them pass: a limb inside of a ring in one frame and outside in the next.

Postures that were found one by one may be on either side of a thin thing, and no rows of contact free the motion from
one side to the other. From the frame before such a motion the original motion is followed, in contact with what is in
the way, until the motion to the next frame passes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.motion.avoider import Watch
from wholebody.motion.dips import depths_between, dip_depth
from wholebody.motion.faults import depth
from wholebody.motion.following import SHALLOW, Follower
from wholebody.motion.frame_terms import FrameTerms
from wholebody.scene.workspace import Workspace

PASSED = 1e-2
"""Metres: a motion that is deeper passes through something. Others are mostly arcs between two postures in contact,
which rows free; less changes more frames, more leaves more to the rows."""

FEW = 0.25
"""Share of the frames up to which those on one side take the other: more follows more frames, and where the sides are
those of several limbs, in vain."""


def one_sided(
    terms: FrameTerms, follower: Callable[[], Follower], workspace: Workspace, q: Array, watch: Watch
) -> Array:
    """Postures (n, nq) of a clip of which fewer motions pass something; the given ones where that is not found.

    Motions that pass divide the clip into runs of frames, on one side and on the other in turn. A posture is mostly on
    the side from which it deviates less. So where one side has few frames, these take the other. Else, or where
    something is passed still, motions that pass are gone through from the first to the last one, each side being
    that of the frame before, and from the last to the first one where that leaves as many.

    Args:
        terms: original postures, and what is held.
        follower: makes or gives that of the clip; called where something is passed.
        workspace: of this run alone.
        q: (n, nq) postures; they stay as they are.
        watch: is told of every frame.
    """
    depths = depths_between(workspace, q, range(len(q) - 1))
    passing = [gap for gap, deep in depths.items() if deep > PASSED]  # frames that overlap are followed too
    runs = [range(*each) for each in pairwise([0, *(gap + 1 for gap in passing), len(q)])]
    fewer = min((runs[::2], runs[1::2]), key=_frames)
    if passing and _frames(fewer) <= FEW * len(q):
        found = q
        for run in fewer:
            gap, side = (run[0] - 1, 1) if run[0] else (run[-1], -1)
            found = _kept(terms, follower(), workspace, found, [gap], side, watch)
        if watch.ended:
            return q
        if max(depths_between(workspace, found, depths).values()) <= PASSED:
            return found
    for side in (1, -1) if passing else ():
        found = _kept(terms, follower(), workspace, q, passing, side, watch)
        if watch.ended:
            return q
        changed = (found != q).any(axis=1)
        looked = [gap for gap in depths if changed[gap] or changed[gap + 1]]
        now = depths | depths_between(workspace, found, looked)
        if sum(deep > PASSED for deep in now.values()) < len(passing):
            return found
    return q


def _frames(runs: Sequence[range]) -> int:
    """How many frames some runs have."""
    return sum(map(len, runs))


def _kept(
    terms: FrameTerms, follower: Follower, workspace: Workspace, q: Array, passing: Sequence[int], side: int,
    watch: Watch,
) -> Array:  # fmt: skip
    """Postures (n, nq) of which those after motions that pass are kept on the side of the frame before.

    For `side` -1, those before such motions are kept on the side of the frame after.
    """
    model, figure, q = workspace.model, terms.scene.figure, np.array(q)
    waiting = list(passing[::-side])
    while waiting:
        gap = waiting.pop()
        here, frame = (gap, gap + 1) if side > 0 else (gap + 1, gap)
        kept = q.copy()
        while 0 <= frame < len(q):
            if watch.tell(1.0, f"frame {frame} is kept on one side"):
                return q
            away = pin.difference(model, terms.q[here], kept[here])
            start = figure.clamp(np.asarray(pin.integrate(model, terms.q[frame], away)))
            kept[frame] = follower.frame(frame, start)
            if depth(workspace, kept[frame]) > SHALLOW:
                break
            here, frame = frame, frame + side
            if not 0 <= frame < len(q) or dip_depth(workspace, kept[here], q[frame]) <= PASSED:
                q = kept
                break
        waiting = [gap for gap in waiting if (gap - min(here, frame)) * side >= 0]
    return q
