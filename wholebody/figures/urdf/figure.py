"""A figure from any URDF: Pinocchio's model, its collision geometry as convex pieces, and the pairs that can touch.

Pinocchio requires that a joint that follows another (mimic) comes after the followed joint in its own order. So the
first of several joints that move together, in that order, carries the coordinate, and the others follow it, whichever
of them the file calls the leader.
"""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import with_values
from wholebody.base.checks import shown
from wholebody.base.errors import FileFormatError, InputError
from wholebody.figures.description import Law, led
from wholebody.figures.figure import Figure
from wholebody.figures.link_pieces import Concavity, check_concavity
from wholebody.figures.robot_figure import Robot, check_size, geometry_of_links, robot_figure, visual_of_links
from wholebody.figures.urdf.extension import extended_figure
from wholebody.figures.urdf.file import UrdfFile, read_urdf
from wholebody.figures.urdf.joints import ANY_LIMIT, UrdfJoint, add_joint
from wholebody.figures.urdf.srdf import read_srdf
from wholebody.geometry.placement import along_z


def urdf_model(urdf: UrdfFile, root: str) -> tuple[pin.Model, tuple[str, ...]]:
    """Return Pinocchio's model, its root "fixed" or "free", and one sentence for each joint that was changed."""
    joints, notes = _with_constant_followers(urdf.joints)
    model = _build(urdf, joints, root, mimic=False)
    if any(joint.mimic for joint in joints):
        joints, remarks = _within_followers(joints)
        notes += remarks
        joints = _led_by_the_first(joints, {name: place for place, name in enumerate(model.names)})
        model = _build(urdf, joints, root, mimic=True)
    for joint in joints:
        if joint.kind == "planar":
            _lay_in_plane(model, joint)
    _set_limits(model, joints)
    return model, notes


def _lay_in_plane(model: pin.Model, joint: UrdfJoint) -> None:
    """Let a planar joint move in the plane normal to its axis: Pinocchio's moves in x and y of its frame."""
    if joint.axis[2] == 1.0:
        return
    turned = pin.SE3(along_z(joint.axis), np.zeros(3))
    back, index = turned.inverse(), model.getJointId(joint.name)
    model.jointPlacements[index] = model.jointPlacements[index] * turned
    model.inertias[index] = back.act(model.inertias[index])
    for child in range(index + 1, model.njoints):
        if model.parents[child] == index:
            model.jointPlacements[child] = back * model.jointPlacements[child]
    for frame in model.frames:
        if frame.parentJoint == index:
            frame.placement = back * frame.placement


def _within_followers(joints: tuple[UrdfJoint, ...]) -> tuple[tuple[UrdfJoint, ...], tuple[str, ...]]:
    """Cut the limits of leaders so that every follower stays within its own."""
    laws, by_name = _laws(joints), {joint.name: joint for joint in joints}
    ends = {name: (joint.lower, joint.upper) for name, joint in by_name.items()}
    notes = []
    for name, law in laws.items():
        own = by_name[name]
        low, high = sorted((end - law.offset) / law.slope for end in (own.lower, own.upper))
        kept = max(low, ends[law.leader][0]), min(high, ends[law.leader][1])
        if kept[0] > kept[1] or (kept[0] == kept[1] and ends[law.leader][0] < ends[law.leader][1]):
            # PR2's gripper: a multiplier of -1, and limits of one sign, as if it were 1
            note = f"its limits leave {shown(law.leader)} no room, so they are left out"
            notes.append(f"joint {shown(name)}: {note}")
            continue
        ends[law.leader] = kept
    made = [with_values(joint, lower=ends[joint.name][0], upper=ends[joint.name][1]) for joint in joints]
    return tuple(made), tuple(notes)


def _laws(joints: tuple[UrdfJoint, ...]) -> dict[str, Law]:
    """The law of every joint that follows another, directly or through others."""
    stated = {joint.name: joint.mimic for joint in joints if joint.mimic is not None}
    return {name: led(stated, name) for name in stated}


