"""The person's pieces: capsules and boxes, whose distances are exact and fast; polyhedra; spheres."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, cross, with_values
from wholebody.figures.anthropometry import RELAXED, Dimensions
from wholebody.figures.body_spec import Solid, box, ellipsoid, place, tapered
from wholebody.figures.sizes import TRUNK
from wholebody.figures.tables import table

# Turn a capsule's own axis z into y, and into x.
_ACROSS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_AHEAD = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])

SPREAD = 3  # number of the piece of the thigh that is the flesh that spreads on a seat


def solids(size: Dimensions) -> tuple[Solid, ...]:
    """Return the pieces of a person: spheres, capsules and boxes; with clothing, capsules of trunk and limbs grow."""
    found = (*_trunk(size), *_limbs(size))
    for solid in found if size.body.clothing else ():
        if isinstance(solid.geometry, coal.Capsule) and not solid.segment.endswith(("neck", "head", "hand")):
            solid.geometry.radius += size.body.clothing
    return found


def _trunk(size: Dimensions) -> Iterator[Solid]:
    for part in trunk_slices(size):
        radius, other = sorted((part.half_depth, part.half_breadth))
        axis = _ACROSS if part.half_breadth > part.half_depth else _AHEAD
        capsule = coal.Capsule(radius, max(2.0 * (other - radius), 2e-3))
        yield Solid(part.segment, part.segment, capsule, place(part.x, 0.0, part.z, axis))
    neck = size.body.radius("neck")
    length = size.body.length("neck")
    yield _between("neck", "neck", neck, (0.0, 0.0, 0.1 * length), (0.0, 0.0, 0.9 * length))
    # Radius of the face and jaw in half breadths of the head (estimate).
    skull, face = size.head_half_breadth, 0.75 * size.head_half_breadth
    half = size.head_half_length - skull
    top = size.head_top - skull
    yield _between("head:0", "head", skull, (size.head_x - half, 0.0, top), (size.head_x + half, 0.0, top))
    front = size.eye_x - face
    yield _between("head:1", "head", face, (front, 0.0, size.eye_z), (front, 0.0, size.head_bottom + face))


def _limbs(size: Dimensions) -> Iterator[Solid]:
    for side, sign in (("left", 1.0), ("right", -1.0)):
        yield clavicle(size, side)
        yield from _arm(size, side, sign)
        yield from hand(size, side)
        yield from _leg(size, side, sign)
        yield from foot(size, side)


def _arm(size: Dimensions, side: str, sign: float) -> Iterator[Solid]:
    """Deltoid and upper arm, elbow, forearm, wrist."""
    person, radius = size.body, size.body.radius
    upper, fore = person.length("left_upper_arm"), person.length("left_forearm")
    arm, elbow = RELAXED * radius("upper_arm"), person.size("elbow_back")
    out, top = sign * (person.size("deltoid") - arm), person.size("shoulder_top") - arm
    name = f"{side}_upper_arm"
    yield _between(f"{name}:0", name, arm, (0.0, out, min(top, 0.0)), (0.0, 0.3 * out, -0.45 * upper))
    low, below = 0.88 * arm, person.size("elbow_below")
    yield _between(f"{name}:1", name, low, (0.0, 0.0, -0.55 * upper), (low - elbow, 0.0, low - below - upper))
    thick, wrist = RELAXED * radius("forearm"), radius("wrist")
    up, name = thick - below, f"{side}_forearm"  # the underside of the bent forearm is level with the elbow's
    yield _between(f"{name}:0", name, thick, (up, 0.0, elbow - thick), (up, 0.0, -0.40 * fore))
    yield _between(f"{name}:1", name, wrist, (0.0, 0.0, -0.45 * fore), (0.0, 0.0, wrist - fore))


def _leg(size: Dimensions, side: str, sign: float) -> Iterator[Solid]:
    """Thigh with its hip, knee, calf, ankle. On a seat the underside of the thigh is level with the pelvis'."""
    person, radius = size.body, size.body.radius
    thigh, shank = person.length("left_thigh"), person.length("left_shank")
    high, hip = 0.5 * person.size("thigh_clearance"), size.body.origin("left_hip_flexion")[1]
    front, out = high - person.size("seat"), sign * (0.5 * person.size("hip_breadth") - hip - high)
    name = f"{side}_thigh"

    def inwards(beside: float) -> float:
        """Place of the lower end: nearer to the thigh's axis where the hip is wider than the thigh."""
        return 0.3 * beside if sign * beside > 0.0 else beside

    yield _between(f"{name}:0", name, high, (front, out, -0.12 * thigh), (front, inwards(out), -0.42 * thigh))
    # Flesh that spreads on a seat. It meets things only, so that arms hang as of who stands. It is thinner than the
    # thigh by 2 mm, so that not both lie on the seat, and that it is in the thigh of who stands.
    flesh = high - 0.002
    wide = sign * (0.5 * person.size("hip_breadth_sitting") - hip - flesh)
    start, end = (front, wide, -0.12 * thigh), (front, inwards(wide), -0.42 * thigh)
    yield with_values(_between(f"{name}:{SPREAD}", name, flesh, start, end), flesh=True)
    # Share of the thigh's radius by which flesh gives way where the thigh presses on the belly or the other thigh: 29
    # to 41 mm from the small woman to the large man (estimate). These are tested against the remaining core.
    # Who sits as measured meets neither: there a large belly, and thighs broad for the hips, press them flatter.
    beside = sign * hip + inwards(out)
    free = min(_under_belly(size, (front, beside, 0.3 * thigh)), abs(beside)) - person.clothing
    core = max(min((1.0 - 0.4) * high, free - 1e-3), 0.1 * high)
    yield _between(f"{name}:2", name, core, (front, inwards(out), -0.3 * thigh), (front, inwards(out), -0.42 * thigh))
    knee = person.size("knee")
    # Before the seat's front edge the underside is level with the seat, and rises to that of the knee.
    start = (knee - person.size("seat"), 0.0, -0.66 * thigh)
    yield _between(f"{name}:1", name, knee, start, (0.0, 0.0, -thigh))
    calf, ankle = radius("calf"), radius("ankle")
    name, shin = f"{side}_shank", 0.95 * knee  # the shin is not before the knee
    upper, lower = (min(back * calf, shin - calf) for back in (-0.15, -0.25))
    # 30 mm below the seat's plane, where a seat's front may end, the calf is as far back as the knee, where
    # buttock-popliteal length ends (estimate).
    top = person.size("seat") + 0.03 + math.sqrt(max(calf**2 - (knee + upper) ** 2, 0.0))
    top = min(max(top, 0.1 * shank), 0.4 * shank)
    yield _between(f"{name}:0", name, calf, (upper, 0.0, -top), (lower, 0.0, -0.42 * shank))
    # Between knee and calf the shank is as thick as its bone.
    yield _between(f"{name}:1", name, ankle, (shin - ankle, 0.0, -0.1 * shank), (0.0, 0.0, -0.94 * shank))


