"""The hand: fifteen ellipsoids, each a polyhedron of a hundred triangles, on a free root at the wrist (Schmidl & Lin).

The hand's frame is that of the person's hand: fingers along -z, thumb towards +x, palm towards -y on the left and +y on
the right. The metacarpal of the thumb moves within the palm's ellipsoid and is no part of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import choice, known
from wholebody.base.errors import InputError
from wholebody.figures.anthropometry import FINGER_BASES, Dimensions, Person, describe, keyed_hand, make_person
from wholebody.figures.body_spec import BodySpec, Joint, Landmark, Link, Solid, ellipsoid, geometry_of, model_of, place
from wholebody.figures.description import Articulated, Chain, Description, PieceName, chosen_pairs
from wholebody.figures.figure import Figure
from wholebody.figures.postures import lowest
from wholebody.figures.tables import keyed, named_angles

MESH = "meshes/ellipsoid.obj"  # the unit polyhedron that the URDF scales to each part

FINGERS = {"thumb": ("pp", "dp"), **dict.fromkeys(("index", "middle", "ring", "little"), ("pp", "mp", "dp"))}
SIDES = ("left", "right")
PARTS = {"mc": "metacarpal", "pp": "proximal", "mp": "middle", "dp": "distal"}
"""Key of a part of a finger in the table "hand" to the end of its segment's name."""

_JOINT = {f"{kind}_flex": f"{kind}_flexion" for kind in ("cmc", "mcp", "pip", "dip", "ip")}
_JOINT |= {f"{kind}_abd": f"{kind}_abduction" for kind in ("cmc", "mcp")}


def hand_spec(side: str = "right", person: Person | None = None) -> BodySpec:
    """Return the specification of a hand, "left" or "right", of a person, or of the median man."""
    if side not in ("left", "right"):
        raise InputError(f"side is {side!r}; give 'left' or 'right'")
    person = person or make_person()
    size = Dimensions(person)
    parts = tuple(finger_parts(size, side))
    joints = finger_joints(side, parts)
    keys = {f"{side}_hand": "palm", **{part.segment: part.key for part in parts if part.key != "thumb_mc"}}
    return BodySpec(
        name=f"{side}_hand",
        title=f"{side} hand; {describe(person)}",
        links=hand_links(size, side, parts, joints),
        joints=joints,
        landmarks=(_palm_mark(size, side), *fingertips(size, side)),
        solids=tuple(
            Solid(segment, segment, *_polyhedron(size, key), (MESH, part_radii(size, key)))
            for segment, key in keys.items()
        ),
        person=person,
    )


def hand_figure(
    side: str = "right",
    sex: str = "male",
    stature: float | None = None,
    mass: float | None = None,
    percentile: float | None = None,
) -> Figure:
    """Return a hand with a free root at the wrist; arguments as for `hand_spec` and the person."""
    return hand_figure_of(make_person(sex, stature, mass, percentile), side)


def hand_figure_of(person: Person, side: str) -> Figure:
    """Return the hand of a person; the side as for `hand_spec`."""
    spec = hand_spec(side, person)
    model = model_of(spec)
    pieces = (PieceName(solid.name, solid.segment.partition("_")[2]) for solid in spec.solids)
    tested, excluded = chosen_pairs(pieces, lambda a, b: finger_pair(a.segment, b.segment))
    names = tuple(joint.name for joint in spec.joints)
    groups = {finger: tuple(name for name in names if name.startswith(f"{side}_{finger}_")) for finger in FINGERS}
    description = Description(
        groups={**groups, "fingers": names},
        chains={finger: Chain(groups[finger], f"{side}_{finger}_tip") for finger in FINGERS},
        frames=tuple(mark.name for mark in spec.landmarks),
        segments=tuple(solid.segment for solid in spec.solids),
        postures={name: partial(_posture, side=side, degrees=own) for name, own in named_angles("hand").items()},
        excluded=excluded,
        person=spec.person,
    )
    return Figure(spec.name, model, geometry_of(model, spec.solids, tested), "hulls", description)


def palm_axes(side: str) -> Array:
    """Axes (3, 3) of a palm in the hand: along the fingers, towards the thumb, out of the palm."""
    sign = 1.0 if side == "left" else -1.0
    return np.column_stack([[0.0, 0.0, -1.0], [sign, 0.0, 0.0], [0.0, -sign, 0.0]])


