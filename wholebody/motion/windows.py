"""Windows of a clip: the frames around what is wrong, in which a method may change postures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask


class Window(NamedTuple):
    """Frames from `first` up to but without `end`."""

    first: int
    end: int

    def __len__(self) -> int:
        return self.end - self.first


def runs(wrong: Mask) -> list[Window]:
    """The longest windows in which all frames are marked."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wrong, [False]]).astype(np.int8)))
    return [Window(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


def long_runs(marked: Mask, least: int) -> Mask:
    """(n,) the marks of runs of `least` frames or more."""
    kept = np.zeros(len(marked), dtype=bool)
    for run in runs(marked):
        if len(run) >= least:
            kept[run.first : run.end] = True
    return kept


def windows(wrong: Mask, margin: int) -> list[Window]:
    """Windows around marked frames, with a margin of frames before and after; those that meet are one."""
    count = len(wrong)
    near = np.zeros(count, dtype=bool)
    for run in runs(wrong):
        near[max(0, run.first - margin) : min(count, run.end + margin)] = True
    return runs(near)


def normal(time: float, dt: float) -> Array:
    """Weights of a normal distribution over frames, its standard deviation `time` [s]; their sum is 1."""
    half = max(1, int(np.ceil(3.0 * time / dt)))
    weights = np.exp(-0.5 * (np.arange(-half, half + 1) * dt / time) ** 2)
    return np.asarray(weights / weights.sum())


def leaning(near: Array, away: Indices) -> Array:
    """Weights (k,) by which values `away` from a place give that of the line nearest to them there; a mean inside."""
    sums = near.sum(), near @ away, near @ away**2  # beside an end the line leans
    size = sums[0] * sums[2] - sums[1] ** 2
    return np.asarray(near * (sums[2] - sums[1] * away) / size if size > 0.0 else near / sums[0])
