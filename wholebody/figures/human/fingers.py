"""Hands with fingers: the person's hand as a palm, a thumb of three parts and four fingers of three.

Twenty joints a hand. Lengths, thicknesses and limits are those of the table "hand", as in `wholebody.figures.hand`;
here the thumb's metacarpal moves too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import coal
import pinocchio as pin

from wholebody.base.checks import choice, known
from wholebody.figures.anthropometry import FINGER_BASES, Dimensions, keyed_hand
from wholebody.figures.body_spec import BodySpec, Landmark, Link, Solid, place
from wholebody.figures.hand import (
    FINGERS,
    PARTS,
    finger_base,
    finger_degrees,
    finger_joints,
    massive_links,
    palm_axes,
    part_radii,
    part_radius,
    thumb_metacarpal,
)
from wholebody.figures.human.details import hull_of
from wholebody.figures.tables import named_angles

HANDS = ("rigid", "fingers")
"""What a person's hands can be: one segment each, or palms with fingers."""

SIDES = ("left", "right")


def finger_effort(joint: str) -> float:
    """Weight of a finger's joint in a person's effort, beside 1 of an elbow.

    Fitted to typing, where 1.6 for flexion is best; half of it is used, because with more, grasps are found
    less often. Of the thumb an ESTIMATE: it moves before an arm.
    """
    if "thumb" in joint:
        return 0.2
    return 0.8 if joint.endswith("flexion") else 0.4


class _Part(NamedTuple):
    """One part of a finger: its key in the table, segment, and placement of its first joint in the part before it."""

    key: str
    segment: str
    parent: str
    origin: pin.SE3


def finger_angles(shape: str, side: str | None = None) -> dict[str, float]:
    """Return the angle of every joint of the fingers in a shape of the hand, radians.

    Use it with a person whose hands have fingers: ``figure.with_joints(q, wb.figures.finger_angles("fist", "right"))``.

    Args:
        shape: "relaxed", "flat", "fist", "hook", "pinch" or "pointing".
        side: "left" or "right"; both hands if left out.

    Raises:
        UnknownNameError: another shape.
        InputError: another side.

    Examples:
        >>> dexterous = wb.load("human", hands="fingers")
        >>> fist = dexterous.with_joints(dexterous.neutral, wb.figures.finger_angles("fist", "right"))
    """
    shapes = named_angles("fingers")
    degrees = shapes[known(shape, shapes, "shape of a hand", "finger_angles")]
    sides = SIDES if side is None else (choice(side, SIDES, "finger_angles: side"),)
    return {
        f"{which}_{joint}": math.radians(angle) for which in sides for joint, angle in finger_degrees(degrees).items()
    }


def opened_for_a_bar(sides: Sequence[str]) -> Iterator[dict[str, float]]:
    """Angles [rad] of fingers from which hands take a bar: no thumb, a fist's, a hook's; nothing without sides."""
    # Fingers that first bend at their roots touch the bar with their first phalanges before the palm does.
    hook, fist = ({name: angle for side in sides for name, angle in finger_angles(shape, side).items()}
                  for shape in ("hook", "fist"))  # fmt: skip
    fingers = {name: angle for name, angle in hook.items() if "thumb" not in name}
    if fingers:
        yield fingers
        yield fingers | {name: angle for name, angle in fist.items() if "thumb" in name}
        yield hook


def with_fingers(spec: BodySpec, size: Dimensions, detail: str) -> BodySpec:
    """Return a person's specification with fingers, in "capsules" or "hulls", in the place of hands of one segment."""
    links: list[Link] = [link for link in spec.links if link.name not in ("left_hand", "right_hand")]
    joints, marks, solids = list(spec.joints), list(spec.landmarks), list(spec.solids)
    for side in SIDES:
        parts = list(_parts(size, side))
        added = [
            joint
            for part in parts
            for joint in finger_joints(
                side, part.segment.split("_")[1], part.key, part.parent, part.segment, part.origin
            )
        ]
        joints += added
        segments = {part.segment for part in parts}
        radii = {part.segment: part_radii(size, part.key) for part in parts}
        links += massive_links(size, {f"{side}_hand": part_radii(size, "palm"), **radii})
        links += [Link(joint.child) for joint in added if joint.child not in segments]
        tips = {mark.name: mark for mark in _tips(size, side)}
        marks = [tips.pop(mark.name, mark) for mark in marks]
        marks += tips.values()
        solids = [solid for solid in solids if solid.segment != f"{side}_hand"]
        solids += [hull_of(solid) if detail == "hulls" else solid for solid in _solids(size, side, parts)]
    return replace(spec, links=tuple(links), joints=tuple(joints), landmarks=tuple(marks), solids=tuple(solids))


def _parts(size: Dimensions, side: str) -> Iterator[_Part]:
    for finger, names in FINGERS.items():
        parent = f"{side}_hand"
        origin = _zero_metacarpal(size, side) if finger == "thumb" else finger_base(size, side, finger)
        for name in ("mc", *names) if finger == "thumb" else names:
            key, segment = f"{finger}_{name}", f"{side}_{finger}_{PARTS[name]}"
            yield _Part(key, segment, parent, origin)
            parent, origin = segment, place(z=-keyed_hand(key, "length") * size.hand_length)


def _zero_metacarpal(size: Dimensions, side: str) -> pin.SE3:
    """Placement of the thumb's metacarpal at zero: it rests where the table has its abduction."""
    rest = math.radians(finger_degrees({})["thumb_cmc_abduction"])
    return thumb_metacarpal(size, side) * place(rotation=pin.utils.rotate("y", rest))


def _tips(size: Dimensions, side: str) -> Iterator[Landmark]:
    for finger in FINGERS:
        end = place(z=-keyed_hand(f"{finger}_dp", "length") * size.hand_length, rotation=palm_axes(side))
        yield Landmark(f"{side}_{finger}_tip", f"{side}_{finger}_distal", end)


def _solids(size: Dimensions, side: str, parts: list[_Part]) -> Iterator[Solid]:
    """The palm up to the knuckles as a box, each part of a finger as a capsule that ends at the fingertip."""
    palm = FINGER_BASES["middle"][1] * size.hand_length + 0.5 * part_radius(size, "middle_pp")
    box = coal.Box(size.hand_breadth, 2.0 * size.palm_half_thickness, palm)
    yield Solid(f"{side}_hand:0", f"{side}_hand", box, place(z=-0.5 * palm))
    for part in parts:
        length, radius = keyed_hand(part.key, "length") * size.hand_length, part_radius(size, part.key)
        start = 0.3 * length if part.key == "thumb_mc" else 0.0
        end = length - radius if part.key.endswith("_dp") else length
        yield Solid(part.segment, part.segment, coal.Capsule(radius, end - start), place(z=-0.5 * (start + end)))
