"""The surface of a field as triangles: one vertex in each cell of a grid that the surface crosses (surface nets).

After Gibson, "Constrained elastic surface nets", MICCAI 1998. Vertices are then moved onto the surface along the
field's gradient. Each edge of the grid that the surface crosses gives one quadrilateral, so the surface is closed.
Where a solid is cut off, the vertices of the cells that the edge of the cut passes are moved onto the edge, as in dual
contouring (Ju et al., "Dual contouring of Hermite data", SIGGRAPH 2002): a coarse grid has a straight edge too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.figures.surface.fields import Field, intersection

BLOCK = 4  # cells along the side of a block; blocks that the surface cannot cross are looked at in their middle alone

STEEPEST = 1.8  # largest slope of a field near its surface; of a distance it is 1


class Triangles(NamedTuple):
    """A closed surface: vertices (n, 3), metres, outward unit normals (n, 3), and faces (m, 3) that wind outwards."""

    vertices: Array
    normals: Array
    faces: NDArray[np.int64]


def triangles(field: Field, low: Array, high: Array, cell: float, cuts: Sequence[Field] = ()) -> Triangles:
    """Surface of what is in a field and in every cut, edges sharp, in a box `low`, `high` (3,), cells of `cell` m."""
    body = field
    for cut in cuts:
        field = intersection(field, cut)
    blocks = np.ceil((high - low) / cell / BLOCK).astype(int) + 1
    values = _values(field, low - cell, blocks, cell)
    values[values == 0.0] = 1e-12
    inside = values < 0.0

    corners = np.stack([_cut(inside, offset) for offset in _CORNERS])
    crossed = corners.any(axis=0) & ~corners.all(axis=0)
    number = np.full(crossed.shape, -1, dtype=np.int64)
    number[crossed] = np.arange(int(crossed.sum()))
    cells = np.argwhere(crossed)
    vertices = _middles(values, cells, cell) + (low - cell)
    faces = _faces(inside, number)
    vertices = _moved(field, vertices, cell)
    normals = gradient(field, vertices)
    if cuts:
        for passed, points in _on_edges(body, cuts, values, cells, low - cell, cell):
            vertices[passed], normals[passed] = points, gradient(body, points)
    return Triangles(vertices, normals, faces)


def coarsened(surface: Triangles) -> NDArray[np.int64]:
    """Return fewer triangles (m, 3) of a closed surface, which stays closed (Rossignac and Borrel 1993)."""
    vertices, faces = surface.vertices, surface.faces
    edges = vertices[faces] - vertices[np.roll(faces, 1, axis=1)]
    cell = 1.6 * np.median(np.linalg.norm(edges, axis=-1))  # 2 saves no more time and loses eyes and lips
    across = np.cross(edges[:, 1], edges[:, 2])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    # cosine of the angle between a triangle and the normal at a corner that is on a sharp edge
    turned = np.einsum("fi,fki->fk", across, surface.normals[faces]) < 0.3
    sharp = np.unique(faces[turned])
    # Of a wall and the cap at its edge each keeps its own vertices: a common one would be behind the wall.
    main = np.abs(surface.normals).argmax(axis=1)
    facing = -1 - 2 * main - (np.take_along_axis(surface.normals, main[:, None], axis=1)[:, 0] > 0.0)
    keys = np.column_stack([np.floor(vertices / cell), facing]).astype(np.int64)
    keys[sharp, 3] = sharp
    return clustered(vertices, faces, keys)


def clustered(vertices: Array, faces: NDArray[np.int64], keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles (k, 3) that are left when vertices of equal keys become the one nearest to their middle."""
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.ravel()
    middle = np.zeros((group.max() + 1, 3))
    np.add.at(middle, group, vertices)
    middle /= np.bincount(group)[:, None]
    order = np.lexsort((np.linalg.norm(vertices - middle[group], axis=1), group))
    first = order[np.unique(group[order], return_index=True)[1]]
    kept: NDArray[np.int64] = first[group][faces]
    whole: NDArray[np.bool_] = (kept != np.roll(kept, 1, axis=1)).all(axis=1)
    return np.compress(whole, kept, axis=0)


def gradient(field: Field, points: Array) -> Array:
    """Unit vectors (n, 3) along which the field grows."""
    slopes = _slopes(field, points, field(points))
    return np.asarray(slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-12))


def _values(field: Field, start: Array, blocks: NDArray[np.int64], cell: float) -> Array:
    """The field on the grid; in blocks that are far from the surface, its value in the block's middle."""
    numbers = np.argwhere(np.ones(tuple(blocks), dtype=bool))
    middles = start + (numbers + 0.5) * BLOCK * cell - 0.5 * cell
    coarse = field(middles)
    near = np.abs(coarse) < STEEPEST * 0.5 * np.sqrt(3.0) * BLOCK * cell
    steps = np.argwhere(np.ones((BLOCK, BLOCK, BLOCK), dtype=bool))
    found = np.repeat(coarse[:, None], BLOCK**3, axis=1)
    points = start + cell * (BLOCK * numbers[near][:, None, :] + steps)
    found[near] = field(points.reshape(-1, 3)).reshape(-1, BLOCK**3)
    shape = (*blocks, BLOCK, BLOCK, BLOCK)
    return np.asarray(found.reshape(shape).transpose(0, 3, 1, 4, 2, 5).reshape(tuple(blocks * BLOCK)))


_CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
_EDGES = [(a, b) for a in range(8) for b in range(8) if a < b and bin(a ^ b).count("1") == 1]


def _cut(values: NDArray[np.generic], offset: tuple[int, int, int]) -> NDArray[np.generic]:
    """The values at one corner of every cell."""
    x, y, z = offset
    nx, ny, nz = values.shape
    return values[x : nx - 1 + x, y : ny - 1 + y, z : nz - 1 + z]


def _middles(values: Array, cells: NDArray[np.int64], cell: float) -> Array:
    """Means of the crossings of each cell's edges, relative to the grid's first corner."""
    total, hits = np.zeros((len(cells), 3)), np.zeros(len(cells))
    at = [values[tuple((cells + corner).T)] for corner in _CORNERS]
    for a, b in _EDGES:
        crossing = (at[a] < 0.0) != (at[b] < 0.0)
        share = np.where(crossing, at[a] / np.where(crossing, at[a] - at[b], 1.0), 0.0)
        start, end = np.array(_CORNERS[a]), np.array(_CORNERS[b])
        total += crossing[:, None] * (start + share[:, None] * (end - start))
        hits += crossing
    return np.asarray((cells + total / hits[:, None]) * cell)


def _faces(inside: NDArray[np.bool_], number: NDArray[np.int64]) -> NDArray[np.int64]:
    """Two triangles for each edge of the grid with one end inside, around it the four cells that share it."""
    found = []
    for axis in range(3):
        other, last = (axis + 1) % 3, (axis + 2) % 3
        order = (axis, other, last)
        here = np.transpose(inside, order)
        cells = np.transpose(number, order)
        a, b = here[:-1, 1:-1, 1:-1], here[1:, 1:-1, 1:-1]
        for leaving in (True, False):
            along, side, up = np.nonzero((a & ~b) if leaving else (~a & b))
            quad = [cells[along, side, up], cells[along, side + 1, up], cells[along, side + 1, up + 1]]
            quad.append(cells[along, side, up + 1])
            ring = quad if leaving else quad[::-1]
            found += [np.stack(ring[:3], axis=1), np.stack([ring[0], ring[2], ring[3]], axis=1)]
    return np.concatenate(found)


def _slopes(field: Field, points: Array, values: Array) -> Array:
    apart = 1e-5  # m: of the points of which the gradient is measured
    return np.column_stack([(field(points + apart * axis) - values) / apart for axis in np.eye(3)])


def _moved(field: Field, vertices: Array, cell: float) -> Array:
    start, points = vertices, vertices
    # the fields are nearly distances, so a step towards the surface removes most of the error
    for _ in range(2):
        values = field(points)
        slopes = _slopes(field, points, values)
        step = values[:, None] * slopes / np.maximum(np.einsum("ij,ij->i", slopes, slopes), 1e-2)[:, None]
        away = points - step - start
        # of the cells' size: a vertex that moves farther could pass another one
        far = np.maximum(np.linalg.norm(away, axis=1, keepdims=True) / (0.5 * cell), 1.0)
        points = start + away / far
    return np.asarray(points)


def _on_edges(
    body: Field, cuts: Sequence[Field], values: Array, cells: NDArray[np.int64], start: Array, cell: float
) -> Iterator[tuple[NDArray[np.int64], Array]]:
    """For each cut, the cells (k,) that its edge with the body passes, and the nearest points (k, 3) of the edge."""
    sides = [body, *cuts]
    middles = start + (cells + 0.5) * cell
    near = np.flatnonzero(np.min([np.abs(cut(middles)) for cut in cuts], axis=0) < STEEPEST * cell)
    at = [values[tuple((cells[near] + corner).T)] for corner in _CORNERS]
    kinds = np.zeros((len(near), len(sides)), dtype=bool)
    for a, b in _EDGES:
        crossing = np.flatnonzero((at[a] < 0.0) != (at[b] < 0.0))
        share = at[a][crossing] / (at[a][crossing] - at[b][crossing])
        here, there = np.array(_CORNERS[a]), np.array(_CORNERS[b])
        points = start + (cells[near[crossing]] + here + share[:, None] * (there - here)) * cell
        kinds[crossing, np.argmax([side(points) for side in sides], axis=0)] = True
    for number, cut in enumerate(cuts):
        passed = near[kinds[:, 0] & kinds[:, 1 + number]]
        points = _nearest_on_both(body, cut, middles[passed])
        # where the edge of a cut is farther from the middle of a cell than its size, its vertex stays
        kept = np.abs(points - middles[passed]).max(axis=1) < cell
        yield passed[kept], points[kept]


def _nearest_on_both(first: Field, second: Field, points: Array) -> Array:
    """The points (n, 3) moved to where both fields are zero, by Newton steps of least length."""
    for _ in range(4):  # newton steps from the middle of a cell to the edge of a cut
        values = np.column_stack([first(points), second(points)])
        rows = np.stack([_slopes(side, points, values[:, k]) for k, side in enumerate((first, second))], axis=1)
        gram = rows @ rows.transpose(0, 2, 1) + 1e-6 * np.eye(2)  # where the two are parallel there is no edge
        points = points - np.einsum("nki,nk->ni", rows, np.linalg.solve(gram, values[:, :, None])[:, :, 0])
    return np.asarray(points)
