"""Motions whose frames have inner paths, for viewers and files: where things moved, a figure does not go straight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import time_step, warn
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.motion.clip import MOST_FRAMES, Clip, check_figure

NEAR = 1e-3  # m, rad: from the track to a posture of a path at its time
MOST_ROWS = 64  # a frame; fewer of a motion so long that a clip would have more than `MOST_FRAMES`


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


def resampled(figure: Figure, motion: Any, name: str = "clip") -> Clip:
    """A clip at a finer fixed rate, which goes straight from row to row along the inner paths of a motion.

    Files of motion have one time step. The rate is the least power of two times the motion's at which all postures of
    the paths are met; a motion without paths keeps its rate. Where 64 rows a frame, or a million in all, are not
    enough, a warning says how far off the clip is.

    Args:
        figure: the figure of the postures.
        motion: postures `q` (n, nq), `dt`, and maybe `paths`, such as a `Recording` or a `Dragged`.
        name: of the clip.

    Raises:
        InputError: it is no motion of this figure, or has no valid `dt`.

    Examples:
        >>> wholebody.tracking.resampled(human, clip).q.shape
        (6, 56)
    """
    model, dt = check_figure(figure, "resampled").model, time_step(getattr(motion, "dt", None), "resampled: dt")
    plain = Clip(figure, motion.q, dt, name)
    given, rows, finer, left = timed(list(plain.q), getattr(motion, "paths", ()), dt), plain.q, 1, 0.0
    while len(given.q) > len(plain.q):
        left = max(
            float(np.abs(pin.difference(model, _between(model, rows, time * finer / dt), q)).max())
            for time, q in zip(given.times, given.q, strict=True)
        )
        if left <= NEAR or finer == MOST_ROWS or 2 * finer * len(plain.q) > MOST_FRAMES:
            break
        finer *= 2
        at = np.interp(np.arange((len(plain.q) - 1) * finer + 1) * dt / finer, given.times, np.arange(len(given.q)))
        rows = np.array([_between(model, given.q, place) for place in at])
    if left > NEAR:
        warn(
            f"{name}: the inner paths are met to {left:.2g} m or rad; {finer} rows a frame are as many as there can be"
        )
    return Clip(figure, rows, dt / finer, name)


def _between(model: pin.Model, rows: Sequence[Array] | Array, place: float) -> Array:
    """The posture (nq,) at a place among rows, from 0 to their last."""
    first = min(int(place), len(rows) - 2)
    return np.asarray(pin.interpolate(model, rows[first], rows[first + 1], float(place) - first))
