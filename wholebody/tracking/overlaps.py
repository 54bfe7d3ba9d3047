"""Which objects overlap, each figure counted as one, and by what each of the two would move to part them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.geometry.continuous.passing_through import INSIDE
from wholebody.geometry.penetration import global_depth
from wholebody.geometry.pieces import box_corners
from wholebody.scene.scene import Scene

GIVE_WAY = ("figure", "both")
"""Who takes an overlap of the figure with a thing that moves by itself: the figure, or half of it each."""


class Overlap(NamedTuple):
    """Two objects that overlap, which have names.

    Attributes:
        depth: (3,) PD_g of the two, out of the second into the first, metres: equation 1 of Schmidl and Lin, over all
            pairs of pieces of the two objects.
        moves_first, moves_second: (3,) translations that the estimate suggests: all of PD_g where only one gives way,
            half of it where both do.
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


def overlaps(scene: Scene, q: Array, give_way: str = "figure") -> tuple[Overlap, ...]:
    """Every two objects that overlap at a posture q (nq,), the deepest first.

    The figure with what it carries is one object; overlap of its own parts is not among these. It may move, and so may
    things with a `wb.Body`; all others are fixed. Of two that may move both give way, but the figure alone where
    `give_way` says so. See `Scene.overlapping` for the pairs that are looked at.
    """
    near, owners, objects = scene.overlapping(q), scene.piece_owner, scene.objects
    figure = ""  # a thing may have its name

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
        if first == figure and give_way == "figure":
            free[1] = False
        share = 0.5 if all(free) else 1.0
        deepest, _, point, pieces = max(pairs, key=lambda pair: pair[0])
        moves = share * free[0] * depth, -share * free[1] * depth
        made.append(Overlap(first or scene.figure.name, second, depth, *moves, len(pairs), point, deepest, pieces))
    return tuple(sorted(made, key=lambda one: -float(np.linalg.norm(one.depth))))


def make_room(scene: Scene, q: Array) -> None:
    """Move things with a `wb.Body` out of the figure at a posture (nq,) by half of PD_g, where nothing else is."""
    objects, figure = scene.objects, scene.figure.name
    joints = [
        (name, joint.to) for name, thing in objects.items() if thing.body is not None for joint in thing.body.joints
    ]
    held = {name for pair in joints for name in pair}
    for one in overlaps(scene, q, "both"):
        name, way = one.second, one.moves_second
        if one.first != figure or name in held or not way.any():
            continue
        before = objects[name].placement
        way = way * min(1.0, _thinnest(scene, name) / float(np.linalg.norm(way)))
        for _ in range(3):  # the second and the third lead out of what it was moved into, such as the ground
            scene.move(name, at=pin.SE3(before.rotation, before.translation + way))
            others = [
                other.depth if other.first == name else -other.depth
                for other in overlaps(scene, q)
                if name in (other.first, other.second) and figure != other.first and other.deepest > INSIDE
            ]
            if not others:
                break
            way = way + np.sum(others, axis=0)
        else:
            scene.move(name, at=before)


def _thinnest(scene: Scene, name: str) -> float:
    """The least extent of a thing's pieces, metres: moved by less it does not get to the other side of another."""
    geometry = scene.geometry.geometryObjects
    corners = [box_corners(geometry[piece].geometry) for piece, owner in enumerate(scene.piece_owner) if owner == name]
    return min(float(np.ptp(box, axis=0).min()) for box in corners)
