"""The person in capsules and boxes: the default detail, for which distances are exact and fast."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.figures.body_spec import Solid, place
from wholebody.figures.dimensions import RELAXED, Dimensions

# Turns a capsule's own axis z into y.
_ACROSS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def solids(size: Dimensions) -> tuple[Solid, ...]:
    """Return the pieces of a person: spheres, capsules and boxes."""
    return (*_trunk(size), *_limbs(size))


def _trunk(size: Dimensions) -> Iterator[Solid]:
    for part in trunk_parts(size):
        half = max(part.half_breadth - part.half_depth, 1e-3)
        yield Solid(
            part.segment, part.segment, coal.Capsule(part.half_depth, 2.0 * half), place(part.x, 0.0, part.z, _ACROSS)
        )
    neck = 0.9 * size.body.radius("neck")
    length = size.body.length("neck")
    yield _between("neck", "neck", neck, (0.0, 0.0, 0.1 * length), (0.0, 0.0, 0.9 * length))
    radius = size.head_radius
    yield _between(
        "head",
        "head",
        radius,
        (size.head_x, 0.0, size.head_bottom + radius),
        (size.head_x, 0.0, size.head_top - radius),
    )


def _limbs(size: Dimensions) -> Iterator[Solid]:
    person, radius = size.body, size.body.radius
    for side in ("left", "right"):
        yield clavicle(size, side)
        upper, fore = person.length("left_upper_arm"), person.length("left_forearm")
        arm = RELAXED * radius("upper_arm")
        yield _down(f"{side}_upper_arm:0", f"{side}_upper_arm", arm, 0.05 * upper, 0.45 * upper)
        yield _down(f"{side}_upper_arm:1", f"{side}_upper_arm", 0.9 * arm, 0.55 * upper, upper)
        elbow, wrist = 0.9 * RELAXED * radius("forearm"), radius("wrist")
        yield _down(f"{side}_forearm", f"{side}_forearm", 0.5 * (elbow + wrist), 0.05 * fore, 0.95 * fore)
        yield from hand(size, side)

        thigh, shank = person.length("left_thigh"), person.length("left_shank")
        high, low = radius("thigh"), radius("thigh_low")
        yield _down(f"{side}_thigh:0", f"{side}_thigh", 0.92 * high, 0.12 * thigh, 0.4 * thigh)
        yield _down(f"{side}_thigh:1", f"{side}_thigh", low, 0.6 * thigh, 0.98 * thigh)
        calf = 0.7 * radius("calf") + 0.3 * radius("ankle")
        yield _down(f"{side}_shank", f"{side}_shank", calf, 0.08 * shank, 0.92 * shank)
        yield from foot(size, side)


def clavicle(size: Dimensions, side: str) -> Solid:
    """Shoulder girdle: a capsule from beside the breastbone to the shoulder joint."""
    shoulder = np.array(size.joint(f"{side}_shoulder_flexion"))
    return _between(f"{side}_clavicle", f"{side}_clavicle", 0.028 * size.stature, 0.25 * shoulder, 0.9 * shoulder)


def hand(size: Dimensions, side: str) -> Iterator[Solid]:
    """Palm, index finger, and the three others slightly shortened: at rest they curl, and the index leads a reach."""
    segment, thick, breadth = f"{side}_hand", size.palm_half_thickness, size.hand_breadth
    palm, index = size.palm_length, size.index
    box = coal.Box(breadth, 2.0 * thick, palm)
    yield Solid(f"{segment}:0", segment, box, place(0.0, 0.0, -0.5 * palm))
    start, end = 0.85 * palm, 0.88 * size.hand_length
    width = 0.45 * breadth
    fingers = coal.Box(width, 1.8 * index.radius, end - start)
    yield Solid(f"{segment}:1", segment, fingers, place(0.08 * breadth - 0.5 * width, 0.0, -0.5 * (start + end)))
    radius = index.radius
    yield _between(
        f"{segment}:2", segment, radius, (index.x, 0.0, -index.knuckle), (index.x, 0.0, -(index.tip - radius))
    )


def foot(size: Dimensions, side: str) -> Iterator[Solid]:
    """Boxes for the foot and the toes, flush on the sole."""
    height, length = -1.0 * size.sole, size.toe_joint_x - size.heel_x
    box = coal.Box(length, 2.0 * size.foot_half_width, height)
    yield Solid(
        f"{side}_foot", f"{side}_foot", box, place(0.5 * (size.toe_joint_x + size.heel_x), 0.0, 0.5 * size.sole)
    )
    toes = coal.Box(size.toe_length, 2.0 * size.foot_half_width, 2.0 * size.toe_half_height)
    yield Solid(f"{side}_toes", f"{side}_toes", toes, place(0.5 * size.toe_length, 0.0, 0.0))


class TrunkPart(NamedTuple):
    """A slice of the trunk, in its segment's frame; the centre is at (x, 0, z)."""

    segment: str
    x: float
    z: float
    half_depth: float
    half_breadth: float
    half_height: float


def trunk_parts(size: Dimensions) -> tuple[TrunkPart, ...]:
    """Return positions and half sizes of the parts from the pelvis to the thorax."""
    radius, height, length = size.body.radius, size.stature, size.body.length
    waist_x, waist_y, chest_x, chest_y = radius("waist_x"), radius("waist_y"), radius("chest_x"), radius("chest_y")
    low, up, ribs, chest = (length(name) for name in ("lower_lumbar", "upper_lumbar", "lower_thorax", "thorax"))
    return (
        TrunkPart(
            "pelvis", -0.004 * height, 0.004 * height, 0.95 * radius("hip_x"), 0.97 * radius("hip_y"), 0.06 * height
        ),
        TrunkPart("lower_lumbar", 0.010 * height, 0.5 * low, 0.95 * waist_x, 0.95 * waist_y, 1.3 * low),
        TrunkPart("upper_lumbar", 0.004 * height, 0.5 * up, 0.95 * waist_x, 0.93 * waist_y, 1.1 * up),
        TrunkPart("lower_thorax", 0.014 * height, 0.5 * ribs, 0.95 * chest_x, 0.95 * chest_y, 1.2 * ribs),
        TrunkPart("thorax", 0.012 * height, 0.42 * chest, 0.80 * chest_x, 0.95 * chest_y, 0.75 * chest),
    )


def _down(name: str, segment: str, radius: float, start: float, end: float) -> Solid:
    return _between(name, segment, radius, (0.0, 0.0, -start), (0.0, 0.0, -end))


def _between(
    name: str, segment: str, radius: float, start: Array | tuple[float, ...], end: Array | tuple[float, ...]
) -> Solid:
    """Capsule whose caps are centred on two points."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    span = end - start
    length = float(np.linalg.norm(span))
    z = span / length
    side = np.cross(z, [1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.cross(z, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    rotation = np.column_stack([np.cross(side, z), side, z])
    center = 0.5 * (start + end)
    return Solid(name, segment, coal.Capsule(radius, length), pin.SE3(rotation, center))
