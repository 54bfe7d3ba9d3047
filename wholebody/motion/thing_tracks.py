"""Tracks of things that move beside the figure of a clip: placements (n, 7), x, y, z and a quaternion x, y, z, w."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.geometry.placement import PlacementLike, placement


def thing_tracks(given: Mapping[str, Iterable[PlacementLike]], frames: int, what: str) -> dict[str, Array]:
    """Placements (n, 7) of things by name, checked; `what` names the input in messages.

    Raises:
        InputError: another number of placements than frames, or one that cannot be read; the frame is named.
    """
    found = {}
    for name, track in given.items():
        checks.text(name, f"{what}: the name of a thing")
        rows = checks.listed(track, f"{what}: things: {name}", "a placement for each frame")
        if len(rows) != frames:
            raise InputError(
                f"{what}: things: {name} has {len(rows)} placements for {frames} frames; give one for each"
            )
        placed = [placement(row, f"{what}: things: {name}: frame {frame}") for frame, row in enumerate(rows)]
        values = np.array([pin.SE3ToXYZQUAT(one) for one in placed]).reshape(-1, 7)
        steady(values[:, 3:])
        values.setflags(write=False)
        found[name] = values
    return found


def steady(turns: Array) -> Array:
    """Quaternions (n, ..., 4), in place, each of the sign with which it is nearest to the one before."""
    flips = np.where((turns[1:] * turns[:-1]).sum(axis=-1) < 0.0, -1.0, 1.0)
    turns[1:] *= np.cumprod(flips, axis=0)[..., None]
    return turns


def between(track: Array, place: float) -> Array:
    """The placement (7,) at a number of frames from the first one, which need not be whole."""
    first = int(np.clip(np.floor(place), 0, max(0, len(track) - 2)))
    last = min(first + 1, len(track) - 1)
    ends = (pin.XYZQUATToSE3(track[frame]) for frame in (first, last))
    start, end = ends
    share = float(np.clip(place - first, 0.0, 1.0))
    turn = start.rotation @ pin.exp3(share * pin.log3(start.rotation.T @ end.rotation))
    way = (1.0 - share) * start.translation + share * end.translation
    return np.asarray(pin.SE3ToXYZQUAT(pin.SE3(turn, way)))