def _with_constant_followers(joints: tuple[UrdfJoint, ...]) -> tuple[tuple[UrdfJoint, ...], tuple[str, ...]]:
    """Fix the joints that follow a fixed joint, or another one by a multiplier of zero."""
    laws = _laws(joints)
    fixed = {joint.name for joint in joints if joint.kind == "fixed"}
    made, notes = [], []
    for joint in joints:
        law = laws.get(joint.name)
        if law is None or (law.leader not in fixed and law.slope != 0.0):
            made.append(joint)
            continue
        remark = f"it mimics {shown(law.leader)}, which does not move it, so it is fixed"
        notes.append(f"joint {shown(joint.name)}: {remark}")
        if joint.kind == "prismatic":
            moved = pin.SE3(np.eye(3), law.offset * joint.axis)
        else:
            moved = pin.SE3(pin.exp3(law.offset * joint.axis), np.zeros(3))
        made.append(with_values(joint, kind="fixed", origin=joint.origin * moved, mimic=None))
    return tuple(made), tuple(notes)


def _led_by_the_first(joints: tuple[UrdfJoint, ...], order: dict[str, int]) -> tuple[UrdfJoint, ...]:
    """Make the first of joints that move together the leader; its limits are those of the file's leader."""
    laws, by_name = _laws(joints), {joint.name: joint for joint in joints}
    first: dict[str, str] = {}
    for name in sorted({*laws, *(law.leader for law in laws.values())}, key=order.__getitem__):
        first.setdefault(led(laws, name).leader, name)
    made = []
    for joint in joints:
        law = led(laws, joint.name)
        if law.leader not in first:
            made.append(joint)
            continue
        # a revolute joint without limits would be a point on a circle, which no joint can follow
        kind = "prismatic" if joint.kind == "prismatic" else "revolute"
        head = first[law.leader]
        if joint.name != head:
            base = led(laws, head)
            slope = law.slope / base.slope
            made.append(with_values(joint, kind=kind, mimic=Law(head, slope, law.offset - slope * base.offset)))
            continue
        leader = by_name[law.leader]
        low, high = sorted(law.slope * end + law.offset for end in (leader.lower, leader.upper))
        velocity = abs(law.slope) * leader.velocity
        made.append(with_values(joint, kind=kind, mimic=None, lower=low, upper=high, velocity=velocity))
    return tuple(made)


def _build(urdf: UrdfFile, joints: tuple[UrdfJoint, ...], root: str, mimic: bool) -> pin.Model:
    base = [pin.JointModelFreeFlyer()] if root == "free" else []
    try:
        return pin.buildModelFromXML(_text(urdf, joints), *base, mimic=mimic)
    except Exception as error:  # the file passed our checks but fails in urdfdom
        reason = " ".join(str(error).split())
        raise FileFormatError(f"{urdf.path}: Pinocchio cannot read it ({reason}); correct the file") from error


def _text(urdf: UrdfFile, joints: tuple[UrdfJoint, ...]) -> str:
    """The links and joints as a URDF without shapes, with exact numbers."""
    robot = Element("robot", name=urdf.name)
    for name in urdf.links:
        link = SubElement(robot, "link", name=name)
        if name in urdf.inertials:
            link.append(urdf.inertials[name])
    for joint in joints:
        axis = None if joint.kind in ("fixed", "floating") else joint.axis
        limit = ANY_LIMIT if joint.kind in ("revolute", "prismatic") else None
        made = add_joint(robot, *joint[:4], origin=joint.origin, axis=axis, limit=limit)
        if joint.mimic is not None:
            multiplier, offset = (repr(float(value)) for value in joint.mimic[1:])
            SubElement(made, "mimic", joint=joint.mimic.leader, multiplier=multiplier, offset=offset)
    return ElementTree.tostring(robot, encoding="unicode")


