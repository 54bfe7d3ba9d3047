"""Where the time of one of our steps goes: the linearisation replayed by itself at the postures of a run."""

from __future__ import annotations

import time

import numpy as np

from wholebody.bench.adapters.own import WholebodyTool
from wholebody.bench.track import DT, Track

WITHIN_STEP = 0.06  # m beyond the clearance: as far as a step of `QP` looks


def linearise_us(track: Track) -> tuple[float, float]:
    """Median time of a whole step and of its linearisation alone, both of one run [us of the processor]."""
    tool = WholebodyTool(track)
    tool.step(track.targets[0])
    tool.reset(track.start)
    lineariser = tool.problem.lineariser(tool.problem.workspace(), DT)
    lineariser.at(track.start, WITHIN_STEP)
    whole, part = [], []
    for target in track.targets:
        q = tool.posture()
        began = time.thread_time_ns()
        tool.step(target)
        whole.append(time.thread_time_ns() - began)
        began = time.thread_time_ns()
        lineariser.at(q, WITHIN_STEP)
        part.append(time.thread_time_ns() - began)
    return float(np.median(whole)) / 1e3, float(np.median(part)) / 1e3
