"""Clips that are freed without a judge: a run, and what a method with the shared repair makes of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

import wholebody as wb
from wholebody.motion.avoidance import freed
from wholebody.motion.avoider import Avoider, Progress, Run, Watch
from wholebody.motion.frame_terms import Given, frame_terms


class Found(NamedTuple):
    """Postures (n, nq), and what they took."""

    q: np.ndarray
    message: str
    posture_solves: int
    programs: int


@contextmanager
def begun(
    clip: wb.Clip, scene: wb.Scene, constraints: Iterable[Given] = (), progress: Progress | None = None
) -> Iterator[Run]:
    """A run of a clip."""
    with scene.borrow() as workspace:
        terms = frame_terms(scene, clip.q, clip.dt, constraints)
        yield Run(clip, terms, workspace, 0.0, Watch(progress))


def freed_by(
    method: Avoider, clip: wb.Clip, scene: wb.Scene, constraints: Iterable[Given] = (), progress: Progress | None = None
) -> Found:
    """What a method makes of a clip."""
    with begun(clip, scene, constraints, progress) as run:
        result = freed(method, run)
        return Found(result.q, result.message, run.work.posture_solves, run.work.programs)
