"""Geometry models of thousands of pieces.

Pinocchio keeps an n x n table of pair numbers and copies it whenever a piece is added: 1000 pieces take 0.6 s, 5000
more than a minute. A model that counts n pieces, with its pairs, can be read from text at once, and its list of pieces
be filled afterwards. The table alone takes 1.6 GB for 20,000 pieces, so models of more than `TABLED` have none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Indices

MANY = 300  # number of pieces from which entries are made at once; as many are added one by one in 20 ms
TABLED = 2000  # number of pieces up to which a model has Pinocchio's table of pair numbers, of 16 MB then


def geometry_model(
    pieces: Sequence[pin.GeometryObject], pairs: Indices | None = None, most: int = TABLED
) -> pin.GeometryModel:
    """Pinocchio's geometry model of these pieces and pairs (k, 2), the lesser index first."""
    # With more than `most` pieces it has no table of pair numbers, which `addCollisionPair` and others use.
    tabled = pairs is None or len(pieces) <= most
    pairs = np.zeros((0, 2), dtype=np.intp) if pairs is None else pairs
    if tabled and len(pieces) < MANY:
        return _one_by_one(pieces, pairs)
    geometry = _counted(len(pieces), None if tabled else pairs)
    if geometry is None:
        return _one_by_one(pieces, pairs)
    geometry.geometryObjects.extend(pieces)
    if tabled:
        add_pairs(geometry, pairs)
    return geometry


def pairs_of(geometry: pin.GeometryModel) -> Indices:
    """(k, 2) the two pieces of each collision pair."""
    listed = [(pair.first, pair.second) for pair in geometry.collisionPairs]
    return np.array(listed, dtype=np.intp).reshape(-1, 2)


def add_pairs(geometry: pin.GeometryModel, pairs: Indices) -> None:
    """Add pairs (k, 2) that a model does not have, the lesser index first."""
    tabled = geometry.collisionPairMapping.size == geometry.ngeoms**2
    add = geometry.addCollisionPair if tabled else geometry.collisionPairs.append
    for first, second in pairs.tolist():
        add(pin.CollisionPair(first, second))


def _one_by_one(pieces: Sequence[pin.GeometryObject], pairs: Indices) -> pin.GeometryModel:
    geometry = pin.GeometryModel()
    for piece in pieces:
        geometry.addGeometryObject(piece)
    add_pairs(geometry, pairs)
    return geometry


def _counted(count: int, given: Indices | None) -> pin.GeometryModel | None:
    """A model that counts this many pieces and has none yet; None if this Pinocchio serialises in another way."""
    none, two, joined = _tokens(0, False), _tokens(2, False), _tokens(2, True)
    pairs = np.zeros((0, 2), dtype=np.intp) if given is None else given
    words = list(none)
    words[_first_other(none, two)] = str(count)
    if len(pairs):
        number = _first_other(two, joined)
        before = len(joined) - len(two) - 2
        rest = len(two) - number - 1  # words after the number of pairs in a model without pairs
        where = len(words) - rest
        words[where - 1] = str(len(pairs))
        names = np.array([str(index) for index in range(count)], dtype=object)  # many pairs share them
        words[where + 1 : where + 1] = [*joined[number + 2 : number + 2 + before], *names[pairs.ravel()].tolist()]
    table = f"{count} {count}{' -1' * count**2}" if given is None else "0 0"
    geometry = pin.GeometryModel()
    try:
        geometry.loadFromString(f"{' '.join(words)} {table}\n")
    except Exception:  # boost's own, of several kinds
        return None
    whole = (
        geometry.ngeoms == count and not len(geometry.geometryObjects) and len(geometry.collisionPairs) == len(pairs)
    )
    if not whole or any(
        (geometry.collisionPairs[k].first, geometry.collisionPairs[k].second) != tuple(pairs[k].tolist())
        for k in (0, len(pairs) // 2, len(pairs) - 1)
        if len(pairs)
    ):
        return None
    return geometry if geometry.collisionPairMapping.size == (count**2 if given is None else 0) else None


def _first_other(words: list[str], others: list[str]) -> int:
    """Index of the first word that two texts do not share."""
    return next((k for k, (a, b) in enumerate(zip(words, others, strict=False)) if a != b), len(words) - 1)


def _tokens(count: int, paired: bool) -> list[str]:
    """Words of the text of a model with empty entries, the first two paired or not, without the table at its end."""
    empty = [pin.GeometryObject("ab"[k], 0, 0, pin.SE3.Identity(), None) for k in range(count)]
    pairs = np.array([[0, 1]] if paired else [], dtype=np.intp).reshape(-1, 2)
    words: list[str] = _one_by_one(empty, pairs).saveToString().rstrip("\n").split(" ")
    return words[: -2 - count**2]
