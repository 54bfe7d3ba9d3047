"""Postures on one side of what the original motion passes through, which no rows of contact bring a limb out of.

From a posture on one side the original motion is followed frame by frame in contact, outwards or until the motion to
the next frame as it is passes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from wholebody.base.arrays import Array
from wholebody.motion.avoider import Run
from wholebody.motion.faults import depth, depths_between, dip_depth
from wholebody.motion.windows import Window

SHALLOW = 2e-3  # m: a deeper dip passes through something; others are arcs between postures in contact
PASSED = 1e-2  # m: a deeper motion between two postures passes through something; less changes more frames


def one_sided(run: Run, q: Array) -> Array:
    """Postures (n, nq) of a clip of which fewer motions pass something; the given q where that is not found."""
    # Motions that pass divide the frames into two sides: the smaller, up to a quarter, changes, else each follows on.
    depths = depths_between(run.workspace, q, range(len(q) - 1))
    passing = [gap for gap, deep in depths.items() if deep > PASSED]  # frames that overlap are followed too
    parts = [range(*each) for each in pairwise([0, *(gap + 1 for gap in passing), len(q)])]
    fewer = min((parts[::2], parts[1::2]), key=lambda side: sum(map(len, side)))
    if passing and sum(map(len, fewer)) <= 0.25 * len(q):
        found = q
        for part in fewer:
            gap, side = (part[0] - 1, 1) if part[0] else (part[-1], -1)
            found = _kept(run, found, [gap], side)
        if run.ended:
            return q
        if max(depths_between(run.workspace, found, depths).values()) <= PASSED:
            return found
    for side in (1, -1) if passing else ():
        found = _kept(run, q, passing, side)
        if run.ended:
            return q
        changed = (found != q).any(axis=1)
        looked = [gap for gap in depths if changed[gap] or changed[gap + 1]]
        now = depths | depths_between(run.workspace, found, looked)
        if sum(deep > PASSED for deep in now.values()) < len(passing):
            return found
    return q


def keep_back(
    run: Run, q: Array, gap: int, most: int, first: int = 0, *, cancelled: Callable[[], bool] | None = None
) -> bool:
    """Keep frames beside a gap on one side of what its motion passes, in place, `most` at most; whether done."""
    sides = {side: _beside(run, q, gap, side, SHALLOW, first) for side in (1, -1)}
    found = dict[int, list[Array]]((side, []) for side in sides)
    for _ in range(most):
        for side, postures in list(sides.items()):  # in turn, so that the shorter motion ends both
            if cancelled is not None and cancelled():
                return False
            posture, joined = next(postures, (None, False))
            if posture is None:
                del sides[side]
                continue
            found[side].append(posture)
            if joined:
                _put(q, gap, side, found[side])
                return True
    return False


def kept_beside(run: Run, window: Window, q: Array, gaps: Iterable[int]) -> Array:
    """(n, nq) postures q of a window, on one side of what motions after frames `gaps` pass as far as that is found."""
    q = np.array(q)
    for gap in sorted(gaps):
        if 0 <= gap < len(q) - 1 and dip_depth(run.workspace, q[gap], q[gap + 1]) > SHALLOW:
            keep_back(run, q, gap, len(q) - 1, window.first)
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


def _put(q: Array, gap: int, side: int, found: Sequence[Array]) -> None:
    """Put postures that were found after (side 1) or before (-1) a gap into q (n, nq)."""
    begin = gap + 1 if side > 0 else gap + 1 - len(found)
    q[begin : begin + len(found)] = found[::side]


def _kept(run: Run, q: Array, passing: Sequence[int], side: int) -> Array:
    """Postures (n, nq) of which those after motions that pass are kept on the side before; for -1, those before."""
    q, waiting = np.array(q), list(passing[::-side])
    while waiting:
        gap, found = waiting.pop(), list[Array]()
        for posture, joined in _beside(run, q, gap, side, PASSED):
            found.append(posture)
            if joined:
                _put(q, gap, side, found)
                break
            if run.watch.tell(1.0, f"frame {gap + side * len(found)} is kept on one side"):
                return q
        waiting = [other for other in waiting if (other - gap) * side >= len(found)]
    return q


def _beside(run: Run, q: Array, gap: int, side: int, passed: float, first: int = 0) -> Iterator[tuple[Array, bool]]:
    """Postures after (side 1) or before (-1) a gap, on the side of its end, and whether the next one joins as it is."""
    # They follow the original until the motion to the next frame is no deeper than `passed` [m].
    workspace = run.workspace
    here, frame = (q[gap], gap + 1) if side > 0 else (q[gap + 1], gap)
    while 0 <= frame < len(q):
        there = run.follower.frame(first + frame, here)
        if max(depth(workspace, there), dip_depth(workspace, here, there)) > SHALLOW:
            return
        here, frame = there, frame + side
        yield here, not 0 <= frame < len(q) or dip_depth(workspace, here, q[frame]) <= passed
