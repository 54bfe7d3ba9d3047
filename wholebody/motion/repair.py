"""Corrects what a method left: frames and motions between frames, and what is too rough, in windows of all frames.

Both are done by the program of the method "trajectory", begun at the method's postures, so on their sides of things:

- `repaired` finds the least smooth change of a few tenths of a second around each fault. What passes right through
  something is kept on one side before.
- `smoothed` minimises the deviation from the original and its acceleration around what is beyond `MotionBounds`.
"""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.motion.avoider import Run, keep_back
from wholebody.motion.faults import Faults, depths_between
from wholebody.motion.measures import MotionBounds, excess
from wholebody.motion.trajectory.window_run import ClipRun
from wholebody.motion.windows import Window


def repaired(run: Run, q: Array) -> Array:
    """Postures (n, nq) with less that is wrong than in q, which stay but near faults and beside what is passed."""
    q = np.array(q)
    for gap, deep in depths_between(run.workspace, q, range(len(q) - 1)).items():
        if deep > 0.01:  # m: it passes through something, from which no rows bring it back; less changes more frames
            _kept_back(run, q, gap)
    for number in range(4):
        found = run.faults(q)
        changed = [_kept_back(run, q, gap) for gap in found.gaps if number]  # what rows did not free
        if run.ended:
            return q
        found = run.faults(q) if any(changed) else found
        for window in run.windows(found.frames, 0.1 * 2**number, 2):  # s beside a fault in which postures may change
            if run.watch.tell(1.0, f"frames {window.first} to {window.end - 1} are repaired"):
                return q
            changed.append(_repair(run, window, found, q))
        if not any(changed) and number:
            break
    return q


def _kept_back(run: Run, q: Array, gap: int) -> bool:
    """Keep frames beside a gap on one side of what it passes, in place; whether there was any, and that succeeded."""
    note = f"what passes after frame {gap} is kept on one side"
    return not run.ended and keep_back(run, q, gap, cancelled=lambda: run.watch.tell(1.0, note))


def _repair(run: Run, window: Window, found: Faults, q: Array) -> bool:
    """Repair one window of q (n, nq) in place; whether it is better than before."""
    frames = slice(window.first, window.end)
    # s that a push at one frame spreads over; rad and m of the trust region, in which postures are nearly free
    windows = ClipRun(run, q, 0.06, None, near=0.05)
    freed = windows.window(window, found, lambda _: run.ended, q).q
    before = int(found.wrong[frames].sum()) + sum(window.first <= gap < window.end - 1 for gap in found.gaps)
    better = run.faults(freed, window.first).number < before
    if better:
        q[frames] = freed
    return better


def smoothed(run: Run, q: Array, asked: MotionBounds) -> tuple[Array, int]:
    """Postures q (n, nq), smooth where they are beyond resolved bounds and others are as free; how many windows are."""
    q, count, clip, terms = np.array(q), 0, run.clip, run.terms
    beyond = excess(clip, clip.with_q(q), asked).beyond
    if not beyond.any():
        return q, 0
    found = run.faults(terms.q)
    for time in (None, 0.2, 0.4):  # s: the smoothness of the method "trajectory", and more where its jerk is beyond
        windows = ClipRun(run, terms.q, time)
        for window in run.windows(beyond, 0.5):
            frames = slice(window.first, window.end)
            if not run.ended:
                report = run.watch.teller(1.0, 0.0, f"frames {window.first} to {window.end - 1} are made smooth")
                smooth = windows.window(window, found, report, q)
                if not smooth.missed and not run.ended:
                    q[frames], count = smooth.q, count + 1
        beyond = excess(clip, clip.with_q(q), asked).beyond
        if not beyond.any() or run.ended:
            break
    return q, count
