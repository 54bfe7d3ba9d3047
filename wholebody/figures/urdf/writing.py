"""Joints as elements of a URDF, and what URDF calls a joint of Pinocchio's model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.description import follows

ANY_LIMIT = {"lower": -1.0, "upper": 1.0, "effort": 1.0, "velocity": 1.0}
"""A limit where a URDF must have one, for readers that get the real one elsewhere."""

_KINDS = {("R", 1): "revolute", ("R", 2): "continuous", ("P", 1): "prismatic"}


class UrdfAxis(NamedTuple):
    """A joint of one degree of freedom as URDF says it."""

    kind: str  # "revolute", "continuous" or "prismatic"
    axis: Array  # (3,) unit direction in the frame of the joint


def urdf_axis(model: pin.Model, index: int) -> UrdfAxis | None:
    """Kind and axis of a joint of a model, its own where it follows another; None if it has no single axis."""
    joint = model.joints[index]
    name = joint.shortname()
    kind = _KINDS.get((name.removeprefix("JointModel")[0], joint.nq)) if joint.nv == 1 else None
    if kind is None and not follows(joint):
        return None
    data = joint.createData()
    joint.calc(data, np.zeros(joint.idx_q + max(joint.nq, 2)))  # Pinocchio sets some axes only then
    motion = np.array(data.S).ravel()
    if follows(joint):
        motion = motion / joint.extract().scaling
        kind = "prismatic" if motion[:3].any() else "revolute"
    return UrdfAxis(str(kind), motion[:3] if kind == "prismatic" else motion[3:])


def add_joint(
    robot: Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    *,
    origin: pin.SE3 | None = None,
    axis: Iterable[float] | None = None,
    limit: Mapping[str, float] | None = None,
) -> Element:
    """Add a joint to the URDF's root element with exact numbers, its child at `origin` in the parent."""
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    if origin is not None:
        angles = pin.rpy.matrixToRpy(origin.rotation)
        SubElement(joint, "origin", xyz=exact(origin.translation), rpy=exact(angles))
    if axis is not None:
        SubElement(joint, "axis", xyz=exact(axis))
    if limit is not None:
        SubElement(joint, "limit", {attribute: repr(float(value)) for attribute, value in limit.items()})
    return joint


def add_model_joint(robot: Element, model: pin.Model, index: int, name: str, parent: str, child: str) -> None:
    """Add a joint of a model that has a single axis, with its limits, between two links."""
    known, joint = urdf_axis(model, index), model.joints[index]
    assert known is not None
    # rad/s, m/s: in place of a limit that is none
    limit = {"effort": 1000.0, "velocity": min(float(model.velocityLimit[joint.idx_v]), 1e6)}
    if joint.nq == 1:
        limit["lower"], limit["upper"] = (
            float(ends[joint.idx_q]) for ends in (model.lowerPositionLimit, model.upperPositionLimit)
        )
    place = model.jointPlacements[index]
    add_joint(robot, name, known.kind, parent, child, origin=place, axis=known.axis, limit=limit)


def exact(values: Iterable[float]) -> str:
    """Numbers with all their digits, parted by spaces, as URDF writes vectors."""
    return " ".join(repr(float(value)) for value in values)
