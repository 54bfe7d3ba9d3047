"""A body as files: a URDF that every program reads, and a JSON file with its collision pieces and its coordinates.

The URDF is written from Pinocchio's model, so that a figure of any origin gives one. The order of the numbers of a
posture is the one that Pinocchio gives to the written file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.checks import instance
from wholebody.base.errors import InputError
from wholebody.bench.suite.problem_sets.things import hull_obj, shape_of
from wholebody.bench.suite.published.rebuilt import SHAPES, VERSION, model_of
from wholebody.figures.figure import Figure
from wholebody.figures.urdf.joints import add_joint, add_model_joint, exact, urdf_axis
from wholebody.geometry.flesh import settled

Meshes = dict[str, str]  # text of OBJ files by their path below the folder of an export


def described(geometry: Any, meshes: Meshes, name: str) -> dict[str, Any]:
    """What a shape of coal is called in the files, its corners put among the meshes; InputError for others."""
    if geometry.getSweptSphereRadius() != 0.0:
        raise InputError(f"{name}: it has a rounding of {geometry.getSweptSphereRadius():g} m; publish it without")
    kind, lengths = shape_of(geometry)
    if kind == "hull":
        path = f"meshes/{name.replace(' ', '-').replace(':', '-')}.obj"
        meshes[path] = hull_obj(geometry)
        return {"type": "convex", "mesh": path}
    if kind not in SHAPES:
        raise InputError(f"{name}: it is a {type(geometry).__name__}, which the files have no word for")
    said: dict[str, Any] = {"type": kind}
    for key, count in SHAPES[kind][1].items():
        said[key] = lengths[:count] if count > 1 else lengths[0]
        lengths = lengths[count:]
    return said


def pose_of(place: pin.SE3) -> list[float]:
    """A placement as x, y, z and the quaternion x, y, z, w."""
    return [float(value) + 0.0 for value in pin.SE3ToXYZQUAT(place)]


@dataclass(frozen=True)
class BodyFiles:
    """A body, written: `q[order]` has the order of the files; `links` stand at the joints of the figure."""

    name: str
    urdf: str
    content: Mapping[str, Any]
    order: Indices
    links: tuple[str, ...]

    def posture(self, q: Array) -> list[float]:
        """The numbers of a posture (nq,) in the order of the files."""
        return [float(value) for value in np.asarray(q)[self.order]]


def body_files(figure: Figure, name: str, meshes: Meshes) -> BodyFiles:
    """Write a figure of hinges, slides and free roots, or several as one body; convex pieces go to the meshes."""
    instance(figure, Figure, f"{name}: a published body", "load one with wb.load('human')")
    if figure.followers:
        raise InputError(f"{name}: joints of it follow others, which a published body does not say; leave it out")
    model = figure.model
    links = _links(model)
    geometry = settled(model, figure.geometry, figure.neutral)
    text = _urdf(figure, geometry, name, links, meshes)
    read = model_of(text, figure.root)
    order = _order(figure, read)
    joints = [joint for joint in read.names if joint in figure.joints]
    place = {joint: model.joints[figure.joint_id(joint)] for joint in joints}
    known = figure.limits
    limits = {int(k): (float(a), float(b)) for k, a, b in zip(known.idx_q, known.lower, known.upper, strict=True)}
    bounds = {joint: limits[place[joint].idx_q] for joint in joints if place[joint].idx_q in limits}
    weights = figure.effort_weights
    coordinates, of_roots = list[str](), list[float]()
    for joint, own in _joints(figure, read):
        if own.nq == 7:
            said = "root" if figure.root == "free" else joint
            coordinates += [f"{said} {number}" for number in ("x", "y", "z", "qx", "qy", "qz", "qw")]
            of_roots += [float(weight) for weight in weights[own.idx_v : own.idx_v + 6]]
        else:
            coordinates.append(joint)
    content = {
        "format": "wholebody body",
        "version": VERSION,
        "name": name,
        "urdf": f"bodies/{name}.urdf",
        "root": figure.root,
        "coordinates": coordinates,
        "limits": {joint: list(ends) for joint, ends in bounds.items()},
        "effort_weights": {joint: float(weights[place[joint].idx_v]) for joint in joints},
        "root_effort_weights": of_roots,
        "pieces": [
            {
                "name": piece.name,
                "link": links[piece.parentJoint],
                "pose": pose_of(piece.placement),
                "shape": described(piece.geometry, meshes, f"{name}-{piece.name}"),
            }
            for piece in geometry.geometryObjects
        ],
        "pairs": [
            [geometry.geometryObjects[pair.first].name, geometry.geometryObjects[pair.second].name]
            for pair in geometry.collisionPairs
        ],
    }
    return BodyFiles(name, text, content, order, links)


def _links(model: pin.Model) -> tuple[str, ...]:
    """The link at each joint: the first body frame that coincides with it, else one named after the joint."""
    found = [f"{name}_link" for name in model.names]
    found[0] = "world_link"
    for frame in reversed(list(model.frames)):
        if frame.type == pin.FrameType.BODY and frame.placement.isIdentity(1e-12):
            found[frame.parentJoint] = frame.name
    return tuple(found)


def _urdf(figure: Figure, geometry: pin.GeometryModel, name: str, links: tuple[str, ...], meshes: Meshes) -> str:
    """A link for each joint with its pieces, the joints, and a link without mass for each further frame."""
    model = figure.model
    first = 1 if figure.root == "free" else 0
    top = ElementTree.Element("robot", name=name)
    for joint in range(first, model.njoints):
        link = ElementTree.SubElement(top, "link", name=links[joint])
        if joint and model.inertias[joint].mass >= 1e-6:  # kg: less has a link that is only a place
            _add_inertia(link, model.inertias[joint])
        for piece in geometry.geometryObjects:
            if piece.parentJoint == joint:
                _add_piece(link, piece, meshes, name)
    for joint in range(first + 1, model.njoints):
        _add_joint(top, model, joint, links)
    for frame in model.frames:
        marks = frame.type in (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
        if marks and frame.name not in links and frame.parentJoint >= first and frame.name != "universe":
            ElementTree.SubElement(top, "link", name=frame.name)
            parent = links[frame.parentJoint]
            add_joint(top, f"{frame.name}_mount", "fixed", parent, frame.name, origin=frame.placement)
    ElementTree.indent(top)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ElementTree.tostring(top, encoding="unicode")}\n'


def _add_joint(top: ElementTree.Element, model: pin.Model, joint: int, links: tuple[str, ...]) -> None:
    known, at = urdf_axis(model, joint), model.joints[joint].idx_q
    parent = links[model.parents[joint]]
    if model.joints[joint].nq == 7:  # the free root of one of several figures
        add_joint(top, model.names[joint], "floating", parent, links[joint], origin=model.jointPlacements[joint])
        return
    if known is None or known.kind == "continuous":
        raise InputError(
            f"joint {model.names[joint]!r} is a {model.joints[joint].shortname()}; only hinges and slides with limits "
            "are published"
        )
    low, high = float(model.lowerPositionLimit[at]), float(model.upperPositionLimit[at])
    if not max(abs(low), abs(high)) < 1e6:  # rad, m: beyond which a limit is none
        raise InputError(f"joint {model.names[joint]!r} has no limits; give it limits to publish it")
    add_model_joint(top, model, joint, model.names[joint], parent, links[joint])


def _add_inertia(link: ElementTree.Element, inertia: pin.Inertia) -> None:
    made, spin = ElementTree.SubElement(link, "inertial"), inertia.inertia
    ElementTree.SubElement(made, "origin", xyz=exact(inertia.lever))
    ElementTree.SubElement(made, "mass", value=exact([inertia.mass]))
    names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ElementTree.SubElement(made, "inertia", {name: exact([spin[place]]) for name, place in names.items()})


def _add_piece(link: ElementTree.Element, piece: pin.GeometryObject, meshes: Meshes, body: str) -> None:
    shape = described(piece.geometry, meshes, f"{body}-{piece.name}")
    made = ElementTree.SubElement(link, "collision", name=piece.name)
    turned = exact(pin.rpy.matrixToRpy(piece.placement.rotation))
    ElementTree.SubElement(made, "origin", xyz=exact(piece.placement.translation), rpy=turned)
    inner, kind = ElementTree.SubElement(made, "geometry"), shape["type"]
    if kind == "box":
        ElementTree.SubElement(inner, "box", size=exact(shape["size"]))
    elif kind == "sphere":
        ElementTree.SubElement(inner, "sphere", radius=exact([shape["radius"]]))
    elif kind == "capsule":  # as Pinocchio reads capsules; others see the cylinder within
        ElementTree.SubElement(inner, "cylinder", {key: exact([shape[key]]) for key in ("radius", "length")})
        ElementTree.SubElement(ElementTree.SubElement(link, "collision_checking"), "capsule", name=piece.name)
    elif kind == "convex":
        ElementTree.SubElement(inner, "mesh", filename=f"../{shape['mesh']}")
    else:
        raise InputError(f"piece {piece.name!r} is a {kind}, which no URDF has; give the body other pieces")


def _order(figure: Figure, read: pin.Model) -> Indices:
    """Where the numbers of a posture of the files are in one of the figure."""
    if read.nq != figure.model.nq:
        raise InputError(f"{figure.name}: written as a URDF it has {read.nq} coordinates, not {figure.model.nq}")
    places = [range(own.idx_q, own.idx_q + own.nq) for _, own in _joints(figure, read)]
    return np.array([place for each in places for place in each], dtype=np.intp)


def _joints(figure: Figure, read: pin.Model) -> list[tuple[str, Any]]:
    """The joints of a model of the files, by name, each with that of the figure."""
    names, model = list(read.names)[1:], figure.model
    return [(name, model.joints[1 if name == "root_joint" else model.getJointId(name)]) for name in names]
