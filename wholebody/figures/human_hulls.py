"""The person in convex polyhedra: tapered limbs and elliptic trunk, the closest of the three details to a body."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pinocchio as pin

from wholebody.figures import hulls, human_capsules
from wholebody.figures.body_spec import Solid, place
from wholebody.figures.dimensions import RELAXED, Dimensions


def solids(size: Dimensions) -> tuple[Solid, ...]:
    """Return the pieces of a person, all of them convex polyhedra."""
    return (*_trunk(size), *_limbs(size))


def _trunk(size: Dimensions) -> Iterator[Solid]:
    for part in human_capsules.trunk_parts(size):
        radii = (part.half_depth, part.half_breadth, part.half_height)
        yield _solid(part.segment, hulls.ellipsoid(radii, part.segment), part.x, part.z)
    neck, length = 0.9 * size.body.radius("neck"), size.body.length("neck")
    yield _solid("neck", hulls.tapered(neck, neck, 0.8 * length, "neck"), 0.0, 0.9 * length)
    half_height = 0.5 * (size.head_top - size.head_bottom)
    radii = (size.head_radius, size.head_half_breadth, half_height)
    yield _solid("head", hulls.ellipsoid(radii, "head"), size.head_x, size.head_top - half_height)


def _limbs(size: Dimensions) -> Iterator[Solid]:
    person, radius = size.body, size.body.radius
    upper, fore = person.length("left_upper_arm"), person.length("left_forearm")
    thigh, shank = person.length("left_thigh"), person.length("left_shank")
    arm, elbow, wrist = RELAXED * radius("upper_arm"), 0.9 * RELAXED * radius("forearm"), radius("wrist")
    high, low, calf, ankle = radius("thigh"), radius("thigh_low"), radius("calf"), radius("ankle")
    for side in ("left", "right"):
        yield _hull_of(human_capsules.clavicle(size, side))
        yield _down(f"{side}_upper_arm:0", arm, arm, 0.05 * upper, 0.45 * upper)
        yield _down(f"{side}_upper_arm:1", 0.95 * arm, 0.8 * arm, 0.55 * upper, upper)
        yield _down(f"{side}_forearm", elbow, wrist, 0.05 * fore, 0.95 * fore)
        yield from (_hull_of(solid) for solid in human_capsules.hand(size, side))
        yield _down(f"{side}_thigh:0", 0.92 * high, 0.85 * high, 0.12 * thigh, 0.4 * thigh)
        yield _down(f"{side}_thigh:1", 1.05 * low, 0.95 * low, 0.6 * thigh, 0.98 * thigh)
        yield _down(f"{side}_shank", calf, ankle, 0.15 * shank, 0.95 * shank)
        yield from (_hull_of(solid) for solid in human_capsules.foot(size, side))


def _down(name: str, first: float, last: float, start: float, end: float) -> Solid:
    return _solid(name, hulls.tapered(first, last, end - start, name), 0.0, -start)


def _solid(name: str, hull: tuple[Any, pin.SE3], x: float, z: float) -> Solid:
    shape, center = hull
    return Solid(name, name.partition(":")[0], shape, place(x, 0.0, z) * center)


def _hull_of(solid: Solid) -> Solid:
    """Polyhedron of a box or a capsule, at the same place."""
    if type(solid.geometry).__name__ == "Box":
        x, y, z = (2.0 * float(half) for half in solid.geometry.halfSide)
        shape, center = hulls.box((x, y, z), solid.name)
    else:
        radius, half = solid.geometry.radius, solid.geometry.halfLength
        shape, center = hulls.tapered(radius, radius, 2.0 * half, solid.name)
        center = place(z=half) * center
    return solid._replace(geometry=shape, placement=solid.placement * center)