def _under_belly(size: Dimensions, near: tuple[float, float, float]) -> float:
    """Distance from the belly of who sits erect to the axis of a thigh's core.

    It leads ahead, and begins at `near` (3,): metres above, beside and ahead of the middle of the hips.
    """
    belly = next(part for part in trunk_slices(size) if part.segment == "upper_lumbar")
    joints = [size.body.origin(f"spine{level}_flexion") for level in (1, 2)]
    radius, long = sorted((belly.half_depth, belly.half_breadth))
    deep, wide = (0.0, long - radius) if belly.half_breadth > belly.half_depth else (long - radius, 0.0)
    above, beside, ahead = near
    apart = (
        max(ahead - belly.x - sum(x for x, _, _ in joints) - deep, 0.0),
        max(abs(beside) - wide, 0.0),
        belly.z + sum(z for _, _, z in joints) - above,
    )
    return math.hypot(*apart) - radius - size.body.clothing


def clavicle(size: Dimensions, side: str) -> Solid:
    """Shoulder girdle: a level capsule from beside the breastbone to the shoulder joint, as high as the acromion."""
    x, y, z = size.body.origin(f"{side}_shoulder_flexion")
    radius = 0.017 * size.stature  # Radius of the shoulder girdle as a fraction of stature (estimate).
    height = z + size.body.size("shoulder_top") - radius
    name = f"{side}_clavicle"
    return _between(name, name, radius, (0.25 * x, 0.25 * y, height), (0.9 * x, 0.9 * y, height))


def hand(size: Dimensions, side: str) -> Iterator[Solid]:
    """Palm, index finger, thumb, and the three others slightly shortened: they curl, and the index finger leads."""
    segment, thick, breadth = f"{side}_hand", size.palm_half_thickness, size.hand_breadth
    palm, index = size.palm_length, size.index
    box = coal.Box(breadth, 2.0 * thick, palm)
    yield Solid(f"{segment}:0", segment, box, place(0.0, 0.0, -0.5 * palm))
    start, end = 0.85 * palm, 0.88 * size.hand_length
    width = 0.45 * breadth
    fingers = coal.Box(width, 1.8 * index.radius, end - start)
    yield Solid(f"{segment}:1", segment, fingers, place(0.08 * breadth - 0.5 * width, 0.0, -0.5 * (start + end)))
    tip, thumb = (index.x, 0.0, -(index.tip - index.radius)), size.thumb
    yield _between(f"{segment}:2", segment, index.radius, (index.x, 0.0, -index.knuckle), tip)
    root = (0.36 * breadth, 0.0, -thumb.knuckle)
    yield _between(f"{segment}:3", segment, thumb.radius, root, (thumb.x, 0.0, -(thumb.tip - thumb.radius)))


