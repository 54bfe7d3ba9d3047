"""Convex pieces (coal) and markers as three.js objects, in the JSON form that the page loads."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.geometry.pieces import hull_triangles
from wholebody.geometry.placement import along_z
from wholebody.view.commands import floats, integers
from wholebody.view.style import LOOK, Color

Three = dict[str, Any]
_AROUND, _ALONG = 32, 8


def piece(geometry: Any, name: str, color: Color) -> Three:
    """A coal geometry in its own coordinates, under a unique name; it casts a shadow unless transparent or endless."""
    shape, scale, center, flat = _shape(geometry, name)
    shadow = color[3] == 1.0 and type(geometry).__name__ != "Halfspace"
    return _mesh(name, shape, _material(color, flat=flat), matrix=_matrix(scale, center), shadow=shadow)


def unit(geometry: Any) -> Any:
    """What pieces of a kind are but for scale: a ball of radius 1, a cube of side 1; otherwise the piece itself."""
    kind = type(geometry).__name__
    if kind in ("Sphere", "Ellipsoid"):
        return coal.Sphere(1.0)
    return coal.Box(1.0, 1.0, 1.0) if kind == "Box" else geometry


def instances(form: Any, name: str, places: Array, colors: Array) -> Three:
    """Opaque pieces of one form as one object, at (k, 4, 4) placements with scales, in (k, 3) colours."""
    shape, _, _, flat = _shape(form, name)
    if shape["type"] == "SphereGeometry":
        triangles = 1_500_000  # of all balls that are drawn together
        around = int(np.clip((triangles / len(places) / 1.5) ** 0.5, 8, _AROUND))
        shape = {**shape, "widthSegments": around, "heightSegments": 3 * around // 4}
    made = _mesh(name, shape, _material((1.0, 1.0, 1.0, 1.0), flat=flat))
    made["object"].update(
        type="InstancedMesh",
        count=len(places),
        instanceMatrix={"array": floats(np.swapaxes(places, 1, 2))},
        instanceColor={"array": floats(colors), "itemSize": 3},
        frustumCulled=False,  # the box of the mesh is that of the form
    )
    return made


def mesh(vertices: Array, faces: NDArray[Any], name: str, color: Color) -> Three:
    """Vertices (n, 3) and faces (m, 3), seen from both sides, as the faces of robots' meshes wind either way."""
    material = {**_material(color, flat=True), "side": 2}  # three.js: both
    return _mesh(name, _triangles(vertices, faces, None), material, shadow=color[3] == 1.0)


def _shape(geometry: Any, name: str) -> tuple[Three, tuple[float, float, float], Array | None, bool]:
    """Three.js geometry, scale, placement (4, 4) or None, and whether its faces are flat."""
    kind = type(geometry).__name__
    one = (1.0, 1.0, 1.0)
    if kind == "Sphere":
        return _ball(float(geometry.radius)), one, None, False
    if kind == "Ellipsoid":
        a, b, c = (float(r) for r in geometry.radii)
        return _ball(1.0), (a, b, c), None, False
    if kind == "Box":
        width, height, depth = (2 * float(side) for side in geometry.halfSide)
        return {"type": "BoxGeometry", "width": width, "height": height, "depth": depth}, one, None, True
    if kind == "Capsule":
        return _triangles(*capsule_surface(float(geometry.radius), float(geometry.halfLength))), one, None, False
    if kind == "Cylinder":
        radius, height = float(geometry.radius), 2.0 * float(geometry.halfLength)
        size = {"radiusTop": radius, "radiusBottom": radius, "height": height}
        return {"type": "CylinderGeometry", **size, "radialSegments": _AROUND}, one, _ALONG_Z, False
    if kind == "Halfspace":
        width, height, depth = LOOK.plate
        plate = {"type": "BoxGeometry", "width": width, "height": height, "depth": depth}
        return plate, one, plate_placement(np.asarray(geometry.n), float(geometry.d)), True
    if kind == "Convex":
        return _triangles(np.asarray(geometry.points()), convex_faces(geometry), None), one, None, True
    raise InputError(f"{name}: coal's {kind} cannot be drawn; turn it into convex pieces")


