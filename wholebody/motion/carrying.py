"""A recorded person who stands on a thing that moves, such as a lift, a tram or a swing.

As seen from the thing the person stands still: in its axes feet rest as on a floor, and what stands in the world moves
the other way. So a recording is brought into the world where the thing stays at its first place, and the clip back.
While the thing stands, so does all the rest as seen from it, and feet may go from one to the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.geometry.shapes import Box, HalfSpace
from wholebody.motion.clip import Clip
from wholebody.motion.footholds import RestLimits
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.standing_ground import Ground
from wholebody.motion.surfaces import stands, surface_of
from wholebody.motion.thing_contacts import Things, still_things
from wholebody.scene.scene import Scene

ON = 0.2  # m: as far above what a foot stands on are its ankle and toes at most


def carrier(
    motion: SkeletonMotion, joints: Mapping[str, str], scene: Scene, tracks: Mapping[str, Array], ground: Ground
) -> str:
    """The moving thing on which alone a person stands while it moves, by `joints` of roles; "" for none.

    `ground` is what other surfaces bear: feet that rest there while the thing moves are not carried.
    """
    moving = [name for name, track in tracks.items() if np.ptp(track, axis=0).max() > RestLimits().height]
    things, borne = Things(scene, tracks), dict[str, Mask]()
    for name in moving:
        borne[name] = np.zeros((2, len(motion)), dtype=bool)
        start = things.at(name, 0)
        others = [other for other in scene.objects if other != name]
        surface = surface_of(at_start(scene, {name: tracks[name]}), without=others)
        for foot, role in _roles(joints):
            path = motion.positions[:, motion.names.index(joints[role])]
            touched = things.touched(name, path, ON, motion.dt)
            local = things.within(name, path)
            for frame in np.flatnonzero(touched):
                place = np.array(start.act(local[frame]))
                below = surface(place, 0)
                borne[name][foot, frame] |= below is not None and place[2] - below <= ON
    none: Mask = np.zeros(len(motion), dtype=bool)
    rests = np.any([none, *(ground.rests.get(role, none) for _, role in _roles(joints))], axis=0)
    for name in moving:
        apart = [other for other in moving if np.ptp(_seen_from(tracks[name], tracks[other])) > RestLimits().height]
        if any((borne[other] & ~borne[name]).any() for other in apart):
            continue
        on, moves = borne[name].any(axis=0), ~stands(tracks[name], motion.dt)
        if (on & moves).any() and not (rests & ~on & moves).any():
            return name
    return ""


def _roles(joints: Mapping[str, str]) -> list[tuple[int, str]]:
    """Roles of feet among those that are known: 0 or 1 of the foot, and the role."""
    roles = [(foot, f"{side}_{part}") for foot, side in enumerate(("left", "right")) for part in ("ankle", "toe")]
    return [(foot, role) for foot, role in roles if role in joints]


def _seen_from(track: Array, other: Array) -> Array:
    """How far (n,) a thing with another track (n, 7) is from where it was first, in the axes of the first one."""
    ways = [pin.XYZQUATToSE3(one).actInv(pin.XYZQUATToSE3(two)) for one, two in zip(track, other, strict=True)]
    return np.array([np.linalg.norm(pin.SE3ToXYZQUAT(ways[0].actInv(way))[:6]) for way in ways])


def at_start(scene: Scene, tracks: Mapping[str, Array]) -> Scene:
    """A scene whose things are where they are in the first frame of their tracks (n, 7)."""
    found = scene.__copy__()
    for name, track in tracks.items():
        found.move(name, at=pin.XYZQUATToSE3(track[0]))
    return found


def ways_back(track: Array) -> list[pin.SE3]:
    """From the world in which a thing with a track (n, 7) stays at its first place to the world, frame by frame."""
    start = pin.XYZQUATToSE3(track[0]).inverse()
    return [pin.XYZQUATToSE3(one) * start for one in track]


def as_carried(
    motion: SkeletonMotion, scene: Scene, tracks: Mapping[str, Array], name: str
) -> tuple[SkeletonMotion, Scene, dict[str, Array]]:
    """A recording, a scene, and tracks (n, 7) of what else stands there, where a thing stays at its first place."""
    back, there = ways_back(tracks[name]), at_start(scene, {name: tracks[name]})
    turns, places = (np.array([getattr(way, part) for way in back]) for part in ("rotation", "translation"))
    seen = replace(
        motion,
        positions=np.einsum("nji,nkj->nki", turns, motion.positions - places[:, None]),
        rotations=np.einsum("nji,nkjl->nkil", turns, motion.rotations),
    )
    for floor, thing in scene.objects.items():
        if thing.segment is None and isinstance(thing.shape, HalfSpace):  # which cannot move
            normal = np.array(thing.shape.normal)
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
            slab = pin.SE3(turn, (thing.shape.offset - 0.5) * normal)
            there.remove(floor).add(Box((200.0, 200.0, 1.0)), name=floor, at=thing.placement * slab)  # m
    still = {other: there.objects[other].placement for other in still_things(there) if other not in tracks}
    placed = {other: [pin.XYZQUATToSE3(one) for one in track] for other, track in tracks.items() if other != name}
    placed |= {other: [at] * len(motion) for other, at in still.items()}
    return (
        seen,
        there,
        {
            other: np.array([pin.SE3ToXYZQUAT(way.actInv(at)) for way, at in zip(back, track, strict=True)])
            for other, track in placed.items()
        },
    )


def brought_back(clip: Clip, track: Array, tracks: Mapping[str, Array]) -> Clip:
    """A clip of a figure on a thing that stayed, where the thing moves; with the tracks (n, 7) of all that moves."""
    q = np.array(clip.q)
    for posture, way in zip(q, ways_back(track), strict=True):
        posture[:7] = pin.SE3ToXYZQUAT(way * pin.XYZQUATToSE3(posture[:7]))
    return Clip(clip.figure, q, clip.dt, clip.name, dict(tracks))
