"""Penetration of two objects: the global penetration depth of unions of convex pieces, and a way out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import InputError
from wholebody.geometry.pair_distances import SinglePairs
from wholebody.geometry.pieces import COAL_ACCURACY
from wholebody.geometry.proximity import Contacts

SHORTEST = 2e-4  # m: least step of a march along a ray; narrower free gaps may be missed
FARTHEST = 3.0  # m: longer ways out are not looked for


class ObjectPenetration(NamedTuple):
    """Two objects that overlap.

    Attributes:
        a: name of the first object.
        b: name of the second.
        global_depth: (3,) PD_g, metres, out of B into A: the estimate of `global_depth`.
        deepest: metres by which the deepest pair of pieces overlaps.
        pairs: number of overlapping pairs of pieces.
    """

    a: str
    b: str
    global_depth: Array
    deepest: float
    pairs: int


def global_depth(depths: Array, normals: Array) -> Array:
    """Global penetration of two objects from their overlapping convex pairs: a translation (3,) of A, metres.

    PD_g = sum(pd_i^2 n_i) / sum(pd_i), equation 1 of Schmidl and Lin, "Real-time physically-based interaction between
    avatars and virtual environments". It is a fast estimate: A moves by it, or A by half of it and B by minus half,
    and the overlap is computed again. Opposed normals cancel (their figure 4b), and then it is near zero however
    deep the overlap.

    Args:
        depths: (k,) penetration depth of each pair, metres, positive.
        normals: (k, 3) unit normals out of B into A.

    Raises:
        InputError: shapes that do not match, or a depth that is negative or not finite.
    """
    depths, normals = np.asarray(depths, dtype=float), np.asarray(normals, dtype=float)
    if depths.ndim != 1 or normals.shape != (len(depths), 3):
        raise InputError(f"depths and normals have shapes {depths.shape} and {normals.shape}; give (k,) and (k, 3)")
    if not (np.isfinite(depths).all() and np.isfinite(normals).all() and (depths >= 0.0).all()):
        raise InputError("depths must be finite and not negative, and normals finite; contacts have negative distances")
    total = float(depths.sum())
    return np.asarray(depths**2 @ normals / total) if total > 0.0 else np.zeros(3)


def object_penetrations(near: Contacts, owners: Sequence[str]) -> list[ObjectPenetration]:
    """Every two owners of pieces that overlap by more than coal's accuracy, those with the deepest pair first.

    The owner of a piece that comes first is the A of its pair.
    """
    first = {owner: k for k, owner in reversed(list(enumerate(owners)))}
    rows: dict[tuple[str, str], list[int]] = {}
    out = -near.normal
    for row in np.flatnonzero(near.distance < -COAL_ACCURACY).tolist():
        a, b = (owners[piece] for piece in near.pair[row])
        if first[a] > first[b]:
            a, b, out[row] = b, a, -out[row]
        rows.setdefault((a, b), []).append(row)
    found = [
        ObjectPenetration(
            *names, global_depth(-near.distance[own], out[own]), -float(near.distance[own].min()), len(own)
        )
        for names, own in rows.items()
    ]
    return sorted(found, key=lambda one: -one.deepest)


def way_out(
    geometry: pin.GeometryModel, placements: Array, pairs: Indices, moved: Indices, normal: Array
) -> Array | None:
    """A short translation (3,) of the pieces `moved`, metres, that leaves no pair (k, 2) overlapping; None for none.

    It is the shortest of those along 70 directions spread over the sphere, and along these projected onto the plane of
    a `normal` (3,). A march along a ray goes on by the depth of the deepest pair.
    """
    spread = _spread()
    flat = spread - np.outer(spread @ normal, normal)
    single, shortest, length = SinglePairs(geometry), None, FARTHEST
    for direction in np.vstack([spread, flat / np.maximum(np.linalg.norm(flat, axis=1), 1e-9)[:, None]]):
        moved_by = 0.0
        while moved_by < length and direction.any():
            there = placements.copy()
            there[moved, 3] += moved_by * direction
            deepest = -float(single.measured(there, pairs)[:, 0].min())
            if deepest <= COAL_ACCURACY:
                shortest, length = moved_by * direction, moved_by
            moved_by += max(deepest, SHORTEST)
    return shortest


def _spread() -> Array:
    """Unit vectors spread over the sphere: a Fibonacci spiral, its opposites and the axes."""
    count = 32
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - z * z)
    spiral = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), z])
    return np.vstack([spiral, -spiral, np.eye(3), -np.eye(3)])