def _palm_mark(size: Dimensions, side: str) -> Landmark:
    out = size.palm_half_thickness if side == "right" else -size.palm_half_thickness
    half = 0.5 * keyed_hand("palm", "length") * size.hand_length
    return Landmark(f"{side}_palm", f"{side}_hand", place(0.0, out, -half, palm_axes(side)))


def part_radii(size: Dimensions, part: str) -> tuple[float, float, float]:
    """Semi-axes of a part of the table "hand", metres."""
    return (
        keyed_hand(part, "width") * size.hand_breadth,
        keyed_hand(part, "depth") * size.hand_breadth,
        0.5 * keyed_hand(part, "length") * size.hand_length,
    )


def part_radius(size: Dimensions, part: str) -> float:
    """Mean radius of a part of the table "hand" across its length, metres."""
    return 0.5 * (keyed_hand(part, "width") + keyed_hand(part, "depth")) * size.hand_breadth


def _polyhedron(size: Dimensions, part: str) -> tuple[object, pin.SE3]:
    radii = part_radii(size, part)
    shape, center = ellipsoid(radii, part)
    return shape, place(z=-radii[2]) * center


class FingerPart(NamedTuple):
    """One part of a finger."""

    finger: str
    key: str  # of its row in the table "hand"
    segment: str
    parent: str  # the segment before it
    origin: pin.SE3  # of its first joint in that


def finger_parts(size: Dimensions, side: str) -> Iterator[FingerPart]:
    """The parts of the fingers of a hand; that of the thumb's metacarpal too if it moves."""
    for finger, names in FINGERS.items():
        parent, origin = f"{side}_hand", pin.SE3(np.eye(3), _knuckle(size, finger))
        if finger == "thumb":  # it rests where the table has its abduction
            rest = math.radians(finger_degrees({})["thumb_cmc_abduction"])
            names, origin = ("mc", *names), _metacarpal(size, side) * place(rotation=pin.utils.rotate("y", rest))
        for name in names:
            key, segment = f"{finger}_{name}", f"{side}_{finger}_{PARTS[name]}"
            yield FingerPart(finger, key, segment, parent, origin)
            parent, origin = segment, place(z=-keyed_hand(key, "length") * size.hand_length)


def fingertips(size: Dimensions, side: str) -> Iterator[Landmark]:
    """The ends of the fingers, with the axes of the palm."""
    for finger in FINGERS:
        end = place(z=-keyed_hand(f"{finger}_dp", "length") * size.hand_length, rotation=palm_axes(side))
        yield Landmark(f"{side}_{finger}_tip", f"{side}_{finger}_distal", end)


def _metacarpal(size: Dimensions, side: str) -> pin.SE3:
    """Placement of the resting thumb's metacarpal in the hand, at its joint with the wrist's bones."""
    sign = 1.0 if side == "left" else -1.0
    # Resting direction of the thumb's metacarpal: from the fingers towards the thumb's side (estimate), and out of the
    # palm (CMC abduction of the table).
    radial, palmar = math.radians(40.0), math.radians(30.0)
    along = np.array([math.sin(radial), -sign * math.sin(palmar), -math.cos(radial)])
    along /= np.linalg.norm(along)
    bend = np.array([-0.8, -sign * 0.6, 0.0])  # the thumb bends across the palm, towards the little finger
    bend -= along * (along @ bend)
    y = -sign * bend / np.linalg.norm(bend)
    return pin.SE3(np.column_stack([np.cross(y, -along), y, -along]), _knuckle(size, "thumb"))


def _knuckle(size: Dimensions, finger: str) -> Array:
    lateral, distal = FINGER_BASES[finger]
    return np.array([lateral * size.hand_breadth, 0.0, -distal * size.hand_length])


def finger_joints(side: str, parts: Iterable[FingerPart]) -> tuple[Joint, ...]:
    """The joints of the parts of fingers."""
    sign, found = 1.0 if side == "left" else -1.0, list[Joint]()
    for finger, key, segment, parent, origin in parts:
        row = keyed("hand")[key]
        kinds = [kind.strip() for kind in row["joints"].split(",")]
        ranges = [limits.strip().split("..") for limits in row["limits_deg"].split(";")]
        for kind, (low, high) in zip(kinds, ranges, strict=True):
            # Flexion bends towards the palm; abduction leads away from the middle finger, that finger's own to the
            # thumb, and the thumb's out of the palm.
            away = 1.0 if finger in ("ring", "little") else -1.0
            axis = (-sign, 0.0, 0.0) if kind.endswith("flex") else (0.0, away, 0.0)
            child = segment if kind == kinds[-1] else f"{segment}_v1"
            limits = math.radians(float(low)), math.radians(float(high))
            found.append(Joint(f"{side}_{finger}_{_JOINT[kind]}", parent, child, origin, axis, *limits))
            parent, origin = child, pin.SE3.Identity()
    return tuple(found)


