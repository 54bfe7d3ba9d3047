"""Signed distances of simple solids, and their smooth union; metres, negative inside."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from wholebody.base.arrays import Array

Field = Callable[[Array], Array]  # from points (n, 3) to signed distances (n,), exact or nearly so close to the surface


def round_cone(start: Any, end: Any, first: float, last: float) -> Field:
    """The hull of two balls, of radius `first` at `start` and `last` at `end` (Quilez, "Distance functions")."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    axis = b - a
    length2, slope = float(axis @ axis), first - last
    if length2 <= slope * slope + 1e-12:  # one ball contains the other
        return ball(a, first) if first >= last else ball(b, last)
    side2 = length2 - slope * slope

    def field(points: Array) -> Array:
        from_a = points - a
        y = from_a @ axis
        z = y - length2
        x2 = length2 * (length2 * np.einsum("ij,ij->i", from_a, from_a) - y * y)
        x2 = np.maximum(x2, 0.0)
        y2, z2 = y * y * length2, z * z * length2
        bound = np.sign(slope) * slope * slope * x2
        flank = (np.sqrt(x2 * side2 / length2) + y * slope) / length2 - first
        at_end, at_start = np.sqrt(x2 + z2) / length2 - last, np.sqrt(x2 + y2) / length2 - first
        beyond, before = np.sign(z) * side2 * z2 > bound, np.sign(y) * side2 * y2 < bound
        return np.asarray(np.where(beyond, at_end, np.where(before, at_start, flank)))

    return field


def ball(center: Any, radius: float) -> Field:
    """A ball."""
    middle = np.asarray(center, dtype=float)
    return lambda points: np.linalg.norm(points - middle, axis=1) - radius


def ellipsoid(center: Any, radii: Any, rotation: Array | None = None) -> Field:
    """An ellipsoid with the columns of a rotation (3, 3) as axes; the distance is of first order at the surface."""
    middle, size = np.asarray(center, dtype=float), np.asarray(radii, dtype=float)
    axes = np.eye(3) if rotation is None else rotation

    def field(points: Array) -> Array:
        local = (points - middle) @ axes
        inner, outer = np.linalg.norm(local / size, axis=1), np.linalg.norm(local / size**2, axis=1)
        return np.asarray(inner * (inner - 1.0) / np.maximum(outer, 1e-9))

    return field


def half_space(point: Any, normal: Any) -> Field:
    """Everything on the side of a plane that its normal points away from."""
    origin, n = np.asarray(point, dtype=float), np.asarray(normal, dtype=float)
    n = n / np.linalg.norm(n)
    return lambda points: (points - origin) @ n


def placed(field: Field, placement: Array) -> Field:
    """The field moved to a placement (4, 4)."""
    rotation, origin = placement[:3, :3], placement[:3, 3]
    return lambda points: field((points - origin) @ rotation)


def union(fields: Iterable[Field], blend: float = 0.0) -> Field:
    """Union whose inner edges are rounded over about `blend` metres."""
    parts = list(fields)

    def field(points: Array) -> Array:
        found = parts[0](points)
        for part in parts[1:]:
            found = smooth_minimum(found, part(points), blend)
        return found

    return field


def intersection(first: Field, second: Field, blend: float = 0.0) -> Field:
    """What is in both, its outer edge rounded."""
    return lambda points: -smooth_minimum(-first(points), -second(points), blend)


def without(first: Field, second: Field, blend: float = 0.0) -> Field:
    """What is in the first and not in the second."""
    return lambda points: -smooth_minimum(-first(points), second(points), blend)


def grown(field: Field, by: float) -> Field:
    """The field with its surface moved outwards."""
    return lambda points: field(points) - by


def smooth_minimum(a: Array, b: Array, blend: float) -> Array:
    """The lesser of two, joined by a parabola where they differ by less than `blend` (Quilez, "Smooth minimum")."""
    least = np.minimum(a, b)
    if blend <= 0.0:
        return np.asarray(least)
    near = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.asarray(least - near * near * blend * 0.25)
