"""Parts of a body's surface: each a closed surface of one colour, and how strongly each bone moves its vertices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.view.surface.borders import BONES_EACH, strongest
from wholebody.view.surface.fields import Field
from wholebody.view.surface.nets import Triangles, triangles


class Claim(NamedTuple):
    """The region of a bone: its influence on a point is exp(-distance / softness).

    Attributes:
        bone: name of a segment, or "<segment>/half", which turns by half of what the segment turns.
        field: distance from the region.
        softness: metres over which the influence fades by e: a larger value bends joints over a longer stretch.
    """

    bone: str
    field: Field
    softness: float = 0.014


class Garment(NamedTuple):
    """A part of one colour, before it is made.

    Attributes:
        name: such as "shirt".
        color: red, green, blue.
        field: its solid in the world of the body's binding posture.
        low: (3,) least corner of a box around it.
        high: (3,) greatest corner.
        cell: size of the grid's cells, metres.
        claims: regions of the bones that move it.
        cuts: half spaces that end it at sharp edges: hem, collar, cuffs.
    """

    name: str
    color: tuple[float, float, float]
    field: Field
    low: Array
    high: Array
    cell: float
    claims: Sequence[Claim]
    cuts: Sequence[Field] = ()


class Part(NamedTuple):
    """A closed surface in the binding posture.

    Attributes:
        name: such as "shirt".
        color: red, green, blue.
        surface: vertices, normals, faces in the world of the binding posture.
        bones: (n, 4) indices of bones of each vertex, the strongest first.
        weights: (n, 4) their influences, which add up to 1.
    """

    name: str
    color: tuple[float, float, float]
    surface: Triangles
    bones: NDArray[np.uint8]
    weights: Array


def made(garment: Garment, order: Sequence[str]) -> Part:
    """Return a garment's surface.

    Args:
        garment: the garment.
        order: names of all bones of the body.
    """
    surface = triangles(garment.field, garment.low, garment.high, garment.cell, garment.cuts)
    return Part(garment.name, garment.color, surface, *influences(surface.vertices, garment.claims, order))


def influences(points: Array, claims: Sequence[Claim], order: Sequence[str]) -> tuple[NDArray[np.uint8], Array]:
    """Return the strongest bones (n, 4) of points (n, 3), and their influences (n, 4), which add up to 1."""
    place = {bone: number for number, bone in enumerate(order)}
    strength = np.full((len(points), max(len(order), BONES_EACH)), -np.inf)
    for claim in claims:
        column = place[claim.bone]
        strength[:, column] = np.maximum(strength[:, column], -claim.field(points) / claim.softness)
    return strongest(np.exp(strength - strength.max(axis=1, keepdims=True)))


def bounds(points: Sequence[Array], margin: float) -> tuple[Array, Array]:
    """Return the corners of the box around points (3,), `margin` metres larger on every side."""
    every = np.array(points)
    return every.min(axis=0) - margin, every.max(axis=0) + margin
