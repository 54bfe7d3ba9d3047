"""Keyframes of motions whose frames have inner paths: where things moved, a figure does not go straight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.records import with_values


class Timed(NamedTuple):
    """Postures at times.

    Attributes:
        q: (nq,) each.
        times: (n,) seconds, ascending.
        frames: (n,) the frame that each is in.
        shares: (n,) the share of the frame, from 0 to 1.
    """

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
    """The postures of a motion, and those on the ways between them.

    Args:
        postures: (nq,) one a frame.
        paths: of each frame, shares of it and the postures (nq,) there, from the posture before to its own; empty where
            the way is straight. No paths at all are as many empty ones.
        dt: seconds from frame to frame.

    Raises:
        InputError: there are not as many paths as postures.
    """
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
