"""A surface divided among the segments that move it, along lines on which two of them move it alike.

Triangles that such a line passes are cut, so that a border is as smooth as the weights, however large the triangles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array

BONES_EACH = 4
"""Bones that move a vertex: as many as a page's shader takes."""


class Bound(NamedTuple):
    """Vertices with what moves them.

    Attributes:
        vertices, normals: (n, 3) metres, and outward unit vectors.
        weights: (n, b) influence of every bone; rows add up to 1.
        strength: (n, s) influence of every segment.
    """

    vertices: Array
    normals: Array
    weights: Array
    strength: Array

    def with_means(self, corners: NDArray[np.int64], shares: Array) -> Bound:
        """Itself and k more vertices: means of (k, c) corners with shares (k, c), which add up to 1."""
        made = [np.concatenate([values, np.einsum("kc,kcd->kd", shares, values[corners])]) for values in self]
        lengths = np.linalg.norm(made[1][len(self.normals) :], axis=1, keepdims=True)
        made[1][len(self.normals) :] /= np.maximum(lengths, 1e-9)
        return Bound(*made)


def strongest(weights: Array) -> tuple[NDArray[np.uint8], Array]:
    """The bones (n, 4) with the greatest weights (n, b), the strongest first, and these (n, 4), which add up to 1."""
    bones = np.argsort(-weights, axis=1, kind="stable")[:, :BONES_EACH]
    chosen = np.take_along_axis(weights, bones, axis=1)
    return bones.astype(np.uint8), np.asarray(chosen / chosen.sum(axis=1, keepdims=True))


def divided(bound: Bound, faces: NDArray[np.int64]) -> tuple[Bound, NDArray[np.int64], NDArray[np.int64]]:
    """Cut the triangles (m, 3) between segments: vertices, (k, 3) triangles, and (k,) the segment of each."""
    # An edge whose ends two segments move most is cut where both move it alike, so that no crack opens.
    owner = bound.strength.argmax(axis=1)
    theirs = owner[faces]
    after = np.roll(theirs, -1, axis=1)
    cuts = (theirs != after).sum(axis=1)  # 0, 2 or 3 of a triangle
    pairs = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)[theirs != after], axis=1)
    if not len(pairs):
        return bound, faces, theirs[:, 0]
    count = len(bound.vertices)
    keys = np.unique(pairs[:, 0] * count + pairs[:, 1])
    ends = np.stack(np.divmod(keys, count), axis=1)
    first, second = ends.T
    lead, back = _lead(bound, owner, first, second), _lead(bound, owner, second, first)
    total = lead + back
    share = np.divide(lead, total, out=np.full(len(keys), 0.5), where=total > 0.0)
    share = np.clip(share, 0.05, 0.95)  # of an edge, on either side of a cut: less makes slivers
    bound = bound.with_means(ends, np.stack([1.0 - share, share], axis=1))

    def cut(a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.int64]:
        wanted = np.minimum(a, b) * count + np.maximum(a, b)
        return np.asarray(count + np.searchsorted(keys, wanted), dtype=np.int64)

    whole = cuts == 0
    made, owners = [faces[whole]], [theirs[whole, 0]]
    # Two segments: the corner that is alone comes first.
    two, of_two = faces[cuts == 2], theirs[cuts == 2]
    alone = np.argmax([(of_two != of_two[:, k : k + 1]).sum(axis=1) == 2 for k in range(3)], axis=0)
    order = (alone[:, None] + np.arange(3)) % 3
    v0, v1, v2 = np.take_along_axis(two, order, axis=1).T
    mine, rest = np.take_along_axis(of_two, order, axis=1)[:, :2].T
    m1, m2 = cut(v0, v1), cut(v0, v2)
    made += [np.stack(corners, axis=1) for corners in ((v0, m1, m2), (m1, v1, v2), (m1, v2, m2))]
    owners += [mine, rest, rest]
    # Three segments: a vertex in the middle.
    three, of_three = faces[cuts == 3], theirs[cuts == 3]
    middle = len(bound.vertices) + np.arange(len(three))
    bound = bound.with_means(three, np.full(three.shape, 1.0 / 3.0))
    for k in range(3):
        here, ahead, behind = three[:, k], three[:, (k + 1) % 3], three[:, k - 1]
        made += [
            np.stack([here, cut(here, ahead), middle], axis=1),
            np.stack([here, middle, cut(here, behind)], axis=1),
        ]
        owners += [of_three[:, k]] * 2
    return bound, np.concatenate(made), np.concatenate(owners)


def _lead(bound: Bound, owner: NDArray[np.int64], here: NDArray[np.int64], there: NDArray[np.int64]) -> Array:
    """(k,) by how much the segment of one end moves that end more than the segment of the other end does."""
    return np.asarray(bound.strength[here, owner[here]] - bound.strength[here, owner[there]])
