"""The person in convex polyhedra: tapered limbs and elliptic trunk, the closest of the three details to a body."""

from __future__ import annotations

from collections.abc import Iterator

from wholebody.figures import human_capsules, hulls
from wholebody.figures.blueprint import Solid, place
from wholebody.figures.measures import RELAXED, Measures


def solids(size: Measures) -> tuple[Solid, ...]:
    """Return the pieces of a person, all of them convex polyhedra."""
    return (*_trunk(size), *_limbs(size))


def _trunk(size: Measures) -> Iterator[Solid]:
    for part in human_capsules.trunk_parts(size):
        radii = (part.half_depth, part.half_breadth, part.half_height)
        yield Solid(part.segment, part.segment, hulls.ellipsoid(radii), place(part.x, 0.0, part.z))
    neck = 0.9 * size.body.radius("neck")
    shape, middle = hulls.tapered(neck, neck, 0.8 * size.body.length("neck"))
    yield Solid("neck", "neck", shape, place(0.0, 0.0, 0.9 * size.body.length("neck") + middle))
    half_height = 0.5 * (size.head_top - size.head_bottom)
    radii = (size.head_radius, size.head_half_breadth, half_height)
    yield Solid("head", "head", hulls.ellipsoid(radii), place(size.head_x, 0.0, size.head_top - half_height))


def _limbs(size: Measures) -> Iterator[Solid]:
    person, radius = size.body, size.body.radius
    for side in ("left", "right"):
        yield _hull_of(human_capsules.clavicle(size, side))
        upper, fore = person.length("left_upper_arm"), person.length("left_forearm")
        arm = RELAXED * radius("upper_arm")
        elbow, wrist = 0.9 * RELAXED * radius("forearm"), radius("wrist")
        yield _down(f"{side}_upper_arm:0", f"{side}_upper_arm", arm, arm, 0.05 * upper, 0.45 * upper)
        yield _down(f"{side}_upper_arm:1", f"{side}_upper_arm", 0.95 * arm, 0.8 * arm, 0.55 * upper, upper)
        yield _down(f"{side}_forearm", f"{side}_forearm", elbow, wrist, 0.05 * fore, 0.95 * fore)
        yield from (_hull_of(solid) for solid in human_capsules.hand(size, side))
        thigh, shank = person.length("left_thigh"), person.length("left_shank")
        high, low = radius("thigh"), radius("thigh_low")
        yield _down(f"{side}_thigh:0", f"{side}_thigh", 0.92 * high, 0.85 * high, 0.12 * thigh, 0.4 * thigh)
        yield _down(f"{side}_thigh:1", f"{side}_thigh", 1.05 * low, 0.95 * low, 0.6 * thigh, 0.98 * thigh)
        yield _down(f"{side}_shank", f"{side}_shank", radius("calf"), radius("ankle"), 0.15 * shank, 0.95 * shank)
        yield from (_hull_of(solid) for solid in human_capsules.foot(size, side))


def _down(name: str, segment: str, first: float, last: float, start: float, end: float) -> Solid:
    shape, middle = hulls.tapered(first, last, end - start)
    return Solid(name, segment, shape, place(0.0, 0.0, middle - start))


def _hull_of(solid: Solid) -> Solid:
    """Polyhedron of a box or a capsule, at the same place."""
    kind = type(solid.geometry).__name__
    if kind == "Box":
        shape = hulls.box(tuple(2.0 * half for half in solid.geometry.halfSide))
    else:
        radius, length = solid.geometry.radius, 2.0 * solid.geometry.halfLength
        shape, _ = hulls.tapered(radius, radius, length)
    return solid._replace(geometry=shape)
