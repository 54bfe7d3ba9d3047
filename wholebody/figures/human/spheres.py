"""The 39 spheres in five groups that whole motions are tested with (Degenhardt's thesis, section 3.3.1).

Places and radii leave the least volume of the median man's and woman's capsules and boxes uncovered, and put the least
outside of them; for other builds the radius grows with the square root of mass per stature. The detail is coarse: the
hulls of hands come up to 5 cm out of it, of feet 6 cm, of forearms and shanks 3.5 cm, so things in the world
meet the hulls instead (`Figure.outer`). To hold the hulls to 5 mm, 39 spheres would have to come 4 to 10 cm out of
them.
"""

from __future__ import annotations

import math

import coal

from wholebody.figures.anthropometry import table
from wholebody.figures.body_spec import Solid, place
from wholebody.figures.dimensions import Dimensions


def solids(size: Dimensions) -> tuple[Solid, ...]:
    """Return the 39 spheres of a person; the feet's are lifted to rest on the soles' plane."""
    person = size.body
    # Mass per stature of the median man and woman of ANSUR II, kg / m, for which the table's radii hold: 84.6 kg by
    # 1.755 m, and 66.8 kg by 1.626 m (table "percentiles").
    build = math.sqrt(person.mass / person.stature / {"M": 48.2, "F": 41.1}[person.column])
    count: dict[str, int] = {}
    spheres = []
    for row in table("spheres39"):
        segment = row["segment"]
        k = count[segment] = count.get(segment, -1) + 1
        radius = float(row[f"radius_{person.column}"]) * person.stature * build
        x, y, z = (float(row[f"offset_{axis}"]) * person.stature for axis in "xyz")
        if segment.endswith("_foot"):
            z = size.sole + radius
        spheres.append(Solid(f"{segment}:{k}", segment, coal.Sphere(radius), place(x, y, z)))
    return tuple(spheres)


def sphere_names() -> dict[str, str]:
    """Name of the piece in the figure ("left_forearm:1") of each sphere's name in the tables ("left_forearm")."""
    count: dict[str, int] = {}
    names = {}
    for row in table("spheres39"):
        k = count[row["segment"]] = count.get(row["segment"], -1) + 1
        names[row["name"]] = f"{row['segment']}:{k}"
    return names
