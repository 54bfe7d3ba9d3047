"""Motions whose frames have inner paths, for viewers: where things moved, a figure does not go straight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.base.errors import InputError


class Timed(NamedTuple):
    """Postures (nq,) at ascending times (n,), seconds; of each the frame that it is in, and its share of the frame."""

    q: list[Array]
    times: Array
    frames: list[int]
    shares: list[float]

    def between(self, model: pin.Model, given: Sequence[Array]) -> list[Array]:
        """Postures (nq,) at the same times, straight between given ones, one a frame."""
        return [
            given[frame] if share == 1.0 else np.asarray(pin.interpolate(model, given[frame - 1], given[frame], share))
            for frame, share in zip(self.frames, self.shares, strict=True)
        ]


def timed(postures: Sequence[Array], paths: Sequence[Sequence[tuple[float, Array]]], dt: float) -> Timed:
    """The postures of a motion, and those on the paths between: `paths` has shares and postures a frame, or nothing."""
    if len(paths) not in (0, len(postures)):
        raise InputError(f"the motion has {len(paths)} paths and {len(postures)} postures; give as many")
    found = Timed([], np.zeros(0), [], [])
    for frame, q in enumerate(postures):
        inner = [(share, there) for share, there in paths[frame][1:-1]] if frame and len(paths) else []
        last, shares = 1.0, list[float]()
        for share, _ in reversed(inner):
            # share of a frame: postures that follow each other at once are shown this far apart
            last = min(share, last - 1e-3)
            shares.append(last)
        found.q.extend([*(there for _, there in inner), q])
        found.shares.extend([*reversed(shares), 1.0])
        found.frames.extend([frame] * (len(inner) + 1))
    times = (np.array(found.frames) - 1.0 + np.array(found.shares)) * dt
    return with_values(found, times=times)
