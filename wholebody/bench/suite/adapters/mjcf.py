"""A scene as an MJCF text, for tools that use MuJoCo: the same joints, limits, pieces, objects and frames."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.errors import InputError
from wholebody.bench.suite.adapters.urdf import axis_of
from wholebody.scene.scene import Scene

ROOT = "root_joint"


def mjcf(scene: Scene, frames: Mapping[str, tuple[int, pin.SE3]] = MappingProxyType({})) -> str:
    """Return a scene as MJCF.

    Bodies are named after the joint that moves them, geoms after their pieces. Links
    without mass get a millionth of a kilogram, because MuJoCo refuses none; kinematics do not see it.

    Args:
        scene: a figure with turning and sliding joints, on a free root or fixed, and things.
        frames: names of sites -> our joint and the placement in it.

    Raises:
        InputError: a joint or a shape that this translation does not know.
    """
    model, geometry = scene.model, scene.geometry
    top = ElementTree.Element("mujoco", model=scene.figure.name)
    settings = {"angle": "radian", "autolimits": "true", "boundmass": "1e-6", "boundinertia": "1e-9"}
    ElementTree.SubElement(top, "compiler", settings | {"balanceinertia": "true"})
    assets = ElementTree.SubElement(top, "asset")
    bodies = [ElementTree.SubElement(top, "worldbody")]
    for index in range(1, model.njoints):
        bodies.append(_body(model, index, bodies[model.parents[index]]))
    for piece in geometry.geometryObjects:
        _geom(piece, bodies[piece.parentJoint], assets)
    for name, (joint, place) in frames.items():
        ElementTree.SubElement(bodies[joint], "site", {"name": name} | _place(place))
    return ElementTree.tostring(top, encoding="unicode")


def _body(model: Any, index: int, parent: ElementTree.Element) -> ElementTree.Element:
    name = model.names[index]
    joint = model.joints[index]
    body = ElementTree.SubElement(parent, "body", {"name": name} | _place(model.jointPlacements[index]))
    inertia = model.inertias[index]
    full = inertia.inertia
    if inertia.mass > 0.0:
        moments = (full[0, 0], full[1, 1], full[2, 2], full[0, 1], full[0, 2], full[1, 2])
        ElementTree.SubElement(
            body, "inertial", pos=_text(inertia.lever), mass=repr(float(inertia.mass)), fullinertia=_text(moments)
        )
    else:
        ElementTree.SubElement(body, "inertial", pos="0 0 0", mass="1e-6", diaginertia="1e-9 1e-9 1e-9")
    if joint.nq == 7:
        ElementTree.SubElement(body, "freejoint", name=name)
    else:
        ElementTree.SubElement(body, "joint", {"name": name} | _motion(model, index))
    return body


def _motion(model: Any, index: int) -> dict[str, str]:
    """Kind, axis and limits of a joint of one degree of freedom."""
    joint = model.joints[index]
    known = axis_of(model, index, "MJCF is written for free roots, turning and sliding joints")
    attributes = {"type": "slide" if known.kind == "prismatic" else "hinge", "axis": _text(known.axis)}
    if joint.nq == 1:
        limits = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
        if np.isfinite(limits).all():
            attributes["range"] = _text(limits)
    return attributes


def _geom(piece: Any, body: ElementTree.Element, assets: ElementTree.Element) -> None:
    shape = piece.geometry
    attributes = {"name": piece.name} | _place(piece.placement)
    if isinstance(shape, coal.Sphere):
        attributes |= {"type": "sphere", "size": _text([shape.radius])}
    elif isinstance(shape, coal.Capsule):
        attributes |= {"type": "capsule", "size": _text([shape.radius, shape.halfLength])}
    elif isinstance(shape, coal.Box):
        attributes |= {"type": "box", "size": _text(shape.halfSide)}
    elif isinstance(shape, coal.ConvexBase):
        points = np.array([shape.point(k) for k in range(shape.num_points)])
        ElementTree.SubElement(assets, "mesh", name=piece.name, vertex=_text(points.ravel()))
        attributes |= {"type": "mesh", "mesh": piece.name}
    elif isinstance(shape, coal.Halfspace):
        attributes |= {"type": "plane", "size": "0 0 1"} | _place(piece.placement * _surface(shape))
    else:
        raise InputError(
            f"{piece.name!r} is a {type(shape).__name__}; MJCF is written for spheres, capsules, boxes, hulls and "
            "half-spaces"
        )
    ElementTree.SubElement(body, "geom", attributes)


def _surface(shape: Any) -> Any:
    """Placement of the surface of a half-space n . x <= d: z along n, the origin at d n."""
    normal = np.array(shape.n)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal)
    return pin.SE3(turn.matrix(), shape.d * normal)


def _place(placement: Any) -> dict[str, str]:
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
    return {"pos": _text(placement.translation), "quat": _text((w, x, y, z))}


def _text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)
