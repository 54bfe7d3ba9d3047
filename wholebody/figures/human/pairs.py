"""Pairs of pieces of the person that can touch: all except neighbours, which overlap at their joint."""

from __future__ import annotations

from itertools import pairwise

from wholebody.figures.body_spec import Solid
from wholebody.figures.description import ExcludedPair, chosen_pairs
from wholebody.figures.hand import finger_pair, is_finger
from wholebody.figures.human.capsules import SPREAD
from wholebody.figures.human.details import sphere_names
from wholebody.figures.tables import table

TRUNK = ("pelvis", "lower_lumbar", "upper_lumbar", "lower_thorax", "thorax", "neck", "head")

Pairs = tuple[tuple[tuple[str, str], ...], tuple[ExcludedPair, ...]]
"""Pairs that are tested, and those that are not."""

_LIMBS = (("clavicle", "upper_arm", "forearm", "hand"), ("thigh", "shank", "foot", "toes"))
_NEXT = {frozenset(pair) for limb in _LIMBS for pair in pairwise(limb)} | {frozenset(("shank", "toes"))}


def body_pairs(solids: tuple[Solid, ...]) -> Pairs:
    """Return tested and excluded pairs of the capsules' and hulls' pieces."""
    return chosen_pairs(solids, lambda a, b: _reason(a, b) or _reason(b, a))


def sphere_pairs(solids: tuple[Solid, ...]) -> Pairs:
    """Return tested and excluded pairs of the 39 spheres: across the five groups only, without the named exclusions."""
    names = sphere_names()
    group = {names[row["name"]]: row["group"] for row in table("spheres39")}
    named = {frozenset((names[row["a"]], names[row["b"]])) for row in table("sphere_exclusions")}

    def reason(a: Solid, b: Solid) -> str | None:
        if group[a.name] == group[b.name]:
            return "same group of spheres"
        return "limbs meet the trunk" if frozenset((a.name, b.name)) in named else None

    return chosen_pairs(solids, reason)


def _reason(a: Solid, b: Solid) -> str | None:
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


def _resting(a: Solid, b: Solid, part_a: str, part_b: str) -> str | None:
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