_ALONG_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
"""Three.js has its cylinders along y; coal along z."""


def plate_placement(normal: Array, offset: float) -> Array:
    """Placement (4, 4) of the plate that represents the half-space n.x <= d: its upper face is in the plane."""
    placement = point_placement(normal * (offset - LOOK.plate[2] / 2))
    placement[:3, :3] = along_z(normal)
    return placement


def arrow_placement(start: Array, direction: Array, length: float) -> Array:
    """Placement (4, 4), with scale, of the unit arrow from `start` along `direction`; long arrows keep their width."""
    width = min(length, LOOK.widest_arrow)
    placement = point_placement(start)
    placement[:3, :3] = along_z(direction) * (width, width, length)
    return placement


def point_placement(point: Array) -> Array:
    """Placement (4, 4) at a point (3,), not turned."""
    placement = np.eye(4)
    placement[:3, 3] = point
    return placement


def rod_placement(start: Array, end: Array, radius: float) -> Array | None:
    """Placement (4, 4) of the rod of radius 1 and length 1 between two points; None if they are the same."""
    span = end - start
    length = float(np.linalg.norm(span))
    if length < 1e-6:
        return None
    placement = point_placement(start)
    placement[:3, :3] = along_z(span) * (radius, radius, length)
    return placement


def capsule_surface(radius: float, half_length: float) -> tuple[Array, NDArray[np.uint32], Array]:
    """Vertices, faces and normals of a capsule along z; rings of half a sphere, drawn apart."""
    polar = np.linspace(0.0, np.pi / 2, _ALONG + 1)
    polar = np.concatenate([polar, np.pi - polar[::-1]])
    lift = np.repeat([half_length, -half_length], _ALONG + 1)
    return revolved(
        np.column_stack([radius * np.sin(polar), lift + radius * np.cos(polar)]),
        np.column_stack([np.sin(polar), np.cos(polar)]),
    )


def revolved(profile: Array, normals: Array, around: int = _AROUND) -> tuple[Array, NDArray[np.uint32], Array]:
    """Surface of revolution of a profile (n, 2), from the top down: vertices, faces (m, 3) outwards, and normals."""
    angle = np.arange(around) * 2 * np.pi / around
    turn = np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.concatenate(
        [profile[:, None, :1] * turn, np.broadcast_to(profile[:, None, 1:], (len(profile), around, 1))], 2
    )
    outward = np.concatenate(
        [normals[:, None, :1] * turn, np.broadcast_to(normals[:, None, 1:], (len(profile), around, 1))], 2
    )
    ring, step = np.meshgrid(np.arange(len(profile) - 1), np.arange(around), indexing="ij")
    here, beside = ring * around + step, ring * around + (step + 1) % around
    below, across = here + around, beside + around
    faces = np.concatenate([np.stack([here, below, across], -1), np.stack([here, across, beside], -1)])
    return vertices.reshape(-1, 3), faces.reshape(-1, 3).astype(np.uint32), outward.reshape(-1, 3)


def convex_faces(convex: Any) -> NDArray[np.uint32]:
    """Triangles (m, 3) of a coal Convex, wound outwards."""
    points = np.asarray(convex.points())
    faces = hull_triangles(convex).astype(np.uint32)
    a, b, c = points[faces[:, 0]], points[faces[:, 1]], points[faces[:, 2]]
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - points.mean(axis=0)) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces


# ---- markers: small things on top of the picture, never lit, never hidden, of one size in near and far pictures

_SIZE, _WIDTH = (True, True, True), (True, True, False)


def arrow(name: str, color: tuple[float, float, float], slender: float = 1.0, *, symbol: bool = False) -> Three:
    """An arrow of length 1 along z from the origin; a `symbol`'s length is not a measure, and adapts to the picture."""
    shaft, head = 0.045 * slender, 0.12 * slender
    outline = np.array([[0.0, 1.0], [head, 0.68], [shaft, 0.68], [shaft, 0.0], [0.0, 0.0]])
    vertices, faces, normals = revolved(
        outline, np.broadcast_to([1.0, 0.0], outline.shape), 16
    )  # unlit: any normal will do
    return _mesh(
        name, _triangles(vertices, faces, normals), _overlay((*color, 1.0)), order=6, scales=_SIZE if symbol else _WIDTH
    )


