"""The head's parts in its own frame: face, hair, eyes, brows and lips, scaled to the person's head."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.files import packaged_toml
from wholebody.figures.anthropometry import Dimensions
from wholebody.figures.surface import fields
from wholebody.figures.surface.fields import Field, ellipsoid, grown, half_space, intersection, union, without


class HeadShape(NamedTuple):
    """Solids in the head's frame, and where the eyes are."""

    skin: Field
    hair: Field
    eyes: Field
    lids: Field
    irises: Field
    brows: Field
    lips: Field


def head_shape(size: Dimensions) -> HeadShape:
    """Return the head of a person: every shape below is of one head, and stretched to the person's."""
    # metres of the head that the numbers were drawn for: length, breadth, from chin to vertex
    own = 2.0 * size.head_half_length, 2.0 * size.head_half_breadth, size.head_top - size.head_bottom
    scale = np.array(own) / (0.198, 0.153, 0.228)
    origin = np.array([size.head_x, 0.0, size.head_bottom])
    least = float(scale.min())

    def stretched(field: Field) -> Field:
        return lambda points: field((points - origin) / scale) * least

    female = size.body.sex == "female"
    face = _face(female)
    lids = without(_around_eyes(face), _part("slits"), 0.002)
    parts = face, _hair(female), _part("eyes"), lids, _part("irises"), _part("brows"), union(_solids("lips"), 0.004)
    return HeadShape(*map(stretched, parts))


def _face(female: bool) -> Field:
    jaw = "jaw_female" if female else "jaw_male"
    solids = [_skull(), *_solids("middle"), *_solids(jaw), *_solids("face")]
    face = without(union(solids, 0.022), _part("sockets"), 0.014)
    ears = union([ellipsoid((-0.006, s * 0.077, 0.104), (0.017, 0.007, 0.030), _ear_axes(s)) for s in (1.0, -1.0)])
    return union([union([face, union(_solids("nose"), 0.008)], 0.014), ears], 0.006)


def _around_eyes(face: Field) -> Field:
    """Lids and the skin around them, for which the head's own mesh is too coarse. Its edge is below that mesh."""
    places = [np.array(given["ellipsoid"][0]) * (1.0, side, 1.0) for given in _given("eyes") for side in (1.0, -1.0)]
    smooth = union([face, _part("lids")], 0.008)

    def field(points: Array) -> Array:
        away = np.min([np.linalg.norm(points - place, axis=-1) for place in places], axis=0)
        # a little over the mesh where the lids are, and below it 30 mm from the middle of the eye
        return np.asarray(np.maximum(smooth(points) - 0.0005 + 0.0011 * (away / 0.027) ** 4, away - 0.032))

    return field


def _skull() -> Field:
    return union(_solids("skull"), 0.03)


def _ear_axes(side: float) -> Array:
    """Ears stand off the head at the back and lean backwards."""
    out, lean = np.radians(22.0) * side, np.radians(-12.0)
    yaw = np.array([[np.cos(out), -np.sin(out), 0.0], [np.sin(out), np.cos(out), 0.0], [0.0, 0.0, 1.0]])
    pitch = np.array([[np.cos(lean), 0.0, np.sin(lean)], [0.0, 1.0, 0.0], [-np.sin(lean), 0.0, np.cos(lean)]])
    return np.asarray(yaw @ pitch)


def _hair(female: bool) -> Field:
    """Hair over the skull above a line from the forehead past the ears to the nape; women's reaches the neck."""
    above = half_space((0.066, 0.0, 0.190), (0.64, 0.0, -0.77))
    back = half_space((-0.016, 0.0, 0.10), (1.0, 0.0, -0.12))
    temple = half_space((0.036, 0.0, 0.150), (1.0, 0.0, 0.35))
    line = [above]
    for edge, low in ((back, 0.062), (temple, 0.112)):
        line.append(intersection(edge, half_space((0.0, 0.0, low), (0.0, 0.0, -1.0)), 0.02))
    hair = intersection(grown(_skull(), 0.007), union(line, 0.02), 0.010)
    return union([hair, _part("long_hair")], 0.03) if female else hair


def _part(name: str) -> Field:
    """All solids of a part of `head.toml`."""
    return union(_solids(name))


def _solids(name: str) -> list[Field]:
    """The solids of a part of `head.toml`, each with its mirror image if it has one."""
    made = []
    for given in _given(name):
        kind, places = next((kind, number) for kind, number in PLACES.items() if kind in given)
        solid: Any = getattr(fields, kind.replace("cone", "round_cone"))
        sides = []
        for side in (1.0, -1.0) if given.get("both") else (1.0,):
            ends = [np.array(place) * (1.0, side, 1.0) for place in given[kind][:places]]
            sides.append(solid(*ends, *given[kind][places:]))
        made.append(union(sides))
    return made


def _given(name: str) -> list[dict[str, Any]]:
    """The lines of a part of `head.toml`."""
    return list(packaged_toml(Path(__file__).with_name("head.toml"))[name])


PLACES = {"ball": 1, "ellipsoid": 1, "cone": 2}
"""How many of the numbers of each kind of solid are places."""
