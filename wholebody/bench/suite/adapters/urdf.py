"""A scene as an MJCF text: the same joints, limits, pieces, objects and frames."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.bench.suite.problem_sets.things import shape_of
from wholebody.figures.description import follows
from wholebody.figures.figure import Figure
from wholebody.figures.urdf.joints import UrdfAxis, exact, urdf_axis
from wholebody.geometry.flesh import settled
from wholebody.scene.scene import Scene
from wholebody.tasks.inputs import Place


class Frames(dict[str, tuple[int, pin.SE3]]):
    """Frames, and points in them, that a tool is given by name: name -> our joint and the placement in it."""

    def named(self, model: pin.Model, place: Place, offset: Array | None = None) -> str:
        """Note a frame, or a point in its axes (3,), and return its name."""
        frame = model.frames[place.frame]
        there = frame.placement if offset is None else frame.placement * pin.SE3(np.eye(3), offset)
        name = f"frame {place.frame} {there.translation.tolist()}"
        self[name] = (place.joint, there)
        return name


def own_frame(figure: Figure, name: str) -> tuple[int, pin.SE3]:
    """Joint of a frame of a figure, and its placement in it."""
    frame = figure.model.frames[figure.frame_id(name)]
    return int(frame.parentJoint), frame.placement


def axis_of(model: Any, index: int, written_for: str) -> UrdfAxis:
    """Kind and axis of a joint of one axis; InputError for another, whose sentence `written_for` ends."""
    known, kind = urdf_axis(model, index), model.joints[index].shortname()
    if known is None or follows(model.joints[index]):
        raise InputError(f"joint {model.names[index]!r} is a {kind}; {written_for}")
    return known


def mjcf(scene: Scene, frames: Mapping[str, tuple[int, pin.SE3]] = MappingProxyType({})) -> str:
    """Return a scene as MJCF: bodies named after joints, geoms after pieces, sites after `frames`."""
    # Links without mass get a millionth of a kilogram, because MuJoCo refuses moving bodies without mass.
    model, geometry = scene.model, settled(scene.model, scene.geometry, scene.figure.neutral)
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
            body, "inertial", pos=exact(inertia.lever), mass=repr(float(inertia.mass)), fullinertia=exact(moments)
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
    attributes = {"type": "slide" if known.kind == "prismatic" else "hinge", "axis": exact(known.axis)}
    if joint.nq == 1:
        limits = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
        if np.isfinite(limits).all():
            attributes["range"] = exact(limits)
    return attributes


def _geom(piece: Any, body: ElementTree.Element, assets: ElementTree.Element) -> None:
    shape, (kind, lengths) = piece.geometry, shape_of(piece.geometry)
    attributes = {"name": piece.name, "type": kind} | _place(piece.placement)
    if kind == "sphere":
        attributes |= {"size": exact(lengths)}
    elif kind == "capsule":
        attributes |= {"size": exact((lengths[0], 0.5 * lengths[1]))}
    elif kind == "box":
        attributes |= {"size": exact(0.5 * np.array(lengths))}
    elif kind == "hull":
        points = np.array([shape.point(k) for k in range(shape.num_points)])
        ElementTree.SubElement(assets, "mesh", name=piece.name, vertex=exact(points.ravel()))
        attributes |= {"type": "mesh", "mesh": piece.name}
    elif kind == "half-space":
        normal = np.array(shape.n)  # of the surface n . x = d
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
        attributes |= {"type": "plane", "size": "0 0 1"} | _place(piece.placement * pin.SE3(turn, shape.d * normal))
    else:
        raise InputError(
            f"{piece.name!r} is a {type(shape).__name__}; MJCF is written for spheres, capsules, boxes, hulls and "
            "half-spaces"
        )
    ElementTree.SubElement(body, "geom", attributes)


def _place(placement: Any) -> dict[str, str]:
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
    return {"pos": exact(placement.translation), "quat": exact((w, x, y, z))}
