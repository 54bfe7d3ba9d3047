"""Shapes of geoms in a compiled MJCF file."""

from __future__ import annotations

from wholebody.figures.link_pieces import LinkShape
from wholebody.figures.mjcf.compiled import Compiled, placement

SHAPES = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
"""Kinds of geoms, as MuJoCo numbers them."""


def geom_shape(compiled: Compiled, geom: int) -> LinkShape | None:
    """The shape of a geom on its body; None for planes and height fields, which only the world has."""
    model = compiled.model
    link = compiled.names["body"][int(model.geom_bodyid[geom])]
    at = placement(model.geom_pos[geom], model.geom_quat[geom])
    size = [float(value) for value in model.geom_size[geom]]
    kind = SHAPES[int(model.geom_type[geom])]
    if kind in ("mesh", "sdf"):
        return LinkShape(link, at, "triangles", (), triangles=compiled.mesh(geom))
    sizes: dict[str, tuple[float, ...]] = {
        "sphere": (size[0],), "capsule": (size[0], 2.0 * size[1]), "cylinder": (size[0], 2.0 * size[1]),
        "ellipsoid": tuple(size), "box": tuple(2.0 * value for value in size),
    }  # fmt: skip
    return LinkShape(link, at, kind, sizes[kind]) if kind in sizes else None
