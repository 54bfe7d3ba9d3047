"""Still surfaces of a scene, which feet stand on."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import TypeAlias

import coal
import numpy as np

from wholebody.base.arrays import Array
from wholebody.scene.scene import Scene

Surface: TypeAlias = Callable[[Array], float | None]  # height of the first surface below a place (3,), metres


def surface_of(scene: Scene, moving: Collection[str] = ()) -> Surface:
    """Height [m] of the first still surface up to 2 m below a place (3,); None for none, or in a thing."""
    owners, geometry = scene.piece_owner, scene.geometry
    still = [
        (piece.geometry, coal.Transform3s(piece.placement.rotation, piece.placement.translation))
        for piece, owner in zip(geometry.geometryObjects, owners, strict=True)
        if owner in scene.objects and scene.objects[owner].segment is None and owner not in moving
    ]
    ball, request = coal.Sphere(1e-6), coal.DistanceRequest()

    def height(place: Array) -> float | None:
        found = list[float]()
        for shape, where in still:
            at = np.array(place)
            while at[2] > place[2] - 2.0:
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
