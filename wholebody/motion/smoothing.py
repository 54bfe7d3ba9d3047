"""What a method left too rough, made smooth: all frames around it at once, from what the method found.

A method that makes posture after posture leaves kinks where contact begins and where interpolation ends. The program of
the method "trajectory" begins at its postures, so on the sides of things that they are on. It minimises the deviation
from the original and the acceleration of this deviation, with rows of contact in frames and between them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.motion.avoider import Watch
from wholebody.motion.clip import Clip
from wholebody.motion.faults import faults
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.motion_bounds import MotionBounds, excess
from wholebody.motion.trajectory.banded_qp import banded_solver
from wholebody.motion.trajectory.window_run import ClipRun, WindowSettings
from wholebody.motion.windows import windows

MARGIN = 0.5  # s, before and after changed frames: in which others may change; that of the method "trajectory"
TIMES = (
    None,
    0.2,
    0.4,
)  # s: smoothness; that of the method "trajectory", and longer where its jerk is beyond the bound
ITERATIONS = 40  # most steps of one run of a window; that of the method "trajectory"


class Smoothed(NamedTuple):
    """Smoother postures.

    Attributes:
        q: (n, nq) postures; the given ones where none are found that are as free.
        programs: how many quadratic programs were solved.
        windows: how many windows were made smooth.
    """

    q: Array
    programs: int
    windows: int


def smoothed(
    clip: Clip, q: Array, asked: MotionBounds, terms: FrameTerms, clearance: float, watch: Watch
) -> Smoothed:  # fmt: skip
    """Make postures smooth where they are beyond bounds on jerk, speed and deviation.

    Args:
        clip: the original.
        q: (n, nq) postures made of it; they stay as they are.
        asked: bounds, resolved for the clip.
        terms: of the original: what is held.
        clearance: least distance of every pair, metres.
        watch: is told of every window.
    """
    q, programs, count = np.array(q), 0, 0
    beyond = excess(clip, clip.with_q(q), asked).beyond
    if not beyond.any():
        return Smoothed(q, 0, 0)
    margin = max(3, round(MARGIN / terms.dt))
    with terms.scene.borrow() as workspace:
        depths, _, gaps = faults(workspace, terms, terms.q, clearance)
        for time in TIMES:
            settings = WindowSettings(clearance, time, ITERATIONS)
            run = ClipRun(settings, terms, workspace, banded_solver(None)[1], terms.q)
            changed: Mask = beyond | (q != terms.q).any(axis=1)
            for window in windows(changed, margin):
                frames = slice(window.first, window.end)
                if not beyond[frames].any() or watch.ended:
                    continue
                told = _teller(watch, f"frames {window.first} to {window.end - 1}")
                found = run.window(window, depths, gaps, told, q[frames])
                if not found.missed and not watch.ended:
                    q[frames], count = found.q, count + 1
            programs += run.programs
            beyond = excess(clip, clip.with_q(q), asked).beyond
            if not beyond.any() or watch.ended:
                break
    return Smoothed(q, programs, count)


def _teller(watch: Watch, note: str) -> Callable[[float], bool]:
    return lambda share: watch.tell(1.0, f"{note} are made smooth")
