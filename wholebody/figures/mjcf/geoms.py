"""Geoms of a compiled MJCF file: their shapes, height fields as convex prisms, and what MuJoCo's viewer draws."""

from __future__ import annotations

from itertools import groupby
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import FileFormatError
from wholebody.figures.link_pieces import MANY, LinkShape, thinned
from wholebody.figures.mjcf.compiled import Compiled, placement
from wholebody.figures.mjcf.model import RobotModel
from wholebody.figures.robot_figure import COLOR
from wholebody.geometry.large_models import geometry_model
from wholebody.geometry.pieces import SMALLEST

SHAPES = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
"""Kinds of geoms, as MuJoCo numbers them."""


def geom_shape(compiled: Compiled, geom: int) -> LinkShape | None:
    """The shape of a geom on its body; None for planes and height fields, which only the world has."""
    model = compiled.model
    link = compiled.names["body"][int(model.geom_bodyid[geom])]
    at = placement(model.geom_pos[geom], model.geom_quat[geom])
    size = [float(value) for value in model.geom_size[geom]]
    kind = SHAPES[int(model.geom_type[geom])]
    if kind in ("mesh", "sdf"):
        return LinkShape(link, at, "triangles", (), triangles=compiled.mesh(geom))
    sizes: dict[str, tuple[float, ...]] = {
        "sphere": (size[0],), "capsule": (size[0], 2.0 * size[1]), "cylinder": (size[0], 2.0 * size[1]),
        "ellipsoid": tuple(size), "box": tuple(2.0 * value for value in size),
    }  # fmt: skip
    return LinkShape(link, at, kind, sizes[kind]) if kind in sizes else None


def height_field(compiled: Compiled, geom: int) -> list[Array]:
    """Corners (n, 3) of the convex prisms of a geom's height field, in its frame, below the triangles MuJoCo tests."""
    model, field = compiled.model, int(compiled.model.geom_dataid[geom])
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    half_x, half_y, top, below = (float(value) for value in model.hfield_size[field])
    first = int(model.hfield_adr[field])
    heights = top * np.array(model.hfield_data[first : first + rows * columns], dtype=float).reshape(rows, columns)
    if not np.isfinite(heights).all():
        row, column = np.argwhere(~np.isfinite(heights))[0]
        raise FileFormatError(
            f"{compiled.path}: a height field has {heights[row, column]} in row {row}, column {column}; give finite "
            "heights"
        )
    x, y = np.linspace(-half_x, half_x, columns), np.linspace(-half_y, half_y, rows)
    grid = np.stack([*np.meshgrid(x, y), heights], axis=2)
    bend = heights[:-1, :-1] - heights[:-1, 1:] - heights[1:, :-1] + heights[1:, 1:]
    found, flat = [], 1e-9  # m: a cell whose four corners are nearer than this to one plane is one prism
    for row in range(rows - 1):
        slopes = np.stack([np.diff(heights[row]), heights[row + 1, :-1] - heights[row, :-1]], axis=1)
        planes = [tuple(np.round(slope, 12)) for slope in slopes]
        for column in np.flatnonzero(np.abs(bend[row]) >= flat):
            planes[column] = ("bent", int(column))
        for plane, cells in groupby(range(columns - 1), planes.__getitem__):
            run = list(cells)
            (a, b), (c, d) = grid[row : row + 2, [run[0], run[-1] + 1]]
            tops = [(a, d, c), (a, b, d)] if plane[0] == "bent" else [(a, b, c, d)]
            found += [np.concatenate([top, [(x, y, -below) for x, y, _ in top]]) for top in tops]
    return found


def visual_of(compiled: Compiled, robot: RobotModel) -> pin.GeometryModel | None:
    """The geoms that are drawn, meshes as they are and not their hulls; None where these are the pieces of contacts."""
    model, groups = compiled.model, 3  # of geoms that its viewer shows by itself; the others are for contacts
    shown = [
        geom
        for body in robot.bodies
        for geom in compiled.geoms(body)
        if model.geom_group[geom] < groups and (compiled.color(geom) or COLOR)[3] > 0.0
    ]
    shapes = [(geom, shape) for geom in shown if (shape := geom_shape(compiled, geom)) is not None]
    if not any(shape.kind == "triangles" or not compiled.collides(geom) for geom, shape in shapes):
        return None
    made = []
    for geom, shape in shapes:
        number = robot.model.getFrameId(shape.link, pin.FrameType.BODY)
        frame, color = robot.model.frames[number], compiled.color(geom)
        at = frame.placement * placement(model.geom_pos[geom], model.geom_quat[geom])
        made.append(
            pin.GeometryObject(
                f"{shape.link}:visual {geom}", frame.parentJoint, number, at, _solid(shape), "", np.ones(3),
                color is not None, np.array(COLOR if color is None else color),
            )
        )  # fmt: skip
    return geometry_model(made)


def _solid(shape: Any) -> Any:
    if shape.triangles is None:
        return getattr(coal, shape.kind.capitalize())(*(max(size, SMALLEST) for size in shape.size))
    vertices, faces = shape.triangles if len(shape.triangles[1]) <= MANY else thinned(*shape.triangles)
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(faces), len(vertices))
    mesh.addVertices(np.asarray(vertices, dtype=float))
    mesh.addTriangles(np.asarray(faces, dtype=np.uint32))
    mesh.endModel()
    return mesh
