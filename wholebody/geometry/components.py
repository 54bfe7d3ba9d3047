"""The connected components of a triangle mesh, and whether each is closed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array


class Component(NamedTuple):
    """One connected component of a mesh.

    Attributes:
        vertices: (n, 3), only those of the component.
        faces: (m, 3), oriented outwards if the component is closed.
        closed: whether every edge has exactly two faces, which contain it in opposite directions.
        volume: enclosed volume; meaningless if the component is not closed.
    """

    vertices: Array
    faces: NDArray[np.int64]
    closed: bool
    volume: float


CLOSED = 1e-4
"""Tolerance of the sums that vanish for a closed surface, as a share of its area and volume; files are rounded."""


def enclosed_volume(vertices: Array, faces: NDArray[np.int64]) -> float | None:
    """Volume inside a mesh, overlapping parts counted twice; None if its surface is not closed.

    The area vectors of a closed surface sum to zero, and its volume is the flux of (x, 0, 0), of (0, y, 0) and of
    (0, 0, z), all equal. This needs no table of edges: 10 ms for 100,000 triangles; `split_components` takes a second.
    """
    a, b, c = (vertices[faces[:, k]] - vertices.mean(axis=0) for k in range(3))
    area = 0.5 * np.cross(b - a, c - a)
    total = float(np.linalg.norm(area, axis=1).sum())
    flux = np.einsum("ij,ij->j", (a + b + c) / 3.0, area)
    volume = float(flux.mean())
    closed = np.abs(area.sum(axis=0)).max() <= CLOSED * total and np.ptp(flux) <= CLOSED * abs(volume)
    return abs(volume) if closed and volume != 0.0 else None


def split_components(vertices: Array, faces: NDArray[np.int64]) -> list[Component]:
    """Split a mesh where triangles do not share an edge.

    Vertices at the same position are merged first (STL and normals in OBJ duplicate them); degenerate and repeated
    triangles are dropped. A closed component with inward faces inside another one is a cavity of that one and stays
    with it.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    size = float(np.ptp(vertices, axis=0).max()) or 1.0
    _, first, merged = np.unique(np.round(vertices / (1e-8 * size)), axis=0, return_index=True, return_inverse=True)
    vertices, faces = vertices[first], merged.reshape(-1)[faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    faces = faces[np.sort(np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1])]
    if not len(faces):
        return []
    owner = np.repeat(np.arange(len(faces)), 3)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, edge, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.reshape(-1), kind="stable")
    start = (np.cumsum(count) - count)[count == 2]
    left, right = owner[order[start]], owner[order[start + 1]]
    links = coo_matrix((np.ones(len(left)), (left, right)), shape=(len(faces), len(faces)))
    number, label = connected_components(links, directed=False)
    return _with_cavities([_component(vertices, faces[label == k]) for k in range(number)])


def _component(vertices: Array, faces: NDArray[np.int64]) -> Component:
    used, index = np.unique(faces, return_inverse=True)
    corners, triangles = vertices[used], index.reshape(-1, 3).astype(np.int64)
    directed = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    forward = np.unique(directed, axis=0)
    closed = len(forward) == len(directed) and np.array_equal(forward, np.unique(directed[:, ::-1], axis=0))
    a, b, c = (corners[triangles[:, k]] - corners.mean(axis=0) for k in range(3))
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
    return Component(corners, triangles, closed, volume)


def _with_cavities(parts: list[Component]) -> list[Component]:
    """Join cavities to the component around them, and orient other closed components outwards."""
    solid = [part for part in parts if not part.closed or part.volume > 0]
    for hollow in (part for part in parts if part.closed and part.volume <= 0):
        around = [
            k
            for k, part in enumerate(solid)
            if part.closed and part.volume > -hollow.volume and _winds_around(part, hollow.vertices[0])
        ]
        if around:
            k = min(around, key=lambda i: solid[i].volume)
            outer = solid[k]
            solid[k] = Component(
                np.vstack([outer.vertices, hollow.vertices]),
                np.vstack([outer.faces, hollow.faces + len(outer.vertices)]),
                True,
                outer.volume + hollow.volume,
            )
        elif hollow.volume < 0:
            solid.append(Component(hollow.vertices, hollow.faces[:, ::-1].copy(), True, -hollow.volume))
    return solid


def _winds_around(part: Component, point: Array) -> bool:
    """Whether a point is inside a closed part: solid angles (Van Oosterom and Strackee 1983) sum to 4 pi."""
    a, b, c = (part.vertices[part.faces[:, k]] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    return bool(np.arctan2(above, below).sum() > np.pi)
