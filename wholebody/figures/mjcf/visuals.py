"""What MuJoCo's viewer draws of a robot in a compiled MJCF file."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.figures.link_visuals import MANY, thinned
from wholebody.figures.mjcf.compiled import Compiled, placement
from wholebody.figures.mjcf.model import RobotModel
from wholebody.figures.mjcf.shapes import geom_shape
from wholebody.figures.robot_figure import COLOR
from wholebody.geometry.large_models import geometry_model
from wholebody.geometry.pieces import SMALLEST

GROUPS = 3  # of geoms that its viewer shows by itself; the others are for contacts


def visual_of(compiled: Compiled, robot: RobotModel) -> pin.GeometryModel | None:
    """The geoms that are drawn, meshes as they are and not their hulls; None where these are the pieces of contacts."""
    model = compiled.model
    shown = [
        geom
        for body in robot.bodies
        for geom in compiled.geoms(body)
        if model.geom_group[geom] < GROUPS and (compiled.color(geom) or COLOR)[3] > 0.0
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
