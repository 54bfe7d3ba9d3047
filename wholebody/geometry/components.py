"""The connected components of a triangle mesh: whether each is closed, convex, and free of itself; closing them.

The boundary of a surface that is not closed is a set of loops of edges with one face. A loop is a hole where faces are
missing: three edges, or a cap that continues the faces around it. Otherwise it is a mouth. A part with holes, and at
most one mouth that is small against its surface (the leg of a chair without its top), is closed by flat caps. A part
with a larger mouth, or with several (a sheet, a bowl, an open pipe), is a shell and encloses nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Mask
from wholebody.geometry.broad_phase import box_pairs


class Component(NamedTuple):
    """One connected component of a mesh: vertices (n, 3), and faces (m, 3) that are oriented outwards if it is closed.

    In a closed one every edge has exactly two faces, which contain it in opposite directions. Otherwise the enclosed
    volume means nothing.
    """

    vertices: Array
    faces: NDArray[np.int64]
    closed: bool
    volume: float


CLOSED = 1e-4
"""Tolerance of the sums that vanish for a closed surface, as a share of its area and volume; files are rounded."""


def enclosed_volume(vertices: Array, faces: NDArray[np.int64]) -> float | None:
    """Volume inside a mesh, overlapping parts counted twice; None if its surface is not closed."""
    # Its area vectors then do not sum to zero, or the fluxes of (x, 0, 0), (0, y, 0), (0, 0, z) differ.
    a, b, c = (vertices[faces[:, k]] - vertices.mean(axis=0) for k in range(3))
    area = 0.5 * np.cross(b - a, c - a)
    total = float(np.linalg.norm(area, axis=1).sum())
    flux = np.einsum("ij,ij->j", (a + b + c) / 3.0, area)
    volume = float(flux.mean())
    closed = np.abs(area.sum(axis=0)).max() <= CLOSED * total and np.ptp(flux) <= CLOSED * abs(volume)
    return abs(volume) if closed and volume != 0.0 else None


def split_components(vertices: Array, faces: NDArray[np.int64]) -> list[Component]:
    """Split a mesh where triangles do not share an edge; a cavity stays with the component around it."""
    # Vertices at one position are merged (STL repeats them); degenerate and repeated triangles are dropped.
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
            if part.closed
            and part.volume > -hollow.volume
            and winds_around(part.vertices[part.faces], hollow.vertices[0])
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


def winds_around(corners: Array, point: Array) -> bool:
    """Whether a point is inside closed triangles (m, 3, 3): solid angles sum to 4 pi (Van Oosterom, Strackee 1983)."""
    a, b, c = (corners[:, k] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    return bool(np.arctan2(above, below).sum() > np.pi)


FLAT = 1e-6  # share of a mesh's size: triangles nearer to the hull's surface are on it; float32 rounds by 1e-7


def is_convex(vertices: Array, faces: NDArray[np.int64]) -> bool:
    """Whether the triangles (m, 3) of vertices (n, 3), in any order, lie on and cover their hull."""
    from scipy.spatial import ConvexHull, QhullError

    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    size = float(np.ptp(corners, axis=(0, 1)).max())
    middle = corners[area > (FLAT * size) ** 2].mean(axis=1)
    if len(middle) < 4:
        return False
    try:
        hull = ConvexHull(vertices[np.unique(faces)])
    except QhullError:
        return False
    # triangles times faces of the hull; larger meshes are not asked, as that takes seconds
    if len(middle) * len(hull.equations) > 20_000_000:
        return False
    # triangles, which show of almost all meshes that they are not convex
    for some in (middle[:: max(1, len(middle) // 64)], middle):
        # how far they are below the surface of the hull, metres
        below = -(some @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        if not (below <= FLAT * size).all():
            return False
    # share of the hull's area that rounding may leave uncovered
    return _covered(corners, area) >= (1.0 - 1e-3) * float(hull.area)


def _covered(corners: Array, area: Array) -> float:
    """Area of triangles (m, 3, 3), repeated ones counted once."""
    size = float(np.ptp(corners, axis=(0, 1)).max()) or 1.0
    rounded = np.round(corners / (FLAT * size))
    order = np.lexsort(rounded.transpose(2, 0, 1)[::-1], axis=1)
    rounded = np.take_along_axis(rounded, order[:, :, None], axis=1)
    first = np.unique(rounded.reshape(-1, 9), axis=0, return_index=True)[1]
    return 0.5 * float(area[first].sum())


def passes_through_itself(vertices: Array, faces: NDArray[np.int64]) -> bool:
    """Whether an edge of some triangle goes through the inside of another one; common corners do not count."""
    corners = vertices[faces]
    pairs = box_pairs(corners.min(axis=1), corners.max(axis=1))
    for one, other in ((pairs[:, 0], pairs[:, 1]), (pairs[:, 1], pairs[:, 0])):
        for start, end in ((0, 1), (1, 2), (2, 0)):
            ends = faces[one][:, [start, end]]
            apart = ~(ends[:, :, None] == faces[other][:, None, :]).any(axis=(1, 2))
            if _crossing(vertices[ends[apart]], corners[other[apart]]).any():
                return True
    return False


def _crossing(edges: Array, triangles: Array) -> Mask:
    """Whether edges (k, 2, 3) cross the inside of triangles (k, 3, 3); Moeller and Trumbore (1997)."""
    inside = 1e-9  # shares of edge and triangle within which a crossing is at their rim
    along = edges[:, 1] - edges[:, 0]
    u_side, v_side = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    across = np.cross(along, v_side)
    determinant = (u_side * across).sum(axis=1)
    scale = np.linalg.norm(along, axis=1) * np.linalg.norm(u_side, axis=1) * np.linalg.norm(v_side, axis=1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        from_corner = edges[:, 0] - triangles[:, 0]
        u = (from_corner * across).sum(axis=1) / determinant
        turned = np.cross(from_corner, u_side)
        v = (along * turned).sum(axis=1) / determinant
        share = (v_side * turned).sum(axis=1) / determinant
        rim = 1.0 - inside - u - v
    crossing = (u > inside) & (v > inside) & (rim > 0.0) & (share > inside) & (share < 1.0 - inside)
    return np.asarray(crossing & (np.abs(determinant) > 1e-12 * scale))


class Closed(NamedTuple):
    """A part that was closed, and the number of its holes and mouths."""

    part: Component
    loops: int


def closed_up(part: Component) -> Closed | None:
    """The part with its holes closed; None if it encloses nothing."""
    faces = _wound_alike(part.faces)
    loops = _loops(faces)
    if loops is None:
        return None
    a, b, c = (part.vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    area = 0.5 * float(np.linalg.norm(normals, axis=1).sum())
    beside = {(int(face[k]), int(face[(k + 1) % 3])): number for number, face in enumerate(faces) for k in range(3)}
    vertices, caps, mouths = [part.vertices], [faces], []
    for loop in loops:
        corners = part.vertices[loop]
        middle = corners.mean(axis=0)
        fan = 0.5 * np.cross(np.roll(corners, -1, axis=0) - middle, corners - middle)  # the other way round
        size = float(np.linalg.norm(fan, axis=1).sum())
        if not (len(loop) == 3 or _continues(loop, fan.sum(axis=0), normals, beside)):
            mouths.append(size)
        if len(loop) == 3:
            caps.append(np.array([loop[::-1]]))
            continue
        center = sum(map(len, vertices))
        vertices.append(middle[None])
        caps.append(np.array([(loop[(k + 1) % len(loop)], loop[k], center) for k in range(len(loop))]))
    # greatest area of a mouth that is closed, as a share of the part's surface.
    if len(mouths) > 1 or sum(mouths) > 0.1 * area:
        return None
    whole = split_components(np.vstack(vertices), np.vstack(caps).astype(np.int64))
    if len(whole) != 1 or not whole[0].closed or whole[0].volume <= 0.0:
        return None
    return Closed(whole[0], len(loops))


def _continues(
    loop: list[int], cap: Array, normals: Array, beside: dict[tuple[int, int], int]
) -> bool:  # fmt: skip
    around = np.array([normals[beside[loop[k], loop[(k + 1) % len(loop)]]] for k in range(len(loop))])
    lengths = np.linalg.norm(around, axis=1) * np.linalg.norm(cap)
    cosines = around @ cap / np.maximum(lengths, 1e-300)
    # share of a loop's edges at which the cap turns by less than 45 degrees from the face beside it, for a hole.
    return bool((cosines > np.cos(np.pi / 4.0)).mean() >= 0.25)


def _wound_alike(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The faces, each turned so that neighbours go along their common edge in opposite directions."""
    beside: dict[tuple[int, ...], list[int]] = {}
    for number, face in enumerate(faces.tolist()):
        for edge in zip(face, face[1:] + face[:1], strict=True):
            beside.setdefault(tuple(sorted(edge)), []).append(number)
    turned: NDArray[np.int64] = faces.copy()
    left = set(range(len(faces)))
    for start in range(len(faces)):
        queue = [start] if start in left else []
        left.discard(start)
        while queue:
            face = turned[queue.pop()].tolist()
            for edge in zip(face, face[1:] + face[:1], strict=True):
                for other in left.intersection(beside[tuple(sorted(edge))]):
                    there = turned[other].tolist()
                    if edge in zip(there, there[1:] + there[:1], strict=True):
                        turned[other] = turned[other][::-1]
                    left.remove(other)
                    queue.append(other)
    return turned


def _loops(faces: NDArray[np.int64]) -> list[list[int]] | None:
    """Loops of directed edges without an opposite one; None if edges have three faces or loops touch."""
    directed = [(int(face[k]), int(face[(k + 1) % 3])) for face in faces for k in range(3)]
    known = set(directed)
    if len(known) != len(directed):
        return None
    following: dict[int, int] = {}
    for first, second in directed:
        if (second, first) not in known:
            if first in following:
                return None
            following[first] = second
    loops = []
    while following:
        loop = [next(iter(following))]
        while following[loop[-1]] != loop[0]:
            loop.append(following.pop(loop[-1]))
            if loop[-1] not in following:
                return None
        following.pop(loop[-1])
        loops.append(loop)
    return loops
