"""Which objects overlap, each figure counted as one, and by what each of the two would move to part them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.geometry.penetration import global_depth
from wholebody.scene.scene import Scene


class Overlap(NamedTuple):
    """Two objects that overlap, which have names.

    Attributes:
        depth: (3,) PD_g of the two, out of the second into the first, metres: equation 1 of Schmidl and Lin, over all
            pairs of pieces of the two objects.
        moves_first, moves_second: (3,) translations that the estimate suggests: all of PD_g where only one may move,
            half of it where both may.
        pairs: number of overlapping pairs of pieces.
        point: (3,) in the world, between the two surfaces where they overlap most.
        deepest: metres there. PD_g is much shorter where the normals of several pairs cancel.
        pieces: numbers of the first's and the second's piece there.
    """

    first: str
    second: str
    depth: Array
    moves_first: Array
    moves_second: Array
    pairs: int
    point: Array
    deepest: float
    pieces: tuple[int, int]


def overlaps(scene: Scene, q: Array) -> tuple[Overlap, ...]:
    """Every two objects that overlap at a posture q (nq,), the deepest first.

    The figure with what it carries is one object; overlap of its own parts is not among these. It may move, and so may
    things with a `wb.Body`; all others are fixed. See `Scene.overlapping` for the pairs that are looked at.
    """
    near, owners, objects = scene.overlapping(q), scene.piece_owner, scene.objects
    figure = scene.figure.name

    def whole(owner: str) -> str:
        return owner if owner in objects and objects[owner].segment is None else figure

    found: dict[tuple[str, str], list[tuple[float, Array, Array, tuple[int, int]]]] = {}
    middle = 0.5 * (near.point_a + near.point_b)
    for (i, j), distance, normal, point in zip(
        near.pair.tolist(), near.distance.tolist(), near.normal, middle, strict=True
    ):
        first, second = whole(owners[i]), whole(owners[j])
        if first == second:
            continue
        if first == figure or second != figure:
            found.setdefault((first, second), []).append((-distance, -normal, point, (i, j)))
        else:
            found.setdefault((second, first), []).append((-distance, normal, point, (j, i)))
    made = []
    for (first, second), pairs in found.items():
        depth = global_depth(np.array([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs]))
        free = [name == figure or objects[name].body is not None for name in (first, second)]
        share = 0.5 if all(free) else 1.0
        deepest, _, point, pieces = max(pairs, key=lambda pair: pair[0])
        moves = share * free[0] * depth, -share * free[1] * depth
        made.append(Overlap(first, second, depth, *moves, len(pairs), point, deepest, pieces))
    return tuple(sorted(made, key=lambda one: -float(np.linalg.norm(one.depth))))
