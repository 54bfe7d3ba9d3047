"""The person in convex polyhedra: an elliptic trunk, and limbs like the capsules, which is closest to a body."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pinocchio as pin

from wholebody.base.records import with_values
from wholebody.figures import hulls
from wholebody.figures.body_spec import Solid, place
from wholebody.figures.dimensions import Dimensions
from wholebody.figures.human import capsules


def solids(size: Dimensions) -> tuple[Solid, ...]:
    """Return the pieces of a person, all of them convex polyhedra."""
    rest = [
        solid
        for solid in capsules.solids(size)
        if solid.name not in ("pelvis", "lower_lumbar", "upper_lumbar", "lower_thorax", "thorax", "neck")
    ]
    return (*_trunk(size), *(hull_of(solid) for solid in rest))


def _trunk(size: Dimensions) -> Iterator[Solid]:
    for part in capsules.trunk_parts(size):
        radii = (part.half_depth, part.half_breadth, part.half_height)
        yield _solid(part.segment, hulls.ellipsoid(radii, part.segment), part.x, part.z)
    neck, length = size.body.radius("neck"), size.body.length("neck")
    yield _solid("neck", hulls.tapered(neck, neck, 0.8 * length, "neck"), 0.0, 0.9 * length)


def _solid(name: str, hull: tuple[Any, pin.SE3], x: float, z: float) -> Solid:
    shape, center = hull
    return Solid(name, name.partition(":")[0], shape, place(x, 0.0, z) * center)


def hull_of(solid: Solid) -> Solid:
    """Return the polyhedron of a box or a capsule, at the same place."""
    if type(solid.geometry).__name__ == "Box":
        x, y, z = (2.0 * float(half) for half in solid.geometry.halfSide)
        shape, center = hulls.box((x, y, z), solid.name)
    else:
        radius, half = solid.geometry.radius, solid.geometry.halfLength
        shape, center = hulls.tapered(radius, radius, 2.0 * half, solid.name)
        center = place(z=half) * center
    return with_values(solid, geometry=shape, placement=solid.placement * center)
