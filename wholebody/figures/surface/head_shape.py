"""The head's parts in its own frame: face, hair, eyes, brows and lips, scaled to the person's head."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.anthropometry import Dimensions
from wholebody.figures.surface.fields import (
    Field,
    ball,
    ellipsoid,
    grown,
    half_space,
    intersection,
    round_cone,
    union,
    without,
)


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
    # metres of the head that the numbers below were drawn for: length, breadth, from chin to vertex
    scale = np.array(
        [
            2.0 * size.head_half_length / 0.198,
            2.0 * size.head_half_breadth / 0.153,
            (size.head_top - size.head_bottom) / 0.228,
        ]
    )
    origin = np.array([size.head_x, 0.0, size.head_bottom])
    least = float(scale.min())

    def stretched(field: Field) -> Field:
        return lambda points: field((points - origin) / scale) * least

    female = size.body.sex == "female"
    parts = [_face(female), _hair(_skull(), female), _pair(lambda s: ball((0.0725, s * 0.0315, 0.118), 0.0126))]
    parts.append(_lids())
    parts.append(_pair(lambda s: ball((0.0797, s * 0.0310, 0.118), 0.0070)))
    parts.append(_pair(lambda s: round_cone((0.0915, s * 0.018, 0.1365), (0.0835, s * 0.045, 0.1375), 0.0034, 0.0022)))
    parts.append(
        union(
            [
                ellipsoid((0.0805, 0.0, 0.0505), (0.0095, 0.0215, 0.0042)),
                ellipsoid((0.0800, 0.0, 0.0445), (0.0095, 0.0165, 0.0048)),
            ]
        )
    )
    return HeadShape(*map(stretched, parts))


def _skull() -> Field:
    return union(
        [ellipsoid((-0.012, 0.0, 0.138), (0.088, 0.076, 0.090)), ellipsoid((0.012, 0.0, 0.143), (0.080, 0.067, 0.078))],
        0.03,
    )


def _face(female: bool) -> Field:
    jaw = 0.92 if female else 1.0
    solids = [
        _skull(),
        ellipsoid((0.022, 0.0, 0.086), (0.064, 0.062, 0.078)),
        _pair(
            lambda s: round_cone((0.004, s * 0.043 * jaw, 0.046), (0.060, s * 0.013 * jaw, 0.020), 0.017, 0.017 * jaw)
        ),
        _pair(lambda s: ball((0.052, s * 0.040, 0.090), 0.026)),
        ellipsoid((0.062, 0.0, 0.046), (0.024, 0.030, 0.026)),
        ellipsoid((0.070, 0.0, 0.136), (0.018, 0.048, 0.012)),
    ]
    face = union(solids, 0.022)
    face = without(face, _pair(lambda s: ellipsoid((0.093, s * 0.031, 0.118), (0.014, 0.019, 0.011))), 0.014)
    nose = union(
        [
            round_cone((0.083, 0.0, 0.124), (0.103, 0.0, 0.084), 0.0075, 0.0105),
            _pair(lambda s: ball((0.092, s * 0.011, 0.080), 0.0085)),
        ],
        0.008,
    )
    ears = _pair(lambda s: ellipsoid((-0.006, s * 0.077, 0.104), (0.017, 0.007, 0.030), _ear_axes(s)))
    return union([union([face, nose], 0.014), ears], 0.006)


def _lids() -> Field:
    """Upper and lower lids, which are too thin for the head's own mesh: without them eyes stare."""
    lids = _pair(lambda s: ball((0.0725, s * 0.0315, 0.118), 0.0137))
    slit = _pair(lambda s: ellipsoid((0.0905, s * 0.0315, 0.1168), (0.014, 0.0130, 0.0040)))
    return without(lids, slit, 0.002)


def _ear_axes(side: float) -> Array:
    """Ears stand off the head at the back and lean backwards."""
    out, lean = np.radians(22.0) * side, np.radians(-12.0)
    yaw = np.array([[np.cos(out), -np.sin(out), 0.0], [np.sin(out), np.cos(out), 0.0], [0.0, 0.0, 1.0]])
    pitch = np.array([[np.cos(lean), 0.0, np.sin(lean)], [0.0, 1.0, 0.0], [-np.sin(lean), 0.0, np.cos(lean)]])
    return np.asarray(yaw @ pitch)


def _hair(skull: Field, female: bool) -> Field:
    """Hair over the skull above a line from the forehead past the ears to the nape; women's reaches the neck."""
    cap = grown(skull, 0.007)
    above = half_space((0.066, 0.0, 0.190), (0.64, 0.0, -0.77))
    back = half_space((-0.016, 0.0, 0.10), (1.0, 0.0, -0.12))
    line = union([above, intersection(back, half_space((0.0, 0.0, 0.062), (0.0, 0.0, -1.0)), 0.02)], 0.02)
    hair = intersection(cap, line, 0.010)
    if not female:
        return hair
    long = ellipsoid((-0.052, 0.0, 0.072), (0.046, 0.070, 0.105))
    return union([hair, long], 0.03)


def _pair(of_side: Callable[[float], Field]) -> Field:
    """The union of what a function makes for +1, the left side, and -1."""
    return union([of_side(1.0), of_side(-1.0)])
