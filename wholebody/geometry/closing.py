"""Surfaces that are not closed: closed where faces are missing, told apart from shells.

The boundary of a surface is a set of loops of edges with one face. A loop is a hole where faces are missing: three
edges, or a cap that continues the faces around it. Otherwise it is a mouth. A part with holes, and at most one mouth
that is small against its surface (the leg of a chair without its top), is closed by flat caps. A part with a larger
mouth, or with several (a sheet, a bowl, an open pipe), is a shell and encloses nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.geometry.components import Component, split_components


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
    order: dict[tuple[int, int], list[int]] = {}
    for number, face in enumerate(faces.tolist()):
        for k in range(3):
            first, second = face[k], face[(k + 1) % 3]
            order.setdefault((min(first, second), max(first, second)), []).append(number)
    turned: NDArray[np.int64] = faces.copy()
    seen = np.zeros(len(faces), dtype=bool)
    for start in range(len(faces)):
        if seen[start]:
            continue
        seen[start], queue = True, [start]
        while queue:
            number = queue.pop()
            face = turned[number].tolist()
            for k in range(3):
                first, second = face[k], face[(k + 1) % 3]
                for other in order[min(first, second), max(first, second)]:
                    if seen[other]:
                        continue
                    seen[other] = True
                    there = turned[other].tolist()
                    if any(there[j] == first and there[(j + 1) % 3] == second for j in range(3)):
                        turned[other] = turned[other][::-1]
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