def rod(name: str, color: tuple[float, float, float], dashes: int = 1) -> Three:
    """A rod of radius 1 and length 1 along z from the origin, whole or in dashes."""
    share = 1.0 if dashes == 1 else 0.56 / dashes  # the length of a dash
    one = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]) * (1.0, share)  # from the top down
    outline = np.concatenate([one + (0.0, start / dashes) for start in reversed(range(dashes))])
    vertices, faces, normals = revolved(outline, np.broadcast_to([1.0, 0.0], outline.shape), 12)
    return _mesh(name, _triangles(vertices, faces, normals), _overlay((*color, 1.0)), order=5, scales=_WIDTH)


def ball(name: str, color: tuple[float, float, float], radius: float) -> Three:
    """A small ball."""
    return _mesh(name, _ball(radius), _overlay((*color, 1.0)), order=7, scales=_SIZE)


# ---- three.js


def _ball(radius: float) -> Three:
    return {"type": "SphereGeometry", "radius": radius, "widthSegments": _AROUND, "heightSegments": 24}


def _triangles(vertices: Array, faces: NDArray[np.uint32], normals: Array | None) -> Three:
    def attribute(values: Any, pack: Any, kind: str, size: int) -> Three:
        return {"itemSize": size, "type": kind, "array": pack(values), "normalized": False}

    attributes = {"position": attribute(vertices, floats, "Float32Array", 3)}
    if normals is not None:
        attributes["normal"] = attribute(normals, floats, "Float32Array", 3)
    index = attribute(faces, integers, "Uint32Array", 1)
    return {"type": "BufferGeometry", "data": {"attributes": attributes, "index": index}}


def _material(color: Color, *, flat: bool) -> Three:
    return {
        "type": "MeshPhongMaterial",
        "color": _number(color),
        "opacity": color[3],
        "transparent": color[3] < 1.0,
        "polygonOffset": color[3] < 1.0,  # where they coincide, the figure's surface is drawn in front of a ghost's
        "polygonOffsetFactor": 2,
        "polygonOffsetUnits": 8,
        "flatShading": flat,
        "shininess": 18,
        "specular": 0x1E1E1E,
        "side": 0,  # three.js: the front
    }


def _overlay(color: Color) -> Three:
    return {
        "type": "MeshBasicMaterial",
        "color": _number(color),
        "depthTest": False,
        "transparent": True,  # three.js draws transparent things last: on top
        "side": 0,  # three.js: the front
    }


def _number(color: Color) -> int:
    red, green, blue = (round(255 * min(max(part, 0.0), 1.0)) for part in color[:3])
    return red << 16 | green << 8 | blue


def _matrix(scale: tuple[float, float, float], placement: Array | None) -> list[float]:
    matrix = np.eye(4) if placement is None else placement
    return [float(value) for value in (matrix @ np.diag([*scale, 1.0])).T.ravel()]


def _mesh(
    name: str,
    shape: Three,
    material: Three,
    *,
    matrix: list[float] | None = None,
    order: int = 0,
    shadow: bool = True,
    scales: tuple[bool, ...] = (),
) -> Three:
    """A three.js mesh, whose name is its uuid; `scales`: axes along which the page makes a marker larger."""
    made: Three = {
        "uuid": name,
        "type": "Mesh",
        "geometry": f"{name}#geometry",
        "material": f"{name}#material",
        "matrix": matrix or _matrix((1.0, 1.0, 1.0), None),
        "renderOrder": order,
        "userData": {"shadow": shadow and order == 0} | ({"scales": list(scales)} if scales else {}),
    }
    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [{"uuid": f"{name}#geometry", **shape}],
        "materials": [{"uuid": f"{name}#material", **material}],
        "object": made,
    }
