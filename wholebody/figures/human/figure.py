"""The person as a figure: groups, chains, cones, postures, pairs; and the avatar, a person with a rigid torso."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, lru_cache, partial
from itertools import pairwise
from typing import Any

import numpy as np

from wholebody.base.arrays import with_values
from wholebody.figures.anthropometry import Person, make_person
from wholebody.figures.body_spec import BodySpec, geometry_of, model_of
from wholebody.figures.description import Chain, Description, JointCone, Pairs, PieceName, chosen_pairs
from wholebody.figures.figure import Figure
from wholebody.figures.hand import FINGERS, finger_angles, finger_degrees, finger_effort, finger_pair, is_finger
from wholebody.figures.human.details import SPREAD, sphere_names
from wholebody.figures.human.spec import human_solids, human_spec
from wholebody.figures.motion_ranges import ReachCone, human_ranges
from wholebody.figures.postures import stand
from wholebody.figures.self_pairs import drop_rigid_pairs
from wholebody.figures.tables import named_angles, table

TRUNK = ("pelvis", "lower_lumbar", "upper_lumbar", "lower_thorax", "thorax", "neck", "head")
_LIMBS = (("clavicle", "upper_arm", "forearm", "hand"), ("thigh", "shank", "foot", "toes"))
_NEXT = {frozenset(pair) for limb in _LIMBS for pair in pairwise(limb)} | {frozenset(("shank", "toes"))}


def human_figure(detail: str = "capsules", hands: str = "rigid", **who: Any) -> Figure:
    """Return the person; arguments and errors as for `wholebody.load`, and as for `make_person`."""
    person = make_person(**who)
    return figure_of(human_spec(person, detail, hands), detail, person.sex)


def figure_of(spec: BodySpec, detail: str, sex: str | None = None) -> Figure:
    """Return the figure of a human specification, with the ranges of motion and the effort of a person of a sex."""
    model = model_of(spec)
    pieces = tuple(PieceName(solid.name, solid.segment) for solid in spec.solids)
    tested, excluded = (sphere_pairs if detail == "spheres" else body_pairs)(pieces)
    geometry = geometry_of(model, spec.solids, tested)
    rigid = drop_rigid_pairs(geometry)
    joints = {joint.name for joint in spec.joints if joint.axis is not None}
    groups = human_groups(joints)
    segments = tuple(link.name for link in spec.links if link.mass)
    fingers = [name for name in finger_angles("relaxed") if name in joints]
    held = finger_degrees({}) if fingers else {}
    # Weight of the root in a person's effort, beside 1 of an arm: of its position [rad^2/m^2] and of its rotation.
    # ESTIMATE: without it a person bows and walks away before an arm is lifted.
    description = Description(
        groups=groups,
        chains=human_chains(groups),
        frames=tuple(mark.name for mark in spec.landmarks),
        segments=segments,
        postures={name: partial(stand, degrees={**held, **own}) for name, own in named_angles("human").items()},
        cones=human_cones(),
        collision_groups={segment: collision_group(segment) for segment in segments},
        effort={row["name"]: float(row["effort_weight"]) for row in table("joints")}
        | {name: finger_effort(name) for name in fingers},
        excluded=(*excluded, *rigid),
        person=spec.person,
        notes=() if spec.person is None else spec.person.notes,
        outer=partial(human_solids, spec.person, "hulls") if detail == "spheres" and spec.person else None,
        ranges={} if sex is None else human_ranges(sex, joints),
        root_effort=(0.0, 0.0) if sex is None else (5.0, 2.0),
    )
    return Figure(spec.name, model, geometry, detail, description)


def human_groups(joints: set[str]) -> dict[str, tuple[str, ...]]:
    """Return the joint groups; the upper body is spine and arms (requirement of self-avoidance), not the neck."""
    names = [row["name"] for row in table("joints") if row["name"] in joints]
    groups = {part: tuple(name for name in names if name.startswith(part)) for part in ("spine", "neck")}
    for side in ("left", "right"):
        for limb, parts in (
            ("arm", ("clavicle", "shoulder", "elbow", "wrist")),
            ("leg", ("hip", "knee", "ankle", "toe")),
        ):
            starts = tuple(f"{side}_{part}_" for part in parts)
            groups[f"{side}_{limb}"] = tuple(name for name in names if name.startswith(starts))
        own = [name for name in finger_angles("relaxed", side) if name in joints]
        for finger in FINGERS:
            groups[f"{side}_{finger}"] = tuple(name for name in own if name.startswith(f"{side}_{finger}_"))
        groups[f"{side}_fingers"] = tuple(name for finger in FINGERS for name in groups[f"{side}_{finger}"])
    groups["arms"] = groups["left_arm"] + groups["right_arm"]
    groups["legs"] = groups["left_leg"] + groups["right_leg"]
    groups["upper_body"] = groups["spine"] + groups["arms"]
    groups["lower_body"] = groups["legs"]
    return {name: members for name, members in groups.items() if members}


def human_chains(groups: Mapping[str, tuple[str, ...]]) -> dict[str, Chain]:
    """Return the limbs from the root outwards, with their tips."""
    tips = {"spine": "thorax", "neck": "head_top"}
    for limb, tip in (("arm", "index_tip"), ("leg", "toe_tip")):
        tips |= {f"{side}_{limb}": f"{side}_{tip}" for side in ("left", "right")}
    tips |= {f"{side}_{finger}": f"{side}_{finger}_tip" for side in ("left", "right") for finger in FINGERS}
    return {name: Chain(groups[name], tip) for name, tip in tips.items() if name in groups}


@cache
def human_cones() -> Mapping[str, JointCone]:
    """Return the reach cones of shoulders (humerus in the thorax) and hips (femur in the pelvis)."""
    down = np.array([0.0, 0.0, -1.0])
    cones = {}
    for joint, reference, limb in (("shoulder", "thorax", "upper_arm"), ("hip", "pelvis", "thigh")):
        rows = [row for row in table("reach_cones") if row["joint"] == joint]
        point = {row["vertex"]: [float(row[axis]) for axis in "xyz"] for row in rows}
        visible = point.pop("visible_point")
        right = ReachCone(list(point.values()), visible)
        cones[f"right_{joint}"] = JointCone(right, reference, f"right_{limb}", down)
        cones[f"left_{joint}"] = JointCone(right.mirrored(), reference, f"left_{limb}", down)
    return cones


RIGID = ("spine", "neck2", "left_clavicle", "right_clavicle")
"""Beginnings of the names of the joints that the avatar does not have."""


def avatar_spec(person: Person | None = None, detail: str = "capsules") -> BodySpec:
    """Return the specification of an avatar; arguments as for the person."""
    person = person or make_person()
    whole = human_spec(person, detail)
    joints = tuple(with_values(joint, axis=None) if joint.name.startswith(RIGID) else joint for joint in whole.joints)
    return replace(whole, name="avatar", joints=joints)


def avatar_figure(detail: str = "capsules", **who: Any) -> Figure:
    """Return the avatar of Schmidl & Lin: the person on a rigid torso; arguments as for the person."""
    return figure_of(avatar_spec(make_person(**who), detail), detail)


@lru_cache(maxsize=8)  # people differ in their sizes alone
def body_pairs(pieces: tuple[PieceName, ...]) -> Pairs:
    """Return tested and excluded pairs of the capsules' and hulls' pieces."""
    return chosen_pairs(pieces, lambda a, b: _reason(a, b) or _reason(b, a))


def sphere_pairs(pieces: tuple[PieceName, ...]) -> Pairs:
    """Return tested and excluded pairs of the 39 spheres: across the five groups only, without the named exclusions."""
    names = sphere_names()
    group = {names[row["name"]]: row["group"] for row in table("spheres39")}
    named = {frozenset((names[row["a"]], names[row["b"]])) for row in table("sphere_exclusions")}

    def reason(a: PieceName, b: PieceName) -> str | None:
        if group[a.name] == group[b.name]:
            return "same group of spheres"
        return "limbs meet the trunk" if frozenset((a.name, b.name)) in named else None

    return chosen_pairs(pieces, reason)


def _reason(a: PieceName, b: PieceName) -> str | None:
    """Why the pair (a, b), in this order, is not tested; None if it is."""
    if a.segment == b.segment:
        return "same segment"
    if a.name.endswith(f"_thigh:{SPREAD}"):
        return "flesh that spreads on a seat meets things only"
    if a.segment in TRUNK and b.segment in TRUNK:
        return "parts of the trunk and head meet along the spine"
    side_a, _, part_a = a.segment.partition("_")
    side_b, _, part_b = b.segment.partition("_")
    if side_a == side_b and frozenset((part_a, part_b)) in _NEXT:
        return "neighbours that overlap at their joint"
    if side_a == side_b and (is_finger(part_a) or is_finger(part_b)):
        return finger_pair(part_a, part_b)
    return _resting(a, b, part_a, part_b)


def _resting(a: PieceName, b: PieceName, part_a: str, part_b: str) -> str | None:
    """Why soft parts of two segments overlap, or cannot meet; None if they can touch."""
    on_torso = a.segment in TRUNK and a.segment != "head"
    resting = {
        "the shoulder lies on the ribs": (part_b == "clavicle" and (part_a == "clavicle" or on_torso))
        or (b.name.endswith("_upper_arm:0") and on_torso),
        "the thigh presses on pelvis and belly": (part_b == "thigh" and a.segment == "pelvis")
        or (b.name.endswith("_thigh:0") and a.segment in ("lower_lumbar", "upper_lumbar")),
        "the core of the thigh is there for the belly and the other thigh": b.name.endswith("_thigh:2")
        and not (a.segment == "upper_lumbar" or a.name.endswith(("_thigh:1", "_thigh:2"))),
        "feet do not reach head and shoulders": (part_b in ("foot", "toes") or b.name.endswith("_shank:1"))
        and a.segment in ("thorax", "neck", "head", "left_clavicle", "right_clavicle"),
        "the upper thighs press on each other; their cores are tested": a.name.endswith("_thigh:0")
        and b.name.endswith(("_thigh:0", "_thigh:1")),
    }
    return next((reason for reason, rests in resting.items() if rests), None)


def collision_group(segment: str) -> str:
    """Group of a segment for self-collision: "torso_head", "left_arm", "right_arm", "left_leg" or "right_leg"."""
    side, _, part = segment.partition("_")
    if side in ("left", "right") and part != "clavicle":
        return f"{side}_{'arm' if part in ('upper_arm', 'forearm', 'hand') or is_finger(part) else 'leg'}"
    return "torso_head"
