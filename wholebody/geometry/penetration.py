"""Penetration of two objects: the global penetration depth of unions of convex pieces, and the least separation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.geometry.large_models import pairs_of
from wholebody.geometry.minkowski import ObjectPair, Placed
from wholebody.geometry.separation import least_separation


class ObjectPenetration(NamedTuple):
    """Two objects that overlap.

    Attributes:
        a: name of the first object.
        b: name of the second.
        global_depth: (3,) PD_g, metres, out of B into A: the estimate of `global_depth`.
        separation: (3,) least translation of A that separates all pairs of pieces, metres.
        separated: whether the translation separates them (verified by coal); false if none can.
        least: whether no shorter translation exists, proven; see `Separation`.
        pairs: number of overlapping pairs of pieces.
    """

    a: str
    b: str
    global_depth: Array
    separation: Array
    separated: bool
    least: bool
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


def object_penetration(
    a: str,
    b: str,
    pieces_a: Sequence[Placed],
    pieces_b: Sequence[Placed],
    allowed: NDArray[np.bool_] | None = None,
    tolerance: float = 1e-6,
) -> ObjectPenetration | None:
    """Both measures of the overlap of two objects; None if no allowed pair (n, m) is deeper than the tolerance [m]."""
    overlap, depths, normals = ObjectPair(pieces_a, pieces_b, allowed).overlapping(np.zeros(3), tolerance)
    if not overlap:
        return None
    way = least_separation(pieces_a, pieces_b, allowed)
    depth = global_depth(depths, normals)
    return ObjectPenetration(a, b, depth, way.translation, way.separated, way.least, len(overlap))


def object_penetrations(
    geometry: pin.GeometryModel,
    placements: Array,
    owners: Sequence[str],
    pairs: NDArray[np.intp],
    tested: NDArray[np.intp] | None = None,
) -> list[ObjectPenetration]:
    """Every two owners of pieces that overlap, those with the longest separation first.

    `placements` as in `Contacts`; the owner of a piece that comes first is the A of its pair; `pairs` (k, 2) overlap,
    `tested` (m, 2) can touch, the geometry's by default.
    """
    if tested is None:
        tested = pairs_of(geometry)
    first = {owner: k for k, owner in reversed(list(enumerate(owners)))}
    asked = {tuple(sorted((owners[i], owners[j]), key=first.__getitem__)) for i, j in np.asarray(pairs).reshape(-1, 2)}
    touching: dict[tuple[str, ...], list[tuple[int, int]]] = {names: [] for names in asked}
    number = np.array([first[owner] for owner in owners], dtype=np.intp)
    ordered = np.where(number[tested[:, :1]] <= number[tested[:, 1:]], tested, tested[:, ::-1])
    keys = np.array([first[a] * len(owners) + first[b] for a, b in touching], dtype=np.intp)
    for i, j in ordered[np.isin(number[ordered[:, 0]] * len(owners) + number[ordered[:, 1]], keys)].tolist():
        touching[owners[i], owners[j]].append((i, j))
    found = []
    for (a, b), pairs_of_both in touching.items():
        if not pairs_of_both:  # all of two owners where the geometry has none
            pairs_of_both = [
                (i, j) for i, one in enumerate(owners) if one == a for j, two in enumerate(owners) if two == b
            ]
        allowed = np.array(pairs_of_both)
        (of_a, row), (of_b, column) = (np.unique(allowed[:, side], return_inverse=True) for side in range(2))
        mask = np.zeros((len(of_a), len(of_b)), dtype=bool)
        mask[row, column] = True
        pieces_a, pieces_b = (
            [(geometry.geometryObjects[k].geometry, pin.SE3(placements[k, :3].T, placements[k, 3])) for k in of]
            for of in (of_a.tolist(), of_b.tolist())
        )
        found.append(object_penetration(a, b, pieces_a, pieces_b, mask))
    return sorted(filter(None, found), key=lambda one: -float(np.linalg.norm(one.separation)))
