"""An extension of URDF: the element ``<wholebody>``, which our figures write and read.

Other programs ignore it. With it the figure that is read from a file equals the figure that was written: its pairs,
postures, groups, chains, frames for goals, reach cones, ranges of motion, collision groups and weights of effort. All
parts are by name::

    <wholebody root="free" detail="capsules">
      <frames names="left_palm left_index_tip"/>
      <segments names="pelvis left_hand"/>
      <group name="left_arm" joints="left_shoulder_flexion left_elbow_flexion"/>
      <chain name="left_arm" tip="left_index_tip" joints="left_shoulder_flexion left_elbow_flexion"/>
      <posture name="standing" root="0 0 0.93 0 0 0 1" joints="left_elbow_flexion" values="0.26"/>
      <untested reason="same segment" pairs="left_hand:0 left_hand:1"/>
      <cone name="left_shoulder" reference="thorax" limb="left_upper_arm" axis="0 0 -1" visible="1 0 0" corners="..."/>
      <coupled_range name="left_hamstrings" joints="left_hip_flexion left_knee_flexion" factors="1 -0.9"
       bound="1.08"/>
      <elliptic_range name="neck">
        <angle joints="neck1_lateral" lower="-0.78" upper="0.78" offset="0"/>
      </elliptic_range>
      <twist_range name="left_shoulder_twist" reference="thorax" limb="left_upper_arm" center="..." sign="-1"
       bound="1.7" slope="0 0 1.38"/>
      <collision_group name="left_arm" segments="left_forearm left_hand"/>
      <effort joints="left_clavicle_elevation" weights="1000"/>
      <person sex="male" stature="1.755" mass="84.6" age="40" dimensions="sitting_height" values="0.93"/>
    </wholebody>

A posture gives the joints that are not at zero, in radians and metres, and the placement of the root: x, y, z and the
quaternion x, y, z, w. The person is whose body it is: sizes in metres and kilograms, the age in years if it is known,
and the dimensions that were stated. Pieces have the names of their ``<collision>`` elements. All pairs are tested
except the untested ones and those whose pieces are on one joint.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import shown
from wholebody.base.errors import FileFormatError, UnknownNameError, WholebodyError
from wholebody.figures.anthropometry import Person, make_person
from wholebody.figures.body_spec import digits
from wholebody.figures.description import ROOT_JOINT, Articulated, Chain, Description, ExcludedPair, JointCone
from wholebody.figures.figure import Figure
from wholebody.figures.motion_ranges import (
    LARGEST_ELLIPSE,
    CoupledRange,
    EllipseAxis,
    EllipticRange,
    MotionRange,
    ReachCone,
    TwistRange,
)
from wholebody.figures.self_pairs import drop_rigid_pairs
from wholebody.figures.urdf.xml_reading import numbers
from wholebody.geometry.large_models import add_pairs

SIZES = ("stature", "mass", "age", "shoes", "clothing")
"""Numbers of a person that a file has: the first two, and the others that are known."""


def extension_text(figure: Figure) -> str:
    """Return the element of a figure, indented for its URDF."""
    known = figure.describe()
    made = Element("wholebody", root=figure.root, detail=figure.detail)
    SubElement(made, "frames", names=" ".join(figure.frames))
    SubElement(made, "segments", names=" ".join(figure.segments))
    for name, joints in known.groups.items():
        SubElement(made, "group", name=name, joints=" ".join(joints))
    for name, chain in known.chains.items():
        SubElement(made, "chain", name=name, tip=chain.tip, joints=" ".join(chain.joints))
    for name in figure.postures:
        q = figure.posture(name)
        values = {joint: value for joint, value in figure.joint_values(q).items() if abs(value) > 1e-12}
        posture = SubElement(made, "posture", name=name)
        if figure.root == "free":
            posture.set("root", digits(q[:7]))
        posture.set("joints", " ".join(values))
        posture.set("values", digits(values.values()))
    reasons: dict[str, list[str]] = {}
    for pair in figure.excluded_pairs:
        reasons.setdefault(pair.reason, []).append(f"{pair.a} {pair.b}")
    for reason, pairs in reasons.items():
        SubElement(made, "untested", reason=reason, pairs=" ".join(pairs))
    for name, cone in known.cones.items():
        ends = {"reference": cone.reference, "limb": cone.limb, "axis": digits(cone.axis)}
        shape = {"visible": digits(cone.cone.visible), "corners": digits(cone.cone.vertices.ravel())}
        SubElement(made, "cone", {"name": name, **ends, **shape})
    _add_ranges(made, known.ranges)
    collision_groups: dict[str, list[str]] = {}
    for segment, name in known.collision_groups.items():
        collision_groups.setdefault(name, []).append(segment)
    for name, segments in collision_groups.items():
        SubElement(made, "collision_group", name=name, segments=" ".join(segments))
    effort = {joint: weight for joint, weight in known.effort.items() if joint in figure.joints}
    if effort:
        SubElement(made, "effort", joints=" ".join(effort), weights=digits(effort.values()))
    if any(known.root_effort):
        SubElement(made, "root_effort", weights=digits(known.root_effort))
    if known.person is not None:
        _add_person(made, known.person)
    ElementTree.indent(made, space="  ", level=1)
    return "  " + ElementTree.tostring(made, encoding="unicode").rstrip() + "\n"


def extended_figure(
    path: Path, element: Element, name: str, model: pin.Model, geometry: pin.GeometryModel, notes: Sequence[str]
) -> Figure:
    """Return the figure that an element of `extension_text` describes; pairs are added to its pieces."""
    return _Reader(path, element, model, geometry).figure(name, tuple(notes))


class _Reader:
    def __init__(self, path: Path, element: Element, model: pin.Model, geometry: pin.GeometryModel) -> None:
        self.path, self.element, self.model, self.geometry = path, element, model, geometry
        self.joints = {joint for joint in list(model.names)[1:] if joint != ROOT_JOINT}
        self.frames = {frame.name for frame in model.frames}

    def figure(self, name: str, notes: tuple[str, ...]) -> Figure:
        excluded = self._pairs()
        postures = {self._name(item): self._posture(item) for item in self.element.findall("posture")}
        if not postures:
            self._fail("it has no <posture>; write the figure again")
        efforts: dict[str, float] = {}
        for item in self.element.findall("effort"):
            joints = self._joints(item)
            efforts.update(zip(joints, numbers(item, "weights", self._place(item), len(joints)), strict=True))
        segments = self._listed("segments")
        description = Description(
            groups={self._name(item): self._joints(item) for item in self.element.findall("group")},
            chains={
                self._name(item): Chain(self._joints(item), self._names(item, "tip", "frame", self.frames)[0])
                for item in self.element.findall("chain")
            },
            frames=self._listed("frames"),
            segments=segments,
            postures=postures,
            cones={self._name(item): self._cone(item) for item in self.element.findall("cone")},
            collision_groups={
                segment: self._name(item)
                for item in self.element.findall("collision_group")
                for segment in self._names(item, "segments", "segment", set(segments))
            },
            effort=efforts,
            excluded=excluded,
            ranges={
                self._name(item): self._range(item)
                for tag in ("coupled_range", "elliptic_range", "twist_range")
                for item in self.element.findall(tag)
            },
            root_effort=self._root_effort(),
            notes=notes,
            person=self._person(),
        )
        return Figure(name, self.model, self.geometry, self.element.get("detail", "own"), description)

    def _pairs(self) -> tuple[ExcludedPair, ...]:
        pieces = [piece.name for piece in self.geometry.geometryObjects]
        excluded: dict[frozenset[str], ExcludedPair] = {}
        for item in self.element.findall("untested"):
            names = self._names(item, "pairs", "piece", set(pieces))
            if len(names) % 2:
                self._fail("<untested> has a piece without partner in its pairs; write two names a pair")
            for a, b in zip(names[::2], names[1::2], strict=True):
                excluded[frozenset((a, b))] = ExcludedPair(a, b, item.get("reason", ""))
        self.geometry.removeAllCollisionPairs()
        all_pairs = ((first, second) for second in range(len(pieces)) for first in range(second))
        tested = [pair for pair in all_pairs if frozenset(pieces[k] for k in pair) not in excluded]
        add_pairs(self.geometry, np.array(tested, dtype=np.intp).reshape(-1, 2))
        return (*excluded.values(), *drop_rigid_pairs(self.geometry))

    def _posture(self, item: Element) -> Callable[[Articulated], Array]:
        joints = self._joints(item)
        values = numbers(item, "values", self._place(item), len(joints), "") if joints else ()
        root = None
        if item.get("root") is not None:
            root = np.array(numbers(item, "root", self._place(item), 7))
            if abs(float(np.linalg.norm(root[3:])) - 1.0) > 1e-6:
                self._fail(f"posture {shown(item.get('name'))} has a root whose quaternion is not of unit length")
            root[3:] /= np.linalg.norm(root[3:])
        return partial(_placed, root=root, values=dict(zip(joints, values, strict=True)))

    def _cone(self, item: Element) -> JointCone:
        place = self._place(item)
        count = len(item.get("corners", "").split())
        try:
            cone = ReachCone(
                np.array(numbers(item, "corners", place, count)).reshape(-1, 3), numbers(item, "visible", place, 3)
            )
        except (WholebodyError, ValueError) as error:
            if isinstance(error, FileFormatError):
                raise
            raise FileFormatError(f"{place}: {error}") from None
        ends = [self._names(item, end, "frame", self.frames)[0] for end in ("reference", "limb")]
        return JointCone(cone, ends[0], ends[1], np.array(numbers(item, "axis", place, 3)))

    def _range(self, item: Element) -> MotionRange:
        place = self._place(item)
        if item.tag == "coupled_range":
            joints = self._joints(item)
            factors = numbers(item, "factors", place, len(joints))
            return CoupledRange(dict(zip(joints, factors, strict=True)), numbers(item, "bound", place, 1)[0])
        if item.tag == "elliptic_range":
            axes = [self._ellipse_axis(angle, place) for angle in item.findall("angle")]
            if not 0 < len(axes) <= LARGEST_ELLIPSE:
                self._fail(f"<elliptic_range> {shown(item.get('name'))} has {len(axes)} angles; give 1 to 3")
            return EllipticRange(tuple(axes))
        reference, limb = (self._names(item, end, "frame", self.frames)[0] for end in ("reference", "limb"))
        center = np.array(numbers(item, "center", place, 9)).reshape(3, 3)
        if np.abs(center @ center.T - np.eye(3)).max() > 1e-6 or np.linalg.det(center) < 0.0:
            self._fail(f"<twist_range> {shown(item.get('name'))} has a center that is no rotation")
        sign = math.copysign(1.0, numbers(item, "sign", place, 1)[0])
        bound, slope = numbers(item, "bound", place, 1)[0], np.array(numbers(item, "slope", place, 3))
        return TwistRange(reference, limb, center, sign, bound, slope)

    def _ellipse_axis(self, angle: Element, place: str) -> EllipseAxis:
        joints = self._joints(angle)
        low, high, offset = (numbers(angle, name, place, 1)[0] for name in ("lower", "upper", "offset"))
        if not low < 0.0 < high:
            self._fail(f"<angle> of {place} goes from {low:g} to {high:g}; zero is to be between them")
        return EllipseAxis(joints, low, high, offset)

    def _root_effort(self) -> tuple[float, float]:
        found = self.element.findall("root_effort")
        if not found:
            return 0.0, 0.0
        position, rotation = numbers(found[-1], "weights", self._place(found[-1]), 2)
        if min(position, rotation) < 0.0:
            self._fail("<root_effort> has a negative weight; weights are zero or more")
        return position, rotation

    def _person(self) -> Person | None:
        item = self.element.find("person")
        if item is None:
            return None
        place, needed = self._place(item), SIZES[:2]
        given = [name for name in SIZES if name in needed or item.get(name) is not None]
        sizes = {name: numbers(item, name, place, 1)[0] for name in given}
        names = item.get("dimensions", "").split()
        values = numbers(item, "values", place, len(names), "")
        if twice := [name for name in names if names.count(name) > 1]:
            raise FileFormatError(f"{place}: {shown(twice[0])} is stated twice; state it once")
        try:
            return make_person(item.get("sex", ""), **sizes, proportions=dict(zip(names, values, strict=True)))
        except WholebodyError as error:
            raise FileFormatError(f"{place}: {error}") from None

    def _listed(self, tag: str) -> tuple[str, ...]:
        return tuple(
            name for item in self.element.findall(tag) for name in self._names(item, "names", "frame", self.frames)
        )

    def _joints(self, item: Element) -> tuple[str, ...]:
        return self._names(item, "joints", "joint", self.joints)

    def _name(self, item: Element) -> str:
        name = item.get("name")
        if not name:
            self._fail(f"a <{item.tag}> has no name; give it one")
        return name

    def _names(self, item: Element, attribute: str, kind: str, known: Iterable[str]) -> tuple[str, ...]:
        names = tuple(item.get(attribute, "").split())
        for name in names:
            if name not in known:
                raise FileFormatError(str(UnknownNameError(kind, name, known, self._place(item))))
        if not names and attribute in ("tip", "reference", "limb"):
            self._fail(f"<{item.tag}> {shown(item.get('name'))} has no {attribute}; add it")
        return names

    def _place(self, item: Element) -> str:
        return f"{self.path}: <wholebody>, <{item.tag}> {item.get('name', '')}".rstrip()

    def _fail(self, what: str) -> NoReturn:
        raise FileFormatError(f"{self.path}: <wholebody>: {what}")


def _placed(figure: Articulated, root: Array | None, values: dict[str, float]) -> Array:
    q = pin.neutral(figure.model)
    if root is not None and figure.root == "free":
        q[:7] = root
    return np.asarray(figure.with_joints(q, values))


def _add_person(made: Element, person: Person) -> None:
    sizes = {name: digits([value]) for name in SIZES if (value := getattr(person, name)) is not None}
    found = SubElement(made, "person", {"sex": person.sex, **sizes})
    if person.stated:
        of = dict(person.dimensions)
        found.set("dimensions", " ".join(person.stated))
        found.set("values", digits(of[name] for name in person.stated))


def _add_ranges(made: Element, ranges: Mapping[str, MotionRange]) -> None:
    for name, part in ranges.items():
        if isinstance(part, CoupledRange):
            texts = {"joints": " ".join(part.joints), "factors": digits(part.joints.values())}
            SubElement(made, "coupled_range", {"name": name, **texts, "bound": digits([part.bound])})
        elif isinstance(part, EllipticRange):
            ellipse = SubElement(made, "elliptic_range", name=name)
            for axis in part.axes:
                low, high, offset = (digits([value]) for value in axis[1:])
                SubElement(ellipse, "angle", joints=" ".join(axis.joints), lower=low, upper=high, offset=offset)
        else:
            ends = {"name": name, "reference": part.reference, "limb": part.limb, "center": digits(part.center.ravel())}
            bound = {"sign": digits([part.sign]), "bound": digits([part.bound]), "slope": digits(part.slope)}
            SubElement(made, "twist_range", {**ends, **bound})
