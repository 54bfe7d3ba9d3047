"""Convex shapes in the words of the files: `{"type": "box", "size": [...]}`; corners and faces go to OBJ files."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.errors import InputError

Meshes = dict[str, str]
"""Text of OBJ files by their path below the folder of an export."""


def described(geometry: Any, meshes: Meshes, name: str) -> dict[str, Any]:
    """What a shape of coal is called in the files; one with corners is put among the meshes under a name.

    Raises:
        InputError: a shape that the files have no word for.
    """
    if geometry.getSweptSphereRadius() != 0.0:
        raise InputError(f"{name}: it has a rounding of {geometry.getSweptSphereRadius():g} m; publish it without")
    if isinstance(geometry, coal.Box):
        return {"type": "box", "size": [2.0 * float(half) for half in geometry.halfSide]}
    if isinstance(geometry, coal.Sphere):
        return {"type": "sphere", "radius": float(geometry.radius)}
    if isinstance(geometry, coal.Capsule):
        return {"type": "capsule", "radius": float(geometry.radius), "length": 2.0 * float(geometry.halfLength)}
    if isinstance(geometry, coal.Ellipsoid):
        return {"type": "ellipsoid", "semi_axes": [float(length) for length in geometry.radii]}
    if isinstance(geometry, coal.Halfspace):
        return {"type": "half-space", "normal": [float(x) for x in geometry.n], "offset": float(geometry.d)}
    if isinstance(geometry, coal.ConvexBase):
        path = f"meshes/{name.replace(' ', '-').replace(':', '-')}.obj"
        meshes[path] = _obj(geometry)
        return {"type": "convex", "mesh": path}
    raise InputError(f"{name}: it is a {type(geometry).__name__}, which the files have no word for")


def pose_of(place: pin.SE3) -> list[float]:
    """A placement as x, y, z and the quaternion x, y, z, w."""
    return [float(value) + 0.0 for value in pin.SE3ToXYZQUAT(place)]


def _obj(convex: Any) -> str:
    points = np.array(convex.points())
    faces = [convex.polygons(number) for number in range(convex.num_polygons)]
    lines = [f"v {' '.join(repr(float(value) + 0.0) for value in point)}" for point in points]
    lines += [f"f {' '.join(str(int(face[corner]) + 1) for corner in range(3))}" for face in faces]
    return "\n".join(lines) + "\n"
