"""The person: a free root and 49 revolute joints (55 degrees of freedom), scaled from sex, stature and mass.

Structure after Abdel-Malek & Arora, Human Motion Simulation: Predictive Dynamics (2013), fig. 2.26: spine 4 x 3, neck
3 + 2, arms clavicle 2, shoulder 3, elbow 2, wrist 2, legs hip 3, knee 1, ankle 2, toe 1. Every joint's positive
direction means the same on both sides: flexion, abduction, inward rotation, elevation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

import coal

from wholebody.base.checks import known
from wholebody.base.errors import InputError
from wholebody.figures.anthropometry import FINGER_BASES, Dimensions, Person, describe, keyed_hand, make_person
from wholebody.figures.body_spec import BodySpec, Joint, Landmark, Link, Solid, place
from wholebody.figures.hand import (
    SIDES,
    FingerPart,
    finger_joints,
    finger_parts,
    fingertips,
    hand_links,
    palm_axes,
    part_radius,
)
from wholebody.figures.human import details
from wholebody.figures.sizes import MIDDLE_TIP
from wholebody.figures.tables import keyed, table

DETAILS: dict[str, Callable[[Dimensions], tuple[Solid, ...]]] = {
    "spheres": details.spheres,
    "capsules": details.solids,
    "hulls": details.polyhedra,
}


def human_spec(person: Person | None = None, detail: str = "capsules", hands: str = "rigid") -> BodySpec:
    """Return the specification of a person, or of the median man; arguments and errors as for `wholebody.load`."""
    person = person or make_person()
    known(hands, ("rigid", "fingers"), "kind of hands", "human")
    if hands == "fingers" and detail == "spheres":
        raise InputError("hands='fingers': the 39 spheres have none for fingers; give detail 'capsules' or 'hulls'")
    spec = BodySpec(
        name="human",
        title=describe(person),
        links=_links(person),
        joints=_joints(person),
        landmarks=landmarks(Dimensions(person)),
        solids=human_solids(person, detail),
        person=person,
    )
    return _with_fingers(spec, Dimensions(person), detail) if hands == "fingers" else spec


def _with_fingers(spec: BodySpec, size: Dimensions, detail: str) -> BodySpec:
    """The specification with fingers, in "capsules" or "hulls", in the place of hands of one segment."""
    hands = tuple(f"{side}_hand" for side in SIDES)
    links = [link for link in spec.links if link.name not in hands]
    joints, marks = list(spec.joints), {mark.name: mark for mark in spec.landmarks}
    solids = [solid for solid in spec.solids if solid.segment not in hands]
    for side in SIDES:
        parts = tuple(finger_parts(size, side))
        added = finger_joints(side, parts)
        joints += added
        links += hand_links(size, side, parts, added)
        marks |= {mark.name: mark for mark in fingertips(size, side)}
        made = _finger_solids(size, side, parts)
        solids += map(details.hull_of, made) if detail == "hulls" else made
    return replace(
        spec, links=tuple(links), joints=tuple(joints), landmarks=tuple(marks.values()), solids=tuple(solids)
    )


def _finger_solids(size: Dimensions, side: str, parts: Iterable[FingerPart]) -> Iterator[Solid]:
    """The palm up to the knuckles as a box, each part of a finger as a capsule that ends at the fingertip."""
    palm = FINGER_BASES["middle"][1] * size.hand_length + 0.5 * part_radius(size, "middle_pp")
    box = coal.Box(size.hand_breadth, 2.0 * size.palm_half_thickness, palm)
    yield Solid(f"{side}_hand:0", f"{side}_hand", box, place(z=-0.5 * palm))
    for part in parts:
        length, radius = keyed_hand(part.key, "length") * size.hand_length, part_radius(size, part.key)
        start = 0.3 * length if part.key == "thumb_mc" else 0.0
        end = length - radius if part.key.endswith("_dp") else length
        yield Solid(part.segment, part.segment, coal.Capsule(radius, end - start), place(z=-0.5 * (start + end)))


def human_solids(person: Person, detail: str) -> tuple[Solid, ...]:
    """Return the collision pieces of a person in one detail, a name of `DETAILS`."""
    return DETAILS[known(detail, DETAILS, "detail")](Dimensions(person))


def _links(person: Person) -> tuple[Link, ...]:
    links = []
    for name in ("pelvis", *(row["child_segment"] for row in table("joints"))):
        if name in keyed("segments"):
            x, y, z = (float(value) for value in person.center_of_mass(name))
            ix, iy, iz = (float(value) for value in person.inertia(name))
            links.append(Link(name, person.segment_mass(name), (x, y, z), (ix, iy, iz)))
        else:
            links.append(Link(name))
    return tuple(links)


def _joints(person: Person) -> tuple[Joint, ...]:
    rows = table("joints")
    child = {row["name"]: row["child_segment"] for row in rows} | {"root": "pelvis"}
    joints = []
    for row in rows:
        x, y, z = person.origin(row["name"])
        a, b, c = (float(value) for value in row["axis"].split())
        low, high = (math.radians(limit) for limit in joint_limits(person, row))
        joints.append(
            Joint(row["name"], child[row["parent"]], row["child_segment"], place(x, y, z), (a, b, c), low, high)
        )
    return tuple(joints)


def joint_limits(person: Person, row: Mapping[str, str]) -> tuple[float, float]:
    """Least and greatest angle of a joint, degrees; how far the clavicle rises follows from overhead reach.

    From 45 years on scaled by means of 45 to 69 over 20 to 44 (Soucie et al. 2011), or at most the older mean. Where
    soft parts meet, who is stouter than the median person bends less (table "girth_ranges").
    """
    limits = {"lower": float(row["lower_deg"]), "upper": float(row["upper_deg"])}
    if row["name"].endswith("_clavicle_elevation"):
        limits["upper"] = person.size("elevation")
    # Years from which on the ranges of motion are those of older people: the bands of Soucie et al. (2011).
    is_older = person.age is not None and person.age >= 45.0
    for change in table("age_ranges") if is_older else ():
        if row["name"].endswith(f"_{change['joint']}"):
            end = change["limit"]
            young, old = (change[f"{person.column}_{band}"] for band in ("20_44", "45_69"))
            size = abs(limits[end])
            size = size * float(old) / float(young) if young else min(size, float(old))
            limits[end] = math.copysign(size, limits[end])
    earlier = 0.0
    for change in table("girth_ranges"):
        if row["name"].endswith(f"_{change['joint']}"):
            usual = make_person(person.sex, age=person.age)
            beyond = person.size(change["dimension"]) - usual.size(change["dimension"])
            earlier += float(change["degrees_per_metre"]) * beyond
    return limits["lower"], limits["upper"] - max(earlier, 0.0)


def landmarks(size: Dimensions) -> tuple[Landmark, ...]:
    """Frames to reach with.

    - ``<side>_palm``: on the skin in the middle of the palm; x along the fingers, z out of the palm.
    - ``<side>_index_tip``: end of the index finger; axes as the palm.
    - ``<side>_thumb_tip``: end of the thumb, which lies beside the index finger; axes as the palm.
    - ``<side>_middle_tip``: where the middle finger ends if it is stretched. The piece of the three other fingers ends
      earlier, because they curl where the index finger points.
    - ``<side>_grip``: centre of a rod of 35 mm in the closed hand; axes as the palm.
    - ``<side>_shoulder`` ... ``<side>_ankle``: joint centres, on the segment nearer the root, with its axes.
    - ``<side>_heel``, ``<side>_ball``, ``<side>_sole``, ``<side>_toe_tip``: below the foot; x forward, z up.
    - ``head_top``: on the vertex; ``gaze``: between the eyes, x in the direction of looking.
    """
    marks = [
        Landmark("head_top", "head", place(size.head_x, 0.0, size.head_top)),
        Landmark("gaze", "head", place(size.eye_x, 0.0, size.eye_z)),
    ]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        palm = palm_axes(side)
        below = -size.toe_half_height - size.body.shoes
        length, thick, index, thumb = size.palm_length, size.palm_half_thickness, size.index, size.thumb
        marks += [
            Landmark(f"{side}_palm", f"{side}_hand", place(0.0, -sign * thick, -0.6 * length, palm)),
            Landmark(f"{side}_index_tip", f"{side}_hand", place(index.x, 0.0, -index.tip, palm)),
            Landmark(f"{side}_thumb_tip", f"{side}_hand", place(thumb.x, 0.0, -thumb.tip, palm)),
            Landmark(f"{side}_middle_tip", f"{side}_hand", place(0.0, 0.0, -MIDDLE_TIP * size.hand_length, palm)),
            Landmark(f"{side}_grip", f"{side}_hand", place(0.0, -sign * (thick + 0.0175), -size.grip, palm)),
            Landmark(f"{side}_shoulder", f"{side}_clavicle", place(*size.body.origin(f"{side}_shoulder_flexion"))),
            Landmark(f"{side}_elbow", f"{side}_upper_arm", place(*size.body.origin(f"{side}_elbow_flexion"))),
            Landmark(f"{side}_wrist", f"{side}_forearm", place(*size.body.origin(f"{side}_wrist_flexion"))),
            Landmark(f"{side}_hip", "pelvis", place(*size.body.origin(f"{side}_hip_flexion"))),
            Landmark(f"{side}_knee", f"{side}_thigh", place(*size.body.origin(f"{side}_knee_flexion"))),
            Landmark(f"{side}_ankle", f"{side}_shank", place(*size.body.origin(f"{side}_ankle_dorsiflexion"))),
            Landmark(f"{side}_heel", f"{side}_foot", place(size.heel_x, 0.0, size.sole)),
            Landmark(f"{side}_sole", f"{side}_foot", place(0.5 * (size.heel_x + size.toe_joint_x), 0.0, size.sole)),
            Landmark(f"{side}_ball", f"{side}_foot", place(size.toe_joint_x, 0.0, size.sole)),
            Landmark(f"{side}_toe_tip", f"{side}_toes", place(size.toe_length, 0.0, below)),
        ]
    return tuple(marks)
