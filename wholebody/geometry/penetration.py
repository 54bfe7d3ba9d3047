"""Penetration of two objects: the global penetration depth of unions of convex pieces, and the least separation.

The least separation is the point nearest to the origin outside the union of the Minkowski differences of all pairs (see
`wholebody.geometry.minkowski`). The problem is not convex, because each pair may separate on any side. The answer is
the best of many local searches: each begins at the first free place along a direction, keeps the plane that separates
each pair there, and takes the least translation under these planes, n . t >= h(n), until it becomes no shorter.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.geometry.large_models import pairs_of
from wholebody.geometry.minkowski import OVERLAP, ObjectPair, Placed, Sides


class ObjectPenetration(NamedTuple):
    """Two objects that overlap.

    Attributes:
        a: name of the first object.
        b: name of the second.
        global_depth: (3,) PD_g, metres, out of B into A: the estimate of `global_depth`.
        separation: (3,) least translation of A that separates all pairs of pieces, metres.
        separated: whether the translation separates them (verified by coal); false if none can.
        pairs: number of overlapping pairs of pieces.
    """

    a: str
    b: str
    global_depth: Array
    separation: Array
    separated: bool
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
    a: str, b: str, pieces_a: Sequence[Placed], pieces_b: Sequence[Placed], allowed: NDArray[np.bool_] | None = None
) -> ObjectPenetration | None:
    """Both measures of the overlap of two objects; None if no allowed pair (n, m) is deeper than a micrometre."""
    overlap, depths, normals = ObjectPair(pieces_a, pieces_b, allowed).overlapping(np.zeros(3), 1e-6)
    if not overlap:
        return None
    way = least_separation(pieces_a, pieces_b, allowed)
    depth = global_depth(depths, normals)
    return ObjectPenetration(a, b, depth, way.translation, way.separated, len(overlap))


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
    pieces_of: dict[str, list[int]] = {}
    for k, owner in enumerate(owners):
        pieces_of.setdefault(owner, []).append(k)
    found = []
    for (a, b), pairs_of_both in touching.items():
        if not pairs_of_both:  # all of two owners where the geometry has none
            pairs_of_both = [(i, j) for i in pieces_of[a] for j in pieces_of[b]]
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


TOUCHING = 1e-7  # overlap that counts as none in the search, metres; the answer is verified to `OVERLAP`
SHORTEST = 2e-4  # least step of a march along a ray, metres; narrower free gaps may be missed


class Separation(NamedTuple):
    """A translation of A."""

    translation: Array  # (3,) metres
    separated: bool  # whether coal finds no overlap after it


def least_separation(
    pieces_a: Sequence[Placed], pieces_b: Sequence[Placed], allowed: NDArray[np.bool_] | None = None
) -> Separation:
    """Least translation of A after which no piece of it overlaps B; see `object_penetration` for the arguments."""
    # Zero where nothing overlaps, and with ``separated=False`` where nothing separates (between two half-spaces).
    pairs = ObjectPair(pieces_a, pieces_b, allowed)
    escapes = pairs.escapes()
    best = min(escapes, key=lambda way: float(way @ way), default=None)
    if best is None:
        return Separation(np.zeros(3), False)
    best = _descents(pairs, best, escapes)
    return Separation(best, not pairs.overlapping(best, OVERLAP)[0])


def _nearest_on_rows(new: Sides, normals: Array, offsets: Array) -> Array:
    """Least t subject to the old rows and one new row that the old answer violates: (k, 3), NaN if infeasible."""
    # The new row is then active, with at most two old rows; all such sets are tried at once.
    count = len(new.offsets)
    best, answers = np.full(count, np.inf), np.full((count, 3), np.nan)
    for size in (0, 1, 2):
        for chosen in combinations(range(len(offsets)), size):
            old = list(chosen)
            rows = np.concatenate([new.normals[:, None], np.broadcast_to(normals[old], (count, size, 3))], axis=1)
            values = np.concatenate([new.offsets[:, None], np.broadcast_to(offsets[old], (count, size))], axis=1)
            gram = rows @ rows.transpose(0, 2, 1)
            solid = np.linalg.det(gram) > 1e-10
            gram[~solid] = np.eye(size + 1)
            weights = np.linalg.solve(gram, values[:, :, None])
            trial = (rows * weights).sum(axis=1)
            length = (trial**2).sum(axis=1)
            kept = solid & (length < best) & (trial @ normals.T >= offsets - 1e-10).all(axis=1)
            best[kept], answers[kept] = length[kept], trial[kept]
    return answers


def _descents(pairs: ObjectPair, best: Array, escapes: Array) -> Array:
    """The best of local searches from the first free position along many directions."""
    best = _descent(pairs, best)
    lengths = np.linalg.norm(escapes, axis=1)
    for escape, length in zip(escapes, lengths, strict=True):
        if length > 0.0:
            # Largest length of a start of a local search, relative to the best known: the search shortens it.
            reach = min(float(length), 1.5 * float(np.linalg.norm(best)))
            free = _first_free(pairs, escape / length, reach)
            if free is not None:
                best = min(best, _descent(pairs, free), key=lambda t: float(t @ t))
    return best


def _first_free(pairs: ObjectPair, direction: Array, reach: float) -> Array | None:
    """March along a ray to the first position without overlap; a pair overlaps at least for its depth."""
    length = 0.0
    while length <= reach:
        found, depths, _ = pairs.overlapping(length * direction, TOUCHING)
        if not found:
            return length * direction
        length += max(float(depths.max()), SHORTEST)
    return None


def _descent(pairs: ObjectPair, translation: Array) -> Array:
    """Shorten a translation that separates, keeping every pair on its sides of the plane that now separates it."""
    # Each plane is a sufficient condition: the QP with all is feasible, and its answer separates and is no longer.
    for _ in range(30):  # far fewer unless rounding causes cycles
        sides = pairs.between(translation)
        if sides is None:
            return translation
        shorter = _least_under(sides)
        if shorter is None or np.linalg.norm(shorter) > np.linalg.norm(translation) - SHORTEST * 1e-4:
            return translation
        if pairs.overlapping(shorter, OVERLAP)[0]:
            return translation
        translation = shorter
    return translation


def _least_under(sides: Sides) -> Array | None:
    """The QP  min |t|^2,  normals t >= offsets: the most violated row is added until none is violated."""
    answer, normals, offsets = np.zeros(3), np.zeros((0, 3)), np.zeros(0)
    for _ in range(40):  # rows; far fewer unless rounding causes cycles
        slack = sides.normals @ answer - sides.offsets
        worst = int(np.argmin(slack))
        if slack[worst] >= -1e-10:
            return answer
        row = Sides(sides.normals[worst : worst + 1], sides.offsets[worst : worst + 1])
        answer = _nearest_on_rows(row, normals, offsets)[0]
        if not np.isfinite(answer[0]):
            return None
        normals, offsets = np.vstack([normals, row.normals]), np.append(offsets, row.offsets)
    return None
