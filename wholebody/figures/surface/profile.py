"""The trunk's outline: a stack of ovals around the trunk's pieces, and the balls that limbs' pieces are hulls of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import coal
import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from wholebody.base.arrays import Array
from wholebody.figures.body_spec import Solid
from wholebody.figures.surface.fields import Field, placed, round_cone

LEVEL = 0.005  # metres between two ovals

SMOOTHING = 0.028  # standard deviation, metres, of the smoothing of the outline along the trunk and the limbs

ROUNDNESS = 2.3  # exponent of the ovals: 2 is an ellipse, more is nearer to a rectangle

RAYS = np.arange(-0.4, 0.4, 0.002)  # metres from the middle at which the pieces are looked for


def piece_field(solid: Solid) -> Field:
    """The signed distance of a capsule in its segment's frame; parts with a surface have no other pieces."""
    half, radius = float(solid.geometry.halfLength), float(solid.geometry.radius)
    found = round_cone((0.0, 0.0, -half), (0.0, 0.0, half), radius, radius)
    return placed(found, np.asarray(solid.placement.homogeneous))


def caps(solids: Iterable[Solid], segment: str) -> list[tuple[Array, float]]:
    """Centres (3,) and radii of the balls at the ends of a limb's capsules, in its frame, the highest first."""
    found: list[tuple[Array, float]] = []
    own = [one for one in solids if one.segment == segment and isinstance(one.geometry, coal.Capsule)]
    for solid in own:
        half, radius = float(solid.geometry.halfLength), float(solid.geometry.radius)
        ends = [np.asarray(solid.placement.act(np.array([0.0, 0.0, end]))) for end in (half, -half)]
        others = [piece_field(other) for other in own if other is not solid]
        if any((other(np.array(ends)) + radius < 1e-6).all() for other in others):
            continue  # a core within the flesh
        found += [(end, radius) for end in ends]
    return sorted(found, key=lambda entry: -float(entry[0][2]))


def limb(balls: Sequence[tuple[Array, float]], smoothing: float = SMOOTHING) -> Field:
    """A smooth solid around balls, centres (3,) and radii, smoothed by `smoothing` along them [m]."""
    centers, radii = np.array([center for center, _ in balls]), np.array([radius for _, radius in balls])
    start, span = centers[0], centers[-1] - centers[0]
    length = float(np.linalg.norm(span))
    along = span / length
    at = np.maximum.accumulate((centers - start) @ along)
    places = np.arange(0.0, length + LEVEL, LEVEL)
    sigma = smoothing / LEVEL
    radius = gaussian_filter1d(np.interp(places, at, radii), sigma, mode="nearest")
    middle = np.column_stack([np.interp(places, at, centers[:, k]) for k in range(3)])
    middle = gaussian_filter1d(middle - np.outer(places, along), sigma, axis=0, mode="nearest")

    def field(points: Array) -> Array:
        place = np.clip((points - start) @ along, 0.0, length)
        axis = np.column_stack([np.interp(place, places, middle[:, k]) for k in range(3)]) + np.outer(place, along)
        return np.asarray(np.linalg.norm(points - axis, axis=1) - np.interp(place, places, radius))

    return field


def trunk(pieces: Field, low: float, high: float, x: float) -> Field:
    """A smooth solid around the trunk's pieces, between two heights; `x` is inside the trunk at every height."""
    heights = np.arange(low, high, LEVEL)
    front, back = np.empty(len(heights)), np.empty(len(heights))
    side = np.empty(len(heights))
    for number, height in enumerate(heights):
        along = np.column_stack([x + RAYS, np.zeros_like(RAYS), np.full_like(RAYS, height)])
        inside = RAYS[pieces(along) < 0.0]
        front[number], back[number] = (x + inside[-1], x + inside[0]) if len(inside) else (np.nan, np.nan)
        middle = 0.5 * (front[number] + back[number])
        across = np.column_stack([np.full_like(RAYS, middle), RAYS, np.full_like(RAYS, height)])
        wide = RAYS[pieces(across) < 0.0] if len(inside) else RAYS[:0]
        side[number] = wide[-1] if len(wide) else np.nan
    found = ~np.isnan(side)
    heights, front, back, side = heights[found], front[found], back[found], side[found]
    depth, middle = 0.5 * (front - back), 0.5 * (front + back)
    wide_enough = int(2 * SMOOTHING / LEVEL)

    def smooth(values: Array, *, around: bool) -> Array:
        kept = maximum_filter1d(values, wide_enough) if around else values
        # an outline ends in nothing, so that shoulders slope up to the neck
        return np.asarray(gaussian_filter1d(kept, SMOOTHING / LEVEL, mode="constant" if around else "nearest"))

    depth, side, middle = smooth(depth, around=True), smooth(side, around=True), smooth(middle, around=False)

    def field(points: Array) -> Array:
        height = np.clip(points[:, 2], heights[0], heights[-1])
        b, a, c = (np.interp(height, heights, values) for values in (depth, side, middle))
        u, v = np.abs(points[:, 0] - c) / b, np.abs(points[:, 1]) / a
        reach = (u**ROUNDNESS + v**ROUNDNESS) ** (1.0 / ROUNDNESS)
        # Distance along the ray from the axis, shortened where the ray meets the oval at a slant.
        radial = np.hypot(points[:, 0] - c, points[:, 1])
        flat = np.where(reach > 1e-6, radial * (1.0 - 1.0 / np.maximum(reach, 1e-6)), -np.minimum(a, b))
        flat = np.maximum(flat, -np.minimum(a, b))
        beyond = np.abs(points[:, 2] - height)
        return np.asarray(np.where(beyond > 0.0, np.hypot(np.maximum(flat, 0.0), beyond), flat))

    return field
