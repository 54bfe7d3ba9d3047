"""The person in convex polyhedra, which is closest to a body, and in the 39 spheres that whole motions are tested with.

The spheres are in five groups (Degenhardt's thesis, section 3.3.1). Places and radii leave the least volume of the
median man's and woman's capsules and boxes uncovered, and put the least outside of them; for other builds the radius
grows with the square root of mass per stature. The detail is coarse: the hulls of hands come up to 5 cm out of it, of
feet 6 cm, of forearms and shanks 3.5 cm, so things in the world meet the hulls instead (`Figure.outer`). To hold the
hulls to 5 mm, 39 spheres would have to come 4 to 10 cm out of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import coal
import pinocchio as pin

from wholebody.base.arrays import with_values
from wholebody.figures import hulls
from wholebody.figures.anthropometry import Dimensions
from wholebody.figures.body_spec import Solid, place
from wholebody.figures.human import capsules
from wholebody.figures.tables import table


def polyhedra(size: Dimensions) -> tuple[Solid, ...]:
    """Return the pieces of a person, all of them convex polyhedra."""
    rest = [
        solid
        for solid in capsules.solids(size)
        if solid.name not in ("pelvis", "lower_lumbar", "upper_lumbar", "lower_thorax", "thorax", "neck")
    ]
    return (*_trunk(size), *(hull_of(solid) for solid in rest))


def _trunk(size: Dimensions) -> Iterator[Solid]:
    for part in capsules.trunk_slices(size):
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
        found.append(Solid(name, segment, coal.Sphere(radius), place(x, y, z)))
    return tuple(found)


def sphere_names() -> dict[str, str]:
    """Name of the piece in the figure ("left_forearm:1") of each sphere's name in the tables ("left_forearm")."""
    count: dict[str, int] = {}
    names = {}
    for row in table("spheres39"):
        k = count[row["segment"]] = count.get(row["segment"], -1) + 1
        names[row["name"]] = f"{row['segment']}:{k}"
    return names
