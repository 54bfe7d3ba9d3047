"""The joints of a URDF: read and checked (a tree, limits if needed, valid followers), and written as its elements."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import UNLIMITED, shown, warn_of_degrees
from wholebody.base.errors import FileFormatError
from wholebody.figures.description import Law, follows
from wholebody.figures.urdf.xml_reading import bounded, numbers, placement, unique_names
from wholebody.geometry.pieces import LARGEST

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


class UrdfJoint(NamedTuple):
    """One joint."""

    name: str  # its name
    kind: str  # one of `JOINT_TYPES`
    parent: str  # link
    child: str  # link
    origin: pin.SE3  # placement of the child in the parent at zero
    axis: NDArray[np.float64]  # (3,) unit direction
    lower: float  # radians or metres; -inf without a limit
    upper: float  # inf without a limit
    velocity: float  # largest velocity, 1/s or m/s; inf if the file gives none
    effort: float  # largest torque or force; inf if the file gives none
    mimic: Law | None  # the joint it follows


def read_joints(
    robot: Element, links: tuple[str, ...], path: Path
) -> tuple[tuple[UrdfJoint, ...], str, tuple[str, ...]]:
    """Return the checked joints, the root link, and one sentence for each missing part that was filled in."""
    elements = robot.findall("joint")
    unique_names(elements, "joint", path)
    notes: list[str] = []
    joints = []
    parent_of: dict[str, str] = {}
    known = frozenset(links)
    for element in elements:
        joint = _joint(element, known, f"{path}: joint {shown(element.get('name'))}", notes)
        if joint.child in parent_of:
            raise FileFormatError(
                f"{path}: joint {shown(joint.name)}: link {shown(joint.child)} already hangs on "
                f"{shown(parent_of[joint.child])}; a URDF is a tree"
            )
        parent_of[joint.child] = joint.parent
        joints.append(joint)
    names = {joint.name for joint in joints}
    for k, joint in enumerate(joints):
        if joint.mimic is not None and joint.mimic.leader not in names:
            note = f"it mimics {shown(joint.mimic.leader)}, which is not in the file, so it is on its own"
            notes.append(f"joint {shown(joint.name)}: {note}")
            joints[k] = with_values(joint, mimic=None)
    _check_followers({joint.name: joint for joint in joints}, path)
    return tuple(joints), _root(links, parent_of, path), tuple(notes)


def _joint(element: Element, links: frozenset[str], place: str, notes: list[str]) -> UrdfJoint:
    kind = element.get("type")
    if kind not in JOINT_TYPES:
        raise FileFormatError(f"{place} has the type {shown(kind)}; use one of {', '.join(JOINT_TYPES)}")
    ends = []
    for tag in ("parent", "child"):
        found = element.find(tag)
        end = found.get("link") if found is not None else None
        if end not in links:
            raise FileFormatError(
                f"{place} has the {tag} link {shown(end)}, which is not in the file; add it or correct the name"
            )
        ends.append(str(end))
    axis = np.array([1.0, 0.0, 0.0])
    direction = element.find("axis")
    if kind not in ("fixed", "floating") and direction is not None:
        axis = np.array(bounded(direction, "xyz", place, 3))
        length = float(np.linalg.norm(axis))
        if length < 1e-9:
            raise FileFormatError(f"{place} has a zero axis; give a direction")
        axis = axis / length
    lower, upper, velocity, effort = _limits(element, kind, place, notes)
    origin, name = placement(element, place, LARGEST), str(element.get("name"))
    return UrdfJoint(
        name, kind, ends[0], ends[1], origin, axis, lower, upper, velocity, effort, _mimic(element, kind, place)
    )


def _limits(element: Element, kind: str, place: str, notes: list[str]) -> tuple[float, float, float, float]:
    """Lower and upper limit, velocity and effort; infinite for none."""
    free = (-np.inf, np.inf, np.inf, np.inf)
    if kind in ("fixed", "floating", "planar"):
        return free
    limit = element.find("limit")
    name = element.get("name")
    if limit is None:
        if kind != "continuous":
            notes.append(f"joint {shown(name)}: it has no <limit>, so it moves without limits")
        return free
    lower, upper = (-np.inf, np.inf) if kind == "continuous" else _range(limit, kind, place, shown(name), notes)
    most = {what: _most(limit, what, place) for what in ("velocity", "effort")}
    # exporters write 0 and -1 where no speed was stated, and -1 where no effort was; a passive joint has effort 0
    for what in [what for what, value in most.items() if value == -1.0 or (value == 0.0 and what == "velocity")]:
        notes.append(f"joint {shown(name)}: its {what} limit is {most[what] + 0.0:g}, which is read as none")
        most[what] = np.inf
    return lower, upper, most["velocity"], most["effort"]


def _range(limit: Element, kind: str, place: str, name: str, notes: list[str]) -> tuple[float, float]:
    """Lower and upper limit; infinite for none."""
    lower, upper = (numbers(limit, end, place, 1, "0")[0] for end in ("lower", "upper"))
    if lower > upper:
        raise FileFormatError(f"{place} has the lower limit {lower:g} above the upper {upper:g}; exchange them")
    for end, value in (("lower", lower), ("upper", upper)) if kind == "revolute" else ():
        warn_of_degrees(value, f"{place}: the {end} limit")
    if limit.get("lower") is None and limit.get("upper") is None:
        notes.append(f"joint {name}: its <limit> has neither lower nor upper, so it moves without limits")
        return -np.inf, np.inf
    return lower if lower > -UNLIMITED else -np.inf, upper if upper < UNLIMITED else np.inf


def _most(limit: Element, what: str, place: str) -> float:
    """Largest velocity or effort; infinite for none, -1 where the file has it."""
    text = limit.get(what)
    if text is None or text.strip().lower().lstrip("+") in ("inf", "infinity"):
        return np.inf
    value = bounded(limit, what, place, 1, most=1e20)[0]
    if value < 0.0 and value != -1.0:
        raise FileFormatError(f"{place} has the {what} limit {value:g}; give a number that is not negative")
    return value


def _mimic(element: Element, kind: str, place: str) -> Law | None:
    mimic = element.find("mimic")
    # it has no effect on a fixed joint, which robots with locked hands have
    if mimic is None or kind not in ("revolute", "continuous", "prismatic"):
        return None
    multiplier = bounded(mimic, "multiplier", place, 1, "1")[0]
    return Law(mimic.get("joint", ""), multiplier, bounded(mimic, "offset", place, 1, "0", LARGEST)[0])


def _check_followers(joints: dict[str, UrdfJoint], path: Path) -> None:
    for joint in joints.values():
        seen = [joint.name]
        while (mimic := joints[seen[-1]].mimic) is not None:
            place = f"{path}: joint {shown(seen[-1])}"
            if joints[mimic.leader].kind in ("floating", "planar"):
                raise FileFormatError(
                    f"{place} mimics {shown(mimic.leader)}, which is {joints[mimic.leader].kind}; name another"
                )
            if mimic.leader in seen:
                raise FileFormatError(
                    f"{place} mimics {shown(mimic.leader)}, which mimics it in turn; let one of them be free"
                )
            seen.append(mimic.leader)


def _root(links: tuple[str, ...], parent_of: dict[str, str], path: Path) -> str:
    roots = [link for link in links if link not in parent_of]
    if len(roots) != 1:
        found = (
            "no link without a parent: the joints form a loop"
            if not roots
            else f"{len(roots)} roots: {', '.join(roots[:4])}"
        )
        raise FileFormatError(f"{path}: a URDF is one tree, but there is {found}; connect it")
    under = {roots[0]}
    for link in links:
        way = [link]
        while way[-1] not in under:
            above = parent_of[way[-1]]
            if above in way:
                raise FileFormatError(f"{path}: the joints around link {shown(above)} form a loop; a URDF is a tree")
            way.append(above)
        under.update(way)
    return roots[0]


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
