"""Surfaces of a scene that stand, which feet stand on."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import TypeAlias

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.motion.solids import Solid
from wholebody.scene.scene import Scene

DEEP = 2.0  # m
Surface: TypeAlias = Callable[[Array, int], float | None]
"""Height of the first surface below a place (3,) in a frame, metres."""


def stands(track: Array, dt: float) -> Mask:
    """(n,) when a thing with a track (n, 7) stands: from 0.1 s before to 0.1 s after it moves by less than 1 mm."""
    frames = max(1, round(0.1 / dt))  # s: longer makes slower things move, and those that come to rest stand later
    padded = np.pad(track, ((frames, frames), (0, 0)), mode="edge")
    after, before = padded[2 * frames :], padded[: -2 * frames]
    return np.asarray(np.maximum(np.abs(after - track), np.abs(track - before)).max(axis=1) < 1e-3)


def surface_of(
    scene: Scene, tracks: Mapping[str, Array] | None = None, dt: float = 1.0, without: Collection[str] = ()
) -> Surface:
    """Height [m] of the first surface up to 2 m below a place (3,) in a frame; None for none, or in a thing.

    Things with `tracks` (n, 7), `dt` seconds a frame, have surfaces while they stand, those `without` none.
    """
    moving = {} if tracks is None else tracks
    pieces, stood = scene.geometry.geometryObjects, {name: stands(track, dt) for name, track in moving.items()}
    still = Solid(
        (piece.geometry, piece.placement)
        for piece, owner in zip(pieces, scene.piece_owner, strict=True)
        if owner in scene.objects and scene.objects[owner].segment is None and owner not in {*without, *moving}
    )
    ball, request = coal.Sphere(1e-6), coal.DistanceRequest()

    def height(place: Array, frame: int) -> float | None:
        found, here = list[float](), still.below(place, DEEP)
        for name, mask in stood.items():
            if mask[frame]:
                at = pin.XYZQUATToSE3(moving[name][frame])
                here += [(pieces[index].geometry, at * local) for index, local in scene.built.pieces_of[name]]
        for shape, there in here:
            at, where = np.array(place), coal.Transform3s(there.rotation, there.translation)
            while at[2] > place[2] - DEEP:
                result = coal.DistanceResult()
                gap = float(coal.distance(ball, coal.Transform3s(np.eye(3), at), shape, where, request, result))
                if gap < 1e-5 and at[2] == place[2]:
                    return None
                if gap < 1e-5:
                    found.append(float(at[2]))
                    break
                down = -float(result.normal[2])  # a convex piece is beyond the plane through its nearest point
                if not down > 1e-6:
                    break
                at[2] -= max(gap / down, 1e-6)
        return max(found, default=None)

    return height
