"""Where a recorded person touches things, and with the hands the own body.

A joint of the skeleton touches a thing while it is as near to it as the flesh around the joint is thick, and slow in
the thing's axes. The place on the thing's surface that is nearest to it is what the figure touches too, of whatever
size: relations to things are kept, not distances to the trunk.

Of a hand on the own body (the other hand, the head, the trunk or a thigh) the skeleton says when it rests there, and
from which side. The free fit of the figure says which of its pieces is there. Goals there move with the piece, so that
a hand that rests does not hold the body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask, with_values
from wholebody.figures.figure import Figure
from wholebody.figures.postures import support
from wholebody.geometry.shapes import HalfSpace
from wholebody.motion.footholds import RestLimits, slow
from wholebody.motion.held_points import HeldPoint
from wholebody.motion.roles import Roles
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.solids import Placed, Solid
from wholebody.motion.windows import long_runs, runs
from wholebody.scene.scene import Scene

NEAR = {"hand": 0.05, "wrist": 0.06, "elbow": 0.07, "knee": 0.09, "pelvis": 0.16}
"""Metres from a joint of these parts to what touches the skin over it, at most; feet stand on the ground."""

SHARES = (1.0, 0.5, 0.0)
"""Places of a hand that touch, from its wrist at 0 to its joint, which may be at the knuckles or beyond the fingers."""

GOES_ON = 1.4  # times as far away as a contact may begin, it ends


MANY = 1000  # pieces of a thing from which a frame takes seconds


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


def said_of_many(scene: Scene) -> str:
    """What is known of things of very many pieces; empty without one."""
    counts = {name: len(scene.built.pieces_of[name]) for name in still_things(scene)}
    return "; ".join(
        f"{name} is {count} pieces, which may take seconds a frame: a mesh that encloses nothing, such as a scan, is a "
        "piece a triangle; close it, or give hulls of its parts"
        for name, count in counts.items()
        if count > MANY
    )


class Things:
    """Things of a scene, and where they are in each frame."""

    def __init__(self, scene: Scene, tracks: Mapping[str, Array]) -> None:
        """Take the things that stand in the world; `tracks` (n, 7) has placements of those that move."""
        self.tracks = tracks
        self._moving = {name: [pin.XYZQUATToSE3(one) for one in track] for name, track in tracks.items()}
        self._still = {name: scene.objects[name].placement for name in still_things(scene) if name not in tracks}
        pieces = scene.geometry.geometryObjects
        self._solids = {
            name: Solid((pieces[index].geometry, local) for index, local in scene.built.pieces_of[name])
            for name in (*self._moving, *self._still)
        }

    def scaled(self, name: str, scale: float) -> Array:
        """Placements (n, 7) of a moving thing on a scaled way; its lowest point's height above z = 0 is scaled too."""
        track = np.array(self.tracks[name])
        lowest = np.full(len(track), np.inf)
        for shape, local in self._solids[name].placed:
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

    def distance(self, name: str, frame: int, shapes: Sequence[Placed]) -> float:
        """Signed distance of shapes in the world to a thing in a frame, metres."""
        back = self.at(name, frame).inverse()
        return self._solids[name].distance([(shape, back * at) for shape, at in shapes])

    def within(self, name: str, path: Array) -> Array:
        """A point's path (n, 3) in a thing's axes."""
        return np.array([self.at(name, frame).actInv(place) for frame, place in enumerate(path)])

    def touched(self, name: str, path: Array, most: float, dt: float) -> Mask:
        """(n,) when a point of path (n, 3) goes with a thing, at `most` metres from it where that begins."""
        local = self.within(name, path)
        away = np.array([self._solids[name].nearest(place, GOES_ON * most)[0] for place in local])
        return long_runs(near_and_slow(local, away, most, dt), max(1, round(RestLimits().least / dt)))

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
            for name, solid in self._solids.items():
                local = [self.within(name, start + share * (path - start)) for share in shares]
                away = [np.array([solid.nearest(one, GOES_ON * NEAR[part])[0] for one in each]) for each in local]
                touches = zip(local, away, strict=True)
                mask = np.any([near_and_slow(*each, NEAR[part], motion.dt) for each in touches], axis=0) & free
                for run in runs(long_runs(mask, max(1, round(RestLimits().least / motion.dt)))):
                    middles = [each[run.first : run.end].mean(axis=0) for each in local]
                    ends = [solid.nearest(middle) for middle in middles]
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


BODY = {
    "head": ("head", "head", 0.13),
    "trunk": ("hips", "shoulders", 0.13),
    "pelvis": ("left_hip", "right_hip", 0.11),
    "left thigh": ("left_hip", "left_knee", 0.1),
    "right thigh": ("right_hip", "right_knee", 0.1),
}
"""Of parts that hands touch both ends of a bone, and how far a hand that touches them is from it, metres."""

# s that a hand rests on the head or another hand, and on what hands pass: arms that swing little are slow for 0.4 s
RESTS, PASSED = 0.2, 0.5
HAND = 0.06  # m: as far from each other are hands that touch; half of it is a hand without pieces thick
ARM = ("shoulder", "elbow", "wrist", "hand")


