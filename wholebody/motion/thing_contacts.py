"""Where a recorded person holds, leans on or sits on things: found by distance and speed relative to the thing.

A joint of the skeleton touches a thing while it is as near to it as the flesh around the joint is thick, and slow in
the thing's axes. The place on the thing's surface that is nearest to it is what the figure touches too, of whatever
size: relations to things are kept, not distances to the trunk.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.figures.postures import support
from wholebody.geometry.shapes import HalfSpace
from wholebody.motion.footholds import RestLimits, slow
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.windows import long_runs, runs
from wholebody.scene.scene import Scene

NEAR = {"hand": 0.05, "wrist": 0.06, "elbow": 0.07, "knee": 0.09, "pelvis": 0.16}
"""Metres from a joint of these parts to what touches the skin over it, at most; feet stand on the ground."""

SHARES = (1.0, 0.5, 0.0)
"""Places of a hand that touch, from its wrist at 0 to its joint, which may be at the knuckles or beyond the fingers."""

GOES_ON = 1.4  # times as far away as a contact may begin, it ends


class ThingContact(NamedTuple):
    """A part of the body at one place of a thing."""

    role: str  # part of the body, such as "left_hand"
    # first and end: frames, without the last
    first: int
    end: int
    thing: str
    place: Array  # (3,) on the thing's surface, in its axes, metres
    normal: Array  # (3,) of unit length, out of the thing, in its axes
    share: float = 1.0  # of a hand: where between its wrist and its joint it touches
    base: int = 0  # joint of the figure whose axes these are, where the thing is a part of its body; else 0
    away: float = 0.0  # metres from the surface to the skeleton's place, at which a part without pieces is held


def still_things(scene: Scene) -> list[str]:
    """Things of a scene that stand in the world, without floors."""
    standing = (name for name, each in scene.objects.items() if each.segment is None)
    return [name for name in standing if not isinstance(scene.objects[name].shape, HalfSpace)]


class Piece(NamedTuple):
    """A piece of a thing."""

    shape: coal.CollisionGeometry
    at: pin.SE3  # in the thing's axes
    reach: float  # metres from its origin to its farthest point


Placed: TypeAlias = tuple[coal.CollisionGeometry, pin.SE3]
"""A shape, and where it is in the world."""


def least_distance(first: Sequence[Placed], second: Sequence[Placed]) -> float:
    """Signed distance of two sets of shapes, metres."""
    best, request = np.inf, coal.DistanceRequest()
    for one, at in first:
        for other, there in second:
            ours, theirs = (coal.Transform3s(place.rotation, place.translation) for place in (at, there))
            best = min(best, float(coal.distance(one, ours, other, theirs, request, coal.DistanceResult())))
    return best


class Things:
    """Things of a scene, and where they are in each frame."""

    def __init__(self, scene: Scene, tracks: Mapping[str, Array]) -> None:
        """Take the things that stand in the world; `tracks` (n, 7) has placements of those that move."""
        self.tracks = tracks
        self._moving = {name: [pin.XYZQUATToSE3(one) for one in track] for name, track in tracks.items()}
        self._still = {name: scene.objects[name].placement for name in still_things(scene) if name not in tracks}
        pieces, reach = scene.geometry.geometryObjects, scene.pair_table.reach
        self._pieces: dict[str, list[Piece]] = {
            name: [
                Piece(pieces[index].geometry, local, float(reach[index]))
                for index, local in scene.built.pieces_of[name]
            ]
            for name in (*self._moving, *self._still)
        }

    def scaled(self, name: str, scale: float) -> Array:
        """Placements (n, 7) of a thing that moves, on a way of another scale.

        Its lowest point is as many times as high above z = 0 as the scale says; below that it stays as it is.
        """
        track = np.array(self.tracks[name])
        lowest = np.full(len(track), np.inf)
        for shape, local, _ in self._pieces[name]:
            for frame, at in enumerate(self._moving[name]):
                low = -support(shape, at * local, np.array((0.0, 0.0, -1.0)))
                lowest[frame] = min(lowest[frame], low)
        track[:, :2] *= scale
        track[:, 2] += (scale - 1.0) * np.maximum(lowest, 0.0)
        return track

    def at(self, name: str, frame: int) -> pin.SE3:
        """Where a thing is in a frame."""
        return self._moving[name][frame] if name in self._moving else self._still[name]

    def moved(self, frame: int) -> dict[str, pin.SE3]:
        """Where the things that move are in a frame."""
        return {name: track[frame] for name, track in self._moving.items()}

    def pieces(self, name: str, frame: int) -> list[Placed]:
        """Shapes of a thing where they are in a frame."""
        return [(shape, self.at(name, frame) * local) for shape, local, _ in self._pieces[name]]

    def contacts(self, motion: SkeletonMotion, joints: Mapping[str, str]) -> list[ThingContact]:
        """What the skeleton touches; `joints` are those of roles."""
        found = []
        for role, joint in joints.items():
            part = role.split("_")[-1]
            if part not in NEAR or (part == "wrist" and role.replace("wrist", "hand") in joints):
                continue
            path = motion.positions[:, motion.names.index(joint)]
            wrist = joints.get(role.replace("hand", "wrist"), joint)
            start = motion.positions[:, motion.names.index(wrist)]
            shares = SHARES if wrist != joint else SHARES[:1]
            free: Mask = np.ones(len(motion), dtype=bool)
            for name, pieces in self._pieces.items():
                at = [self.at(name, frame) for frame in range(len(motion))]
                local = [
                    np.array([here.actInv(one) for here, one in zip(at, start + share * (path - start), strict=True)])
                    for share in shares
                ]
                away = [np.array([nearest(pieces, one, GOES_ON * NEAR[part])[0] for one in each]) for each in local]
                touches = zip(local, away, strict=True)
                mask = np.any([near_and_slow(*each, NEAR[part], motion.dt) for each in touches], axis=0) & free
                for run in runs(long_runs(mask, max(1, round(RestLimits().least / motion.dt)))):
                    middles = [each[run.first : run.end].mean(axis=0) for each in local]
                    ends = [nearest(pieces, middle) for middle in middles]
                    share, (gap, place, normal) = min(zip(shares, ends, strict=True), key=lambda one: abs(one[1][0]))
                    found.append(ThingContact(role, *run, name, place, normal, share, away=max(gap, 0.0)))
                    free[run.first : run.end] = False
        return sorted(found, key=lambda one: one.first)


def near_and_slow(places: Array, away: Array, most: float, dt: float) -> Mask:
    """(n,) when a point (n, 3) in the axes of a thing, and as far away (n,) from it, touches it."""
    near: Mask = np.zeros(len(places), dtype=bool)
    for run in runs(away <= GOES_ON * most):
        near[run.first : run.end] = bool((away[run.first : run.end] <= most).any())
    return slow(places, dt, RestLimits()) & near


def nearest(pieces: Sequence[Piece], point: Array, within: float = np.inf) -> tuple[float, Array, Array]:
    """Signed distance of a point (3,) to a thing, the nearest place on its surface, and its normal out of it."""
    best = np.inf, point, np.array([0.0, 0.0, 1.0])
    center, ball, request = coal.Transform3s(np.eye(3), point), coal.Sphere(1e-6), coal.DistanceRequest()
    for shape, at, reach in pieces:
        if np.linalg.norm(at.translation - point) - reach > min(within, best[0]):
            continue
        result, where = coal.DistanceResult(), coal.Transform3s(at.rotation, at.translation)
        gap = float(coal.distance(shape, where, ball, center, request, result))
        normal = np.array(result.normal)
        if gap < best[0] and np.isfinite(normal).all() and normal.any():
            best = gap, np.array(result.getNearestPoint1()), normal
    return best


def thickness(pieces: Sequence[pin.GeometryObject], start: Array, along: Array) -> float:
    """Metres from a place (3,) in a joint's axes along a direction (3,) to where the last of its pieces ends."""
    ball, request = coal.Sphere(1e-6), coal.DistanceRequest()
    last = 0.0
    for piece in pieces:
        where, far = coal.Transform3s(piece.placement.rotation, piece.placement.translation), 0.0
        # m: from the joint of the thickest part to its skin
        while far < 0.25:  # advances by the distance to the surface, inside and outside, so it misses no thick part
            center = coal.Transform3s(np.eye(3), start + far * along)
            # a result that is used again keeps the least distance of all
            gap = float(coal.distance(ball, center, piece.geometry, where, request, coal.DistanceResult()))
            if gap < 0.0:
                last = max(last, far - gap)
            far += max(abs(gap), 1e-3)
    return last


def surface_of(scene: Scene, moving: Collection[str]) -> Callable[[Array], float | None]:
    """The height of the first surface of a scene's things below a place (3,), metres; None for none within 2 m.

    Things that are moving are left out.
    """
    owners, geometry = scene.piece_owner, scene.geometry
    still = [
        (piece.geometry, coal.Transform3s(piece.placement.rotation, piece.placement.translation))
        for piece, owner in zip(geometry.geometryObjects, owners, strict=True)
        if owner in scene.objects and scene.objects[owner].segment is None and owner not in moving
    ]
    ball, request = coal.Sphere(1e-6), coal.DistanceRequest()

    def height(place: Array) -> float | None:
        found = list[float]()
        for shape, where in still:
            at = np.array(place)
            while at[2] > place[2] - 2.0:
                result = coal.DistanceResult()
                gap = float(coal.distance(ball, coal.Transform3s(np.eye(3), at), shape, where, request, result))
                if gap < 1e-5:
                    found.append(float(at[2]))
                    break
                down = -float(result.normal[2])  # a convex piece is beyond the plane through its nearest point
                if not down > 1e-6:
                    break
                at[2] -= max(gap / down, 1e-6)
        return max(found, default=None)

    return height