def hand_links(size: Dimensions, side: str, parts: Iterable[FingerPart], joints: Iterable[Joint]) -> tuple[Link, ...]:
    """Palm and parts as solid ellipsoids along -z, which share the hand's mass by volume; links between two joints."""
    radii = {f"{side}_hand": part_radii(size, "palm"), **{part.segment: part_radii(size, part.key) for part in parts}}
    volumes = {segment: math.prod(axes) for segment, axes in radii.items()}
    total, found = size.body.segment_mass("left_hand"), list[Link]()
    for segment, (a, b, c) in radii.items():
        mass = total * volumes[segment] / sum(volumes.values())
        inertia = (mass * (b * b + c * c) / 5.0, mass * (a * a + c * c) / 5.0, mass * (a * a + b * b) / 5.0)
        found.append(Link(segment, mass, (0.0, 0.0, -c), inertia))
    return (*found, *(Link(joint.child) for joint in joints if joint.child not in radii))


def is_finger(segment: str) -> bool:
    """Whether a segment without its side, such as "index_middle", is of a finger."""
    return segment.partition("_")[0] in FINGERS


def finger_pair(a: str, b: str) -> str | None:
    """Why two segments of one hand, named without their side, are not tested against each other; None if they are."""
    order = list(FINGERS)
    first, second = sorted((a, b), key=lambda name: order.index(name.partition("_")[0]) if is_finger(name) else -1)
    finger, _, part = second.partition("_")
    if finger not in FINGERS:
        return None
    if first in ("hand", "forearm"):
        near = part == "metacarpal" or (part == "proximal" and first == "hand")
        return "neighbours that overlap at their joint" if near else None
    other, _, _ = first.partition("_")
    if other not in FINGERS:
        return None
    if other == finger:
        return "neighbours that overlap at their joint"
    beside = abs(order.index(other) - order.index(finger)) == 1 and "thumb" not in (other, finger)
    return "fingers rest side by side" if beside else None


def _posture(figure: Articulated, side: str, degrees: dict[str, float]) -> Array:
    """Wrist above the origin, palm down, fingers forward, lowest part on z = 0."""
    values = {
        f"{side}_{joint}": math.radians(angle)
        for joint, angle in finger_degrees(degrees).items()
        if f"{side}_{joint}" in figure.joints
    }
    q: Array = figure.with_joints(pin.neutral(figure.model), values)
    if figure.root == "free":
        down = np.column_stack([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
        q[3:7] = pin.Quaternion(down @ palm_axes(side).T).coeffs()
        q[2] = -lowest(figure, q)
    return q


def finger_degrees(degrees: Mapping[str, float]) -> dict[str, float]:
    """The angle of every joint of the fingers, without a side, of a row of `named_angles`; the others are relaxed."""
    found = {}
    for finger, parts in FINGERS.items():
        for part in ("mc", *parts) if finger == "thumb" else parts:
            row = keyed("hand")[f"{finger}_{part}"]
            for kind, neutral in zip(row["joints"].split(","), row["neutral_deg"].split(";"), strict=True):
                joint = _JOINT[kind.strip()]
                found[f"{finger}_{joint}"] = degrees.get(f"{finger}_{joint}", degrees.get(joint, float(neutral)))
    return found


def finger_effort(joint: str) -> float:
    """Weight of a finger's joint in effort, beside 1 of an elbow: half of what fits typing, so grasps are found."""
    if "thumb" in joint:
        return 0.2
    return 0.8 if joint.endswith("flexion") else 0.4


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


def opened_for_a_bar(hands: Sequence[str]) -> Iterator[dict[str, float]]:
    """Angles [rad] of the fingers of "right" or "anna/right" to take a bar: no thumb, a fist's, a hook's."""
    # Fingers that first bend at their roots touch the bar with their first phalanges before the palm does.
    own = [hand.rpartition("/") for hand in hands]
    hook, fist = ({figure + slash + name: angle for figure, slash, side in own
                   for name, angle in finger_angles(shape, side).items()} for shape in ("hook", "fist"))  # fmt: skip
    fingers = {name: angle for name, angle in hook.items() if "_thumb_" not in name}
    if fingers:
        yield fingers
        yield fingers | {name: angle for name, angle in fist.items() if "_thumb_" in name}
        yield hook
