"""Kinks of the distance between two surfaces: planes of faces, normals of edges that cross, round pieces that bend."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, isfinite, sin, sqrt
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.tasks.axis import across
from wholebody.tasks.surfaces import ACCURACY, Nearest, Surface, Where, between_pieces, between_transforms, outermost

MOST_FACES = 256  # more than a piece ever has
STEP = 2e-3  # m: nor do those that are farther than this from what touches; surfaces farther apart are at no edge
EDGE = 1e-3  # m: by which pieces are moved along each other to find the normals of edges that cross near a contact

NO_EDGES: Array = np.zeros((0, 2, 3))


class FacePlanes(NamedTuple):
    """Planes of faces of one piece, and the points of another piece that are farthest behind them."""

    value: Array  # (k,) how far in front of its plane a point is [m]; not positive where the pieces touch
    normal: Array  # (k, 3) outward
    point: Array  # (k, 3) [m]
    key: Indices  # (k,) number of the face


NO_FACES = FacePlanes(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.intp))


def faces_met(
    first: Surface, second: Surface, pieces: tuple[int, int], places: tuple[Where, Where], edges: Array = NO_EDGES
) -> FacePlanes:
    """The faces of the second surface's nearest piece, as the first's meets them; inner ones are left out."""
    i, j = pieces
    swept = second.swept[j]
    if swept.radius or len(swept.faces) < 2 or not isfinite(first.reach[i]):
        return NO_FACES
    where, ours = places[1], places[0].places[i]
    turn, origin = where.places[j].rotation.T, where.origins[j]
    normals = swept.faces[:, :3] @ turn
    offsets = swept.faces[:, 3] + normals @ origin
    points = _behind(first, i, ours, normals)
    if len(edges):
        corners = swept.points @ turn + origin
        offsets = np.append(offsets, (corners @ edges[:, 0].T).max(axis=0))
        normals, points = np.vstack([normals, edges[:, 0]]), np.vstack([points, edges[:, 1]])
    values = np.einsum("ij,ij->i", normals, points) - offsets
    keys = np.argsort(-values)[:8]  # most faces of a piece that are looked at, those first that are nearest or passed
    if len(second.shapes) > 1:
        keys = keys[~_inner(first.shapes[i], ours, second, j, where, (normals[keys], points[keys], offsets[keys]))]
    return FacePlanes(values[keys], normals[keys], points[keys], keys)


def _inner(shape: Any, placed: pin.SE3, second: Surface, piece: int, where: Where, faces: tuple[Array, ...]) -> Mask:
    """(k,) which faces of a piece others of its surface continue, where a shape meets them."""
    normals, points, offsets = faces
    apart = where.origins - points[:, None]
    # m: pieces of one thing that are farther away do not continue its surface
    near = np.sqrt(np.einsum("ijk,ijk->ij", apart, apart)) < np.add(second.reach, 0.05)
    near[:, piece] = False
    others = np.flatnonzero(near.any(axis=0)).tolist()
    if not others:
        return np.zeros(len(normals), dtype=bool)
    beyond = near[:, others] & (_heights(second, others, where.places, normals) > offsets[:, None] + ACCURACY)
    for n, other in enumerate(others):  # it continues the surface if it is also where the shape touches
        if beyond[:, n].any():
            met = between_pieces(shape, placed, second.shapes[other], where.places[other])
            beyond[:, n] &= met.min_distance <= STEP
    return np.asarray(beyond.any(axis=1))


def crossed_edges(first: Surface, second: Surface, near: Nearest) -> Array:
    """Normals, from the second surface, and points (k, 2, 3) of edges that cross where sharp pieces slide."""
    # The least depth of crossing edges is along the normal of both, which no face has; round pieces have none.
    i, j = near.pieces
    sharp = first.fixed is None and second.fixed is None and not _roundness(first, i) + _roundness(second, j)
    if not sharp or abs(near.distance) > STEP:
        return NO_EDGES
    met = _slid(first, second, near, across(near.normal), EDGE)
    crossed = np.array([(each.normal, each.getNearestPoint1()) for each in met])
    crossed[:, 0] *= -1.0
    return np.asarray(crossed[np.einsum("ij,ij->i", crossed[:, 0], crossed[:, 0]) > 0.25])


def bends(first: Surface, second: Surface, near: Nearest, radius: float = 0.0) -> Array:
    """Directions (b, 3), each times the root of the distance's second derivative when round pieces slide along it."""
    i, j = near.pieces
    round_by = max(_roundness(first, i), radius) + _roundness(second, j)
    if round_by == 0.0:
        return np.zeros((0, 3))
    along = across(near.normal)
    # share of the radius, by which pieces are moved along each other to see how their normal turns
    step = 1e-2 * round_by
    normals = np.array([met.normal for met in _slid(first, second, near, along, step)])
    (xx, xy), (yx, yy) = ((normals[1::2] - normals[::2]) @ along[:2].T / (2.0 * step)).tolist()
    turn, mean = 0.5 * atan2(xy + yx, xx - yy), 0.5 * (xx + yy)  # of the first principal direction
    swing, found = 0.5 * hypot(xy + yx, xx - yy), []
    for value, x, y in ((mean - swing, -sin(turn), cos(turn)), (mean + swing, cos(turn), sin(turn))):
        if value > 0.0:  # not where it is NaN
            root = sqrt(min(value, 2.0 / round_by))
            found.append((root * x, root * y))
    return np.array(found).reshape(-1, 2) @ along[:2]


def _slid(first: Surface, second: Surface, near: Nearest, along: Array, step: float) -> list[Any]:
    """What coal finds with the second piece slid back and on along the first and the second of some ways (k, 3)."""
    i, j = near.pieces
    at, place = near.places
    ours, theirs, origin, found = coal.Transform3s(at), coal.Transform3s(place), place.translation, []
    for way in (-step * along[0], step * along[0], -step * along[1], step * along[1]):
        theirs.setTranslation(origin + way)
        found.append(between_transforms(first.shapes[i], ours, second.shapes[j], theirs))
    return found


def _roundness(surface: Surface, number: int) -> float:
    """Radius by which a piece is round [m]; 0 for a point and what has flat faces, the least of an ellipsoid."""
    if surface.fixed is not None:
        return 0.0
    swept = surface.swept[number]
    return float(swept.radius) if len(swept.points) or not np.isfinite(swept.reach) else 0.5 * float(swept.width)


def _behind(surface: Surface, number: int, placement: pin.SE3, normals: Array) -> Array:
    """The points (k, 3) of a piece that are farthest against directions (k, 3)."""
    swept = surface.swept[number]
    if len(swept.points) == 0:
        return np.vstack([outermost(surface.shapes[number], placement, -normal, swept) for normal in normals])
    placed = swept.points @ placement.rotation.T + placement.translation
    behind: Array = placed[(normals @ placed.T).argmin(axis=1)]
    return behind - swept.radius * normals if swept.radius else behind


def _heights(surface: Surface, pieces: Sequence[int], places: Sequence[pin.SE3], ways: Array) -> Array:
    """How far pieces (n,) reach along directions (m, 3) from the world's origin, (m, n) [m]."""
    found = np.empty((len(ways), len(pieces)))
    for n, k in enumerate(pieces):
        swept, place = surface.swept[k], places[k]
        along = ways @ place.rotation
        if not np.isfinite(swept.reach):
            found[:, n] = np.inf
        elif len(swept.points):
            found[:, n] = (along @ swept.points.T).max(axis=1) + swept.radius + ways @ place.translation
        else:  # an ellipsoid
            found[:, n] = np.linalg.norm(along * swept.half, axis=1) + ways @ place.translation
    return found