def hand_shares(joints: Mapping[str, str]) -> dict[str, float]:
    """Roles of a skeleton's hands, of wrists without one, and where between wrist and joint they touch a body."""
    found = {}
    for hand, wrist in (("left_hand", "left_wrist"), ("right_hand", "right_wrist")):
        if {hand, wrist} & joints.keys():
            found[hand if hand in joints else wrist] = 0.5 if {hand, wrist} <= joints.keys() else 1.0
    return found


def own_rests(
    motion: SkeletonMotion,
    joints: Mapping[str, str],
    shares: Mapping[str, float],
    busy: Sequence[tuple[str, int, int]],
) -> list[ThingContact]:
    """When hands touch their own body, by roles of `joints` and `shares`, but where `busy` (role, first, end)."""
    # normals are in the world, in the middle frame of each; the places are not said
    at = {role: motion.positions[:, motion.names.index(joint)] for role, joint in joints.items()}
    turns = {role: motion.rotations[:, motion.names.index(joint)] for role, joint in joints.items()}
    for part in ("hip", "shoulder"):
        if {f"left_{part}", f"right_{part}"} <= at.keys():
            at[f"{part}s"] = 0.5 * (at[f"left_{part}"] + at[f"right_{part}"])
            turns[f"{part}s"] = turns.get("pelvis", turns[f"left_{part}"])
    found = list[ThingContact]()
    free: dict[str, Mask] = {role: np.ones(len(motion), dtype=bool) for role in shares}
    for role, frame, last in busy:
        if role in free:
            free[role][frame:last] = False
    wrists = {role: wrist if (wrist := role.replace("hand", "wrist")) in at else role for role in shares}
    parts = {role: (wrists[role], role, HAND) for role in shares} | BODY
    for role, share in shares.items():
        place = at[wrists[role]] + share * (at[role] - at[wrists[role]])
        for name, (start, end, reach) in parts.items():
            if name == role or not {start, end} <= at.keys():
                continue
            way = place - _on_bone(place, at[start], at[end])
            far = np.linalg.norm(way, axis=1)
            local = np.einsum("nji,nj->ni", turns[start], place - at[start])
            # what is farther by over 20 mm is not touched: hands swing past hips
            near = near_and_slow(local, far - reach, 0.02, motion.dt) & free[role] & (far > 1e-3)
            near &= free.get(name, near)
            least = RESTS if name in {"head", *shares} else PASSED
            for run in runs(long_runs(near, max(1, round(least / motion.dt)))):
                normal = way[(run.first + run.end) // 2]
                found.append(ThingContact(role, *run, name, np.zeros(3), normal / np.linalg.norm(normal), share))
                for taken in {role, name} & free.keys():
                    free[taken][run.first : run.end] = False
    return found


def _on_bone(places: Array, start: Array, end: Array) -> Array:
    """(n, 3) what is nearest to points (n, 3) on lines between two points (n, 3)."""
    way = end - start
    along = np.einsum("ni,ni->n", places - start, way) / np.maximum(np.einsum("ni,ni->n", way, way), 1e-12)
    return np.asarray(start + np.clip(along, 0.0, 1.0)[:, None] * way)


def own_contacts(
    rests: Sequence[ThingContact], figure: Figure, roles: Roles, hands: Mapping[str, HeldPoint], free: Sequence[Array]
) -> list[ThingContact]:
    """The same of a figure, in its joints' axes: where `hands` are in the middle of each, in postures `free` (nq,)."""
    model, data, pieces = figure.model, figure.model.createData(), dict[int, list[Placed]]()
    for piece in figure.geometry.geometryObjects:
        pieces.setdefault(piece.parentJoint, []).append((piece.geometry, piece.placement))
    solids = {joint: Solid(placed) for joint, placed in pieces.items()}
    arms = {joint for role, (joint, _) in roles.places(figure).items() if role.split("_")[-1] in ARM}
    body, found = [joint for joint in solids if not arms & set(model.supports[joint])], []
    for rest in rests:
        hand, other = hands[rest.role], hands.get(rest.thing)
        if other is None and not body:
            continue  # a body without pieces has nothing to touch
        pin.forwardKinematics(model, data, free[(rest.first + rest.end) // 2])
        here = data.oMi[hand.joint].act(hand.place)
        near = {joint: solids[joint].nearest(data.oMi[joint].actInv(here))[0] for joint in body}
        base = min(near, key=lambda joint: near[joint]) if other is None else other.joint
        start = here if other is None else data.oMi[base].act(other.place)
        if base in solids:
            # m: so far outside of a part, the nearest place on it is on the side that the hand came from
            _, place, normal = solids[base].nearest(data.oMi[base].actInv(start + 0.1 * rest.normal))
        else:
            place = data.oMi[base].actInv(start + 0.5 * HAND * rest.normal)
            normal = data.oMi[base].rotation.T @ rest.normal
        found.append(with_values(rest, place=place, normal=normal, base=base, away=0.5 * HAND))
    return found
