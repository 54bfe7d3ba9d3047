"""What a method left too rough, made smooth: all frames around it at once, from what the method found.

A method that makes posture after posture leaves kinks where contact begins and where interpolation ends. The program of
the method "trajectory" begins at its postures, so on the sides of things that they are on. It minimises the deviation
from the original and the acceleration of this deviation, with rows of contact in frames and between them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from wholebody.arrays import Array, Mask
from wholebody.motion.avoider import Watch
from wholebody.motion.faults import faults
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.trajectory.banded_qp import banded_solver
from wholebody.motion.trajectory.window_run import ClipRun, WindowSettings
from wholebody.motion.windows import windows
from wholebody.workspace import Workspace

MARGIN = 0.5  # s, before and after changed frames: in which others may change; that of the method "trajectory"
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
    q: Array, beyond: Mask, terms: FrameTerms, clearance: float, workspace: Workspace, watch: Watch
) -> Smoothed:  # fmt: skip
    """Make postures smooth around frames.

    Args:
        q: (n, nq) postures; they stay as they are.
        beyond: (n,) frames that are too rough.
        terms: original postures, and what is held.
        clearance: least distance of every pair, metres.
        workspace: of this run alone.
        watch: is told of every window.
    """
    q = np.array(q)
    depths, _, gaps = faults(workspace, terms, terms.q, clearance)
    run = ClipRun(WindowSettings(clearance, None, ITERATIONS), terms, workspace, banded_solver(None)[1], terms.q)
    changed: Mask = beyond | (q != terms.q).any(axis=1)
    count = 0
    for window in windows(changed, max(3, round(MARGIN / terms.dt))):
        if not beyond[window.first : window.end].any():
            continue
        begun = q[window.first : window.end]
        found = run.window(window, depths, gaps, _teller(watch, f"frames {window.first} to {window.end - 1}"), begun)
        if watch.ended:
            break
        if not found.missed:
            q[window.first : window.end] = found.q
            count += 1
    return Smoothed(q, run.programs, count)


def _teller(watch: Watch, note: str) -> Callable[[float], bool]:
    return lambda share: watch.tell(1.0, f"{note} are made smooth")