def foot(size: Dimensions, side: str) -> Iterator[Solid]:
    """Boxes for the foot and the toes with the shoe's sole, flush below."""
    height, length = -1.0 * size.sole, size.toe_joint_x - size.heel_x
    box = coal.Box(length, 2.0 * size.foot_half_width, height)
    at = place(0.5 * (size.toe_joint_x + size.heel_x), 0.0, 0.5 * size.sole)
    yield Solid(f"{side}_foot", f"{side}_foot", box, at)
    shoe = size.body.shoes
    toes = coal.Box(size.toe_length, 2.0 * size.foot_half_width, 2.0 * size.toe_half_height + shoe)
    yield Solid(f"{side}_toes", f"{side}_toes", toes, place(0.5 * size.toe_length, 0.0, -0.5 * shoe))


class Slice(NamedTuple):
    """A slice of the trunk, in its segment's frame; the centre is at (x, 0, z)."""

    segment: str
    x: float
    z: float
    half_depth: float
    half_breadth: float
    half_height: float


def trunk_slices(size: Dimensions) -> Iterator[Slice]:
    """Return positions and half sizes of the slices from the pelvis to the thorax."""
    person = size.body
    rear, seat, wide = 0.5 * person.size("buttock_depth"), person.size("seat"), 0.5 * person.size("hip_breadth")
    yield Slice("pelvis", rear - person.size("buttock"), rear - seat, rear, wide, rear)
    for part, (z, high) in zip(TRUNK, ((0.5, 1.3), (0.5, 1.1), (0.5, 1.2), (0.42, 0.75)), strict=True):
        half, length = 0.5 * part.share * person.size(part.depth), person.length(part.segment)
        ahead = half - part.back(person.built[0])
        yield Slice(part.segment, ahead, z * length, half, 0.5 * person.size(part.breadth), high * length)


def _between(
    name: str, segment: str, radius: float, start: Array | tuple[float, ...], end: Array | tuple[float, ...]
) -> Solid:
    """Capsule whose caps are centred on two points."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    span = end - start
    length = float(np.linalg.norm(span))
    z = span / length
    side = cross(z, np.array((1.0, 0.0, 0.0) if abs(z[0]) < 0.9 else (0.0, 1.0, 0.0)))
    side /= np.linalg.norm(side)
    rotation = np.column_stack([cross(side, z), side, z])
    center = 0.5 * (start + end)
    return Solid(name, segment, coal.Capsule(radius, length), pin.SE3(rotation, center))


def polyhedra(size: Dimensions) -> tuple[Solid, ...]:
    """Return the pieces of a person, all of them convex polyhedra."""
    trunk = tuple(_trunk_hulls(size))
    names = {solid.name for solid in trunk}
    return (*trunk, *(hull_of(solid) for solid in solids(size) if solid.name not in names))


def _trunk_hulls(size: Dimensions) -> Iterator[Solid]:
    for part in trunk_slices(size):
        cloth = size.body.clothing
        radii = (part.half_depth + cloth, part.half_breadth + cloth, part.half_height + cloth)
        shape, center = ellipsoid(radii, part.segment)
        yield Solid(part.segment, part.segment, shape, place(part.x, 0.0, part.z) * center)
    neck, length = size.body.radius("neck"), size.body.length("neck")
    shape, center = tapered(neck, neck, 0.8 * length, "neck")
    yield Solid("neck", "neck", shape, place(0.0, 0.0, 0.9 * length) * center)


def hull_of(solid: Solid) -> Solid:
    """Return the polyhedron of a box or a capsule, at the same place."""
    if type(solid.geometry).__name__ == "Box":
        x, y, z = (2.0 * float(half) for half in solid.geometry.halfSide)
        shape, center = box((x, y, z), solid.name)
    else:
        radius, half = solid.geometry.radius, solid.geometry.halfLength
        shape, center = tapered(radius, radius, 2.0 * half, solid.name)
        center = place(z=half) * center
    return with_values(solid, geometry=shape, placement=solid.placement * center)


def spheres(size: Dimensions) -> tuple[Solid, ...]:
    """Return the 39 spheres of a person; the feet's are lifted to rest on the soles' plane."""
    person = size.body
    # Mass per stature of the median man and woman of ANSUR II, kg / m, for which the table's radii hold: 84.6 kg by
    # 1.755 m, and 66.8 kg by 1.626 m (table "percentiles").
    build = math.sqrt(person.mass / person.stature / {"M": 48.2, "F": 41.1}[person.column])
    found = []
    for row, name in zip(table("spheres39"), sphere_names().values(), strict=True):
        segment = row["segment"]
        radius = float(row[f"radius_{person.column}"]) * person.stature * build
        x, y, z = (float(row[f"offset_{axis}"]) * person.stature for axis in "xyz")
        if segment.endswith("_foot"):
            z = size.sole + radius
        cloth = 0.0 if segment.endswith(("neck", "head", "hand", "foot")) else person.clothing
        found.append(Solid(name, segment, coal.Sphere(radius + cloth), place(x, y, z)))
    return tuple(found)


def sphere_names() -> dict[str, str]:
    """Name of the piece in the figure ("left_forearm:1") of each sphere's name in the tables ("left_forearm")."""
    count: dict[str, int] = {}
    names = {}
    for row in table("spheres39"):
        k = count[row["segment"]] = count.get(row["segment"], -1) + 1
        names[row["name"]] = f"{row['segment']}:{k}"
    return names