def _set_limits(model: pin.Model, joints: tuple[UrdfJoint, ...]) -> None:
    lower, upper = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    velocity, effort = np.array(model.velocityLimit), np.array(model.effortLimit)
    for joint in joints:
        if not model.existJointName(joint.name) or joint.mimic is not None:
            continue
        made = model.joints[model.getJointId(joint.name)]
        if made.nv == 1:
            velocity[made.idx_v], effort[made.idx_v] = joint.velocity, joint.effort
            if made.nq == 1:
                lower[made.idx_q], upper[made.idx_q] = joint.lower, joint.upper
    # adding 0.0 makes -0.0 to 0.0: numpy draws no random number between 0.0 and -0.0
    model.lowerPositionLimit, model.upperPositionLimit = lower + 0.0, upper + 0.0
    model.velocityLimit, model.effortLimit = velocity, effort


SAMPLES = 400  # number of random postures for finding pairs that always overlap


def urdf_figure(
    path: str | PathLike[str],
    root: str | None = None,
    package_dirs: Iterable[str | PathLike[str]] = (),
    concavity: Concavity = None,
    samples: int = SAMPLES,
    srdf: str | PathLike[str] | None = None,
) -> Figure:
    """Return the figure of a URDF file; arguments and errors as for `wholebody.load`."""
    if root not in (None, "fixed", "free"):
        raise InputError(f"root is {root!r}; give 'fixed' or 'free'")
    folders = [package_dirs] if isinstance(package_dirs, (str, PathLike)) else package_dirs
    urdf = read_urdf(Path(path), [Path(folder) for folder in folders])
    urdf, world = _without_world(urdf, root)
    place = None if world is None else world.origin
    extension = urdf.extension
    if root is None:
        root = "free" if place is not None or (extension is not None and extension.get("root") == "free") else "fixed"
    model, remarks = urdf_model(urdf, root)
    check_size(model, urdf.path)
    hollows = check_concavity(concavity, urdf.links)
    geometry, notes, _ = geometry_of_links(
        model, urdf.shapes, hollows, urdf.path, named=extension is not None, colors=urdf.colors
    )
    if extension is not None:
        return extended_figure(urdf.path, extension, urdf.name, model, geometry, (*urdf.notes, *remarks, *notes))
    visual = visual_of_links(model, ((number, *one) for number, one in enumerate(urdf.visuals)))
    robot = Robot(urdf.name, model, urdf.links, geometry, (*urdf.notes, *remarks, *notes), visual, place=place)
    return robot_figure(robot if srdf is None else _described(robot, Path(srdf), world), samples)


def _without_world(urdf: UrdfFile, root: str | None) -> tuple[UrdfFile, UrdfJoint | None]:
    """The file without an empty root link on which all the rest floats, as MuJoCo takes it; and the floating joint.

    With a fixed root the rest is fixed there.
    """
    world, first = urdf.links[0], [joint for joint in urdf.joints if joint.parent == urdf.links[0]]
    filled = {*urdf.inertials, *(one.link for one in urdf.shapes), *(one.shape.link for one in urdf.visuals)}
    if [joint.kind for joint in first] != ["floating"] or world in filled:
        return urdf, None
    if root == "fixed":
        held = (with_values(joint, kind="fixed") if joint is first[0] else joint for joint in urdf.joints)
        return with_values(urdf, joints=tuple(held)), None
    links = (first[0].child, *(name for name in urdf.links[1:] if name != first[0].child))
    joints = tuple(joint for joint in urdf.joints if joint is not first[0])
    return with_values(urdf, links=links, joints=joints), first[0]


def _described(robot: Robot, path: Path, world: UrdfJoint | None) -> Robot:
    known = read_srdf(path, robot.model, robot.links, world)
    owners = [robot.model.frames[piece.parentFrame].name for piece in robot.geometry.geometryObjects]
    return with_values(
        robot,
        notes=(*robot.notes, *known.notes),
        groups=known.groups,
        postures=known.postures,
        untested=lambda first, second: known.disabled.get(frozenset((owners[first], owners[second]))),
    )
