"""Postures on one side of what the original motion passes through, which no rows of contact bring a limb out of.

From a posture on one side the original motion is followed frame by frame in contact, outwards or until the motion to
the next frame as it is passes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from wholebody.base.arrays import Array
from wholebody.motion.avoider import Run
from wholebody.motion.faults import depth, dip_depth
from wholebody.motion.windows import Window

SHALLOW = 2e-3  # m: a deeper dip passes through something; others are arcs between postures in contact


def keep_back(run: Run, q: Array, gap: int, first: int = 0, *, cancelled: Callable[[], bool] | None = None) -> bool:
    """Keep postures q (n, nq) beside a gap on one side of what its motion passes, in place; whether there was any."""
    if dip_depth(run.workspace, q[gap], q[gap + 1]) <= SHALLOW:
        return False
    sides = {side: (_beside(run, q, gap, side, first), list[Array]()) for side in (1, -1)}
    while sides:
        for side, (postures, found) in list(sides.items()):  # in turn, so that the shorter motion ends both
            if cancelled is not None and cancelled():
                return False
            posture, joined = next(postures, (None, False))
            if posture is None:
                del sides[side]
                continue
            found.append(posture)
            if joined:
                begin = gap + 1 if side > 0 else gap + 1 - len(found)
                q[begin : begin + len(found)] = found[::side]
                return True
    return False


def kept_beside(run: Run, window: Window, q: Array, gaps: Iterable[int]) -> Array:
    """(n, nq) postures q of a window, on one side of what motions after frames `gaps` pass as far as that is found."""
    q = np.array(q)
    for gap in sorted(gaps):
        if 0 <= gap < len(q) - 1:
            keep_back(run, q, gap, window.first)
    return q


def followed(run: Run, window: Window, middle: int, begun: Array | None = None) -> Array:
    """Postures (n, nq) of a window, followed from a frame, at `begun` (nq,) or freed, until calm for 0.25 s."""
    terms = run.terms
    q = np.array(terms.q[window.first : window.end])
    q[middle - window.first] = run.follower.freed(middle, terms.q[middle]) if begun is None else begun
    for side, frames in ((1, range(middle + 1, window.end)), (-1, range(middle - 1, window.first - 1, -1))):
        calm = 0
        for frame in frames:
            here = run.follower.frame(frame, q[frame - side - window.first])
            q[frame - window.first] = here
            calm = calm + 1 if np.abs(here - terms.q[frame]).max() <= 1e-4 else 0
            if calm == run.frames(0.25, 2):
                break
    return q


def _beside(run: Run, q: Array, gap: int, side: int, first: int) -> Iterator[tuple[Array, bool]]:
    """Postures after (side 1) or before (-1) a gap, on the side of its end, and whether the next one joins as it is."""
    # They follow the original until the motion to the next frame passes nothing.
    workspace = run.workspace
    here, frame = (q[gap], gap + 1) if side > 0 else (q[gap + 1], gap)
    while 0 <= frame < len(q):
        there = run.follower.frame(first + frame, here)
        if max(depth(workspace, there), dip_depth(workspace, here, there)) > SHALLOW:
            return
        here, frame = there, frame + side
        yield here, not 0 <= frame < len(q) or dip_depth(workspace, here, q[frame]) <= SHALLOW
