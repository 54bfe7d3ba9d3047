"""The SRDF beside a URDF, as MoveIt writes it: groups of joints, named states, pairs of links that are not tested."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import shown
from wholebody.base.errors import FileFormatError
from wholebody.figures.description import ROOT_JOINT, ROUNDED, follows, zero_within_limits
from wholebody.figures.urdf.joints import UrdfJoint
from wholebody.figures.urdf.xml_reading import bounded, numbers, read_robot
from wholebody.geometry.placement import FARTHEST

READ = {
    *("group", "group_state", "disable_collisions", "enable_collisions", "disable_default_collisions"),
    "end_effector",  # a name for a group
}
"""Elements that are read."""


class Srdf(NamedTuple):
    """What an SRDF says of a robot."""

    groups: Mapping[str, tuple[str, ...]]  # group to joints that move
    # name to posture (nq,); "<group>/<state>" where several groups have a state of that name
    postures: Mapping[str, Array]
    disabled: Mapping[frozenset[str], str]  # two links -> why they are never tested
    notes: tuple[str, ...]  # sentences on lines that name what the URDF does not have


def read_srdf(path: Path, model: pin.Model, links: tuple[str, ...], world: UrdfJoint | None = None) -> Srdf:
    """Read the SRDF of a URDF that has a model and links.

    `world` is the joint of the URDF on which a free root floats: the root is at its place where a state has none.
    """
    robot = read_robot(path, "SRDF")
    reader = _Reader(path, robot, model, links, world)
    read = READ | {"virtual_joint"} if reader.free else READ
    unknown = sorted({str(part.tag) for part in robot if isinstance(part.tag, str)} - read)
    if unknown:
        reader.notes.append(f"SRDF: {', '.join(unknown)} is not kept")
    groups = {name: reader.joints(group, (name,)) for name, group in reader.groups.items()}
    return Srdf(groups, reader.postures(), reader.disabled(), tuple(dict.fromkeys(reader.notes)))


class _Reader:
    """One file while it is read."""

    def __init__(
        self, path: Path, robot: Element, model: pin.Model, links: tuple[str, ...], world: UrdfJoint | None
    ) -> None:
        self._path, self._robot, self._model, self._world = path, robot, model, world
        self._links = links if world is None else (world.parent, *links)
        self.groups = {str(group.get("name")): group for group in robot.findall("group")}
        self._virtual = {str(joint.get("name")) for joint in robot.findall("virtual_joint")}
        if world is not None:
            self._virtual.add(world.name)
        self.free = model.existJointName(ROOT_JOINT)
        # Pinocchio's name of a free root stands in files that have no virtual joint
        self._roots = {ROOT_JOINT, *self._virtual} if self.free else set()
        names = [str(group.get("name")) for group in robot.findall("group")]
        twice = [name for name in self.groups if names.count(name) > 1]
        self.notes = [f"SRDF: group {shown(name)} is there twice; the last one is kept" for name in twice]
        self._movable = {
            name: index
            for index, name in enumerate(model.names)
            if index and model.joints[index].nv == 1 and not follows(model.joints[index])
        }

    def joints(self, group: Element, inside: tuple[str, ...]) -> tuple[str, ...]:
        """Joints of a group that move, in the order of the model."""
        found: set[str] = set()
        for part in group:
            name = str(part.get("name"))
            if part.tag == "joint":
                if not self._model.existFrame(name) and name not in self._virtual:
                    said = f"names the joint {shown(name)}, which is not in the URDF"
                    self.notes.append(f"SRDF: group {shown(inside[-1])} {said}")
                found |= {name} & self._movable.keys()
            elif part.tag == "link" and self._known(name):
                found |= {self._model.names[self._carrier(name)]} & self._movable.keys()
            elif part.tag == "chain":
                ends = str(part.get("base_link")), str(part.get("tip_link"))
                if self._both_known(ends):
                    below = set(self._model.supports[self._carrier(ends[1])])
                    above = set(self._model.supports[self._carrier(ends[0])])
                    found |= {self._model.names[joint] for joint in below - above} & self._movable.keys()
            elif part.tag == "group" and name in self.groups and name not in inside:
                found |= set(self.joints(self.groups[name], (*inside, name)))
            elif part.tag == "group":
                self.notes.append(f"SRDF: group {shown(inside[-1])} names {shown(name)}, which is no other group")
        return tuple(sorted(found, key=self._movable.__getitem__))

    def postures(self) -> dict[str, Array]:
        """Named states as postures; joints that a state does not name are at zero, or at the limit nearest to it."""
        elements = self._robot.findall("group_state")
        names = [str(state.get("name")) for state in elements]
        found: dict[str, Array] = {}
        for state, name in zip(elements, names, strict=True):
            q = zero_within_limits(self._model)
            if self._world is not None:
                q[:7] = pin.SE3ToXYZQUAT(self._world.origin)
            for joint in state.findall("joint"):
                known = str(joint.get("name"))
                where = f"{self._path}: state {shown(name)}: joint {shown(known)}"
                if known in self._roots:
                    q[:7] = self._on_the_world(known, _free_placement(joint, where))
                    continue
                if known not in self._movable:
                    self.notes.append(f"SRDF: state {shown(name)} names the joint {shown(known)}, which does not move")
                    continue
                (value,) = numbers(joint, "value", where, 1)
                made = self._model.joints[self._movable[known]]
                if made.nq == 1 and not self._within(made.idx_q, value):
                    self.notes.append(f"SRDF: state {shown(name)} puts the joint {shown(known)} beyond its limits")
                q[made.idx_q : made.idx_q + made.nq] = (value,) if made.nq == 1 else (np.cos(value), np.sin(value))
            called = name if names.count(name) == 1 else f"{state.get('group')}/{name}"
            if called in found:
                self.notes.append(f"SRDF: state {shown(called)} is there twice; the last one is kept")
            found[called] = q
        return found

    def _on_the_world(self, joint: str, value: Array) -> Array:
        """Position and quaternion (7,) in the world of a root; a joint of the URDF moves from its own origin."""
        if self._world is None or joint != self._world.name:
            return value
        return np.asarray(pin.SE3ToXYZQUAT(self._world.origin * pin.XYZQUATToSE3(value)))

    def _within(self, place: int, value: float) -> bool:
        least, most = self._model.lowerPositionLimit[place], self._model.upperPositionLimit[place]
        return bool(least - ROUNDED <= value <= most + ROUNDED)

    def disabled(self) -> dict[frozenset[str], str]:
        """Pairs of links that are not tested."""
        found: dict[frozenset[str], str] = {}
        for element in self._robot.findall("disable_default_collisions"):
            name = str(element.get("link"))
            if self._known(name):
                found |= {
                    frozenset((name, other)): "the SRDF disables its link" for other in self._links if other != name
                }
        for pair, _ in self._pairs("enable_collisions"):
            found.pop(pair, None)
        for pair, reason in self._pairs("disable_collisions"):
            found[pair] = f"the SRDF disables them{f': {reason}' if reason else ''}"
        return found

    def _pairs(self, tag: str) -> Iterator[tuple[frozenset[str], str]]:
        for element in self._robot.findall(tag):
            ends = str(element.get("link1")), str(element.get("link2"))
            if self._both_known(ends):
                yield frozenset(ends), element.get("reason") or ""

    def _known(self, link: str) -> bool:
        if link not in self._links:
            self.notes.append(f"SRDF: link {shown(link)} is not in the URDF, so what is said of it is left out")
        return link in self._links

    def _both_known(self, ends: tuple[str, str]) -> bool:
        first, second = (self._known(end) for end in ends)
        return first and second

    def _carrier(self, link: str) -> int:
        if self._world is not None and link == self._world.parent:
            return 0  # the universe
        return int(self._model.frames[self._model.getFrameId(link, pin.FrameType.BODY)].parentJoint)


def _free_placement(joint: Element, place: str) -> Array:
    """Position and quaternion (7,) x y z, x y z w of a free root, as MoveIt and Pinocchio order them."""
    found = np.array(bounded(joint, "value", place, 7, most=FARTHEST))
    length = float(np.linalg.norm(found[3:]))
    if not abs(length - 1.0) < 1e-2:
        said = "the last four are a quaternion x y z w"
        raise FileFormatError(f"{place}: {said}, whose length is {length:g}; give one of length 1")
    found[3:] /= length
    return found
