"""Kinks of the distance between two surfaces: planes of faces, normals of edges that cross, round pieces that bend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.tasks.axis import across
from wholebody.tasks.surfaces import ACCURACY, Nearest, Surface, between_pieces, outermost

MOST_FACES = 256  # more than a piece ever has
STEP = 2e-3  # m: nor do those that are farther than this from what touches; surfaces farther apart are at no edge
EDGE = 1e-3  # m: by which pieces are moved along each other to find the normals of edges that cross near a contact

NO_EDGES: Array = np.zeros((0, 2, 3))


class FacePlane(NamedTuple):
    """The plane of a face of one piece, and the point of another piece that is farthest behind it."""

    value: float  # how far in front of the plane that point is [m]; not positive where the pieces touch
    normal: Array  # (3,) outward
    point: Array  # (3,) [m]
    key: int  # number of the face


def faces_met(
    first: Surface, second: Surface, pieces: tuple[int, int], state: State, edges: Array = NO_EDGES
) -> list[FacePlane]:
    """The faces of the second surface's nearest piece, as the first's meets them; inner ones are left out."""
    i, j = pieces
    swept = second.swept[j]
    if swept.radius or len(swept.faces) < 2 or not np.isfinite(first.reach[i]):
        return []
    ours, theirs = first.placed(i, state), second.placed(j, state)
    normals = np.vstack([swept.faces[:, :3] @ theirs.rotation.T, edges[:, 0]])
    corners = swept.points @ theirs.rotation.T + theirs.translation
    faces = swept.faces[:, 3] + normals[: len(swept.faces)] @ theirs.translation
    offsets = np.append(faces, (corners @ edges[:, 0].T).max(axis=0))
    points = np.vstack([_behind(first, i, ours, normals[: len(faces)]), edges[:, 1]])
    values = np.einsum("ij,ij->i", normals, points) - offsets
    # most faces of a piece that are looked at, those first that are nearest or passed
    keys, where = np.argsort(-values)[:8], second.where(state)
    apart = where.origins - points[keys, None]
    # m: pieces of one thing that are farther away do not continue its surface
    near = np.sqrt(np.einsum("ijk,ijk->ij", apart, apart)) < np.add(second.reach, 0.05)
    near[:, j] = False
    others = np.flatnonzero(near.any(axis=0)).tolist()
    beyond = near[:, others] & (_heights(second, others, where.places, normals[keys]) > offsets[keys, None] + ACCURACY)
    for n, other in enumerate(others):  # it continues the surface if it is also where the first piece touches
        if beyond[:, n].any():
            met = between_pieces(first.shapes[i], ours, second.shapes[other], where.places[other])
            beyond[:, n] &= met.min_distance <= STEP
    ends = keys[~beyond.any(axis=1)].tolist()
    return [FacePlane(float(values[key]), normals[key], points[key], key) for key in ends]


def crossed_edges(first: Surface, second: Surface, near: Nearest, state: State) -> Array:
    """Normals, from the second surface, and points (k, 2, 3) of edges that cross where sharp pieces slide."""
    # The least depth of crossing edges is along the normal of both, which no face has; round pieces have none.
    i, j = near.pieces
    sharp = first.fixed is None and second.fixed is None and not _roundness(first, i) + _roundness(second, j)
    if not sharp or abs(near.distance) > STEP:
        return NO_EDGES
    a, b, found = first.placed(i, state), second.placed(j, state), []
    for way in across(near.normal)[:2]:
        for step in (-EDGE, EDGE):
            slid = pin.SE3(b.rotation, b.translation + step * way)
            met = between_pieces(first.shapes[i], a, second.shapes[j], slid)
            found.append((-np.array(met.normal), np.array(met.getNearestPoint1())))
    crossed = np.array(found)
    return np.asarray(crossed[np.linalg.norm(crossed[:, 0], axis=1) > 0.5])


def bends(first: Surface, second: Surface, near: Nearest, state: State, radius: float = 0.0) -> Array:
    """Directions (b, 3), each times the root of the distance's second derivative when round pieces slide along it."""
    i, j = near.pieces
    a, b = first.placed(i, state), second.placed(j, state)
    round_by = max(_roundness(first, i), radius) + _roundness(second, j)
    if round_by == 0.0:
        return np.zeros((0, 3))
    along = across(near.normal)[:2]
    # share of the radius, by which pieces are moved along each other to see how their normal turns
    turned, step = np.empty((2, 2)), 1e-2 * round_by
    for row, way in enumerate(along):
        normals = []
        for sign in (-step, step):
            slid = pin.SE3(b.rotation, b.translation + sign * way)
            normals.append(np.array(between_pieces(first.shapes[i], a, second.shapes[j], slid).normal))
        turned[row] = along @ (normals[1] - normals[0]) / (2.0 * step)
    values, vectors = np.linalg.eigh(0.5 * (turned + turned.T))
    values = np.where(np.isfinite(values), np.clip(values, 0.0, 2.0 / round_by), 0.0)
    return np.asarray((np.sqrt(values)[:, None] * vectors.T)[values > 0.0] @ along)


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
    return np.asarray(placed[np.argmin(normals @ placed.T, axis=1)] - swept.radius * normals)


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
