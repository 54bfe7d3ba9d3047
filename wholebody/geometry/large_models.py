"""Geometry models of thousands of pieces.

Pinocchio keeps an n x n table of pair numbers and copies it whenever a piece is added: 1000 pieces take 0.6 s, 5000
more than a minute. A model of n empty entries can be read from text at once and filled afterwards: under a second for
5000.
"""

from __future__ import annotations

from collections.abc import Sequence

import pinocchio as pin

MANY = 300  # number of pieces from which entries are made at once; as many are added one by one in 20 ms


def geometry_model(pieces: Sequence[pin.GeometryObject]) -> pin.GeometryModel:
    """Pinocchio's geometry model of these pieces, in this order, without pairs.

    Args:
        pieces: each with a name of its own.
    """
    if len(pieces) < MANY:
        return _one_by_one(pieces)
    geometry = _places(len(pieces))
    if geometry is None:
        return _one_by_one(pieces)
    for index, piece in enumerate(pieces):
        geometry.geometryObjects[index] = piece
    return geometry


def _one_by_one(pieces: Sequence[pin.GeometryObject]) -> pin.GeometryModel:
    geometry = pin.GeometryModel()
    for piece in pieces:
        geometry.addGeometryObject(piece)
    return geometry


def _places(count: int) -> pin.GeometryModel | None:
    """A model of empty entries; None if this Pinocchio serialises its models in another way.

    Each further piece adds the same text to a model's text; only two counts change.
    """
    one, two = _tokens(1), _tokens(2)
    added = len(two) - len(one)
    common = 0
    while common < len(one) and one[-1 - common] == two[-1 - common]:
        common += 1
    at = len(one) - common
    head = [str(count) if (a, b) == ("1", "2") else a for a, b in zip(one[:at], two[:at], strict=True)]
    body = " ".join([*head, *two[at : at + added] * (count - 1), *one[at:]])
    geometry = pin.GeometryModel()
    try:
        geometry.loadFromString(f"{body} {count} {count}{' -1' * count**2}\n")
    except Exception:  # boost's own, of several kinds
        return None
    whole = geometry.ngeoms == len(geometry.geometryObjects) == count
    return geometry if whole and geometry.collisionPairMapping.shape == (count, count) else None


def _tokens(count: int) -> list[str]:
    """Words of the text of a model with empty entries, without the table at its end."""
    empty = [pin.GeometryObject("ab"[k], 0, 0, pin.SE3.Identity(), None) for k in range(count)]
    words: list[str] = _one_by_one(empty).saveToString().rstrip("\n").split(" ")
    return words[: -2 - count**2]
