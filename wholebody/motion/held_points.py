"""Points of a figure that may rest: heels and toes of soles, hands and knees, and parts that touch things."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, brief
from wholebody.figures.figure import Figure
from wholebody.geometry.pieces import box_corners, swept_points
from wholebody.motion.roles import Roles, figure_roles
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.standing_ground import Ground
from wholebody.motion.structure import upright


@dataclass(frozen=True, eq=False)
class HeldPoint:
    """A point of a figure that may rest."""

    __repr__ = brief

    role: str  # of the skeleton's joint by which it rests
    foot: str  # "left" or "right" for a point of a sole, which comes down to the ground; else ""
    joint: int  # index of the joint that carries it
    place: Array  # (3,) in the joint's frame, metres
    edge: bool = False  # whether it is on the edge of a sole, so that its height alone counts: soles come down flat
    lifts: bool = False  # whether its height does not count: the sole lifts there when the foot rolls over an edge
    above: float = 0.0  # height above the sole, metres
    thing: bool = False  # whether it touches things, and not the ground
    share: float = 1.0  # of a hand that touches things: where it is between wrist and hand
    base: int = 0  # index of the joint in whose axes it is held; 0 is the world


def held_points(figure: Figure, roles: Roles, ground: Ground) -> list[HeldPoint]:
    """The points of a figure that rest at some time."""
    found, resting, own = [], {role for role, mask in ground.rests.items() if mask.any()}, roles.places(figure)
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, upright(figure))
    for side in ("left", "right"):
        heel, toe = f"{side}_ankle", f"{side}_toe"
        told = toe if toe in ground.rests else heel  # without toes the sole rests as the ankle does
        if heel in roles.frames and {heel, told} & resting:
            found += _sole(figure, data, roles, side, told)
        for role in (f"{side}_{part}" for part in ("hand", "wrist", "knee")):
            if role in resting and role in roles.frames:
                found.append(HeldPoint(role, "", *own[role]))
    return found


def touching_points(
    figure: Figure,
    roles: Roles,
    motion: SkeletonMotion,
    wanted: Iterable[tuple[str, float, int]],
    joints: Mapping[str, str],
) -> list[HeldPoint]:
    """Points that touch things: of a hand as far from the wrist as the skeleton's; `wanted`: roles, shares, bases."""
    found, data, own = [], figure.model.createData(), figure_roles(figure)
    pin.framesForwardKinematics(figure.model, data, upright(figure))
    placed = roles.places(figure)
    places = {role: np.array(data.oMi[joint].act(at)) for role, (joint, at) in placed.items()}
    for role, share, base in dict.fromkeys(wanted):
        elbow, wrist, hand = (f"{role.split('_')[0]}_{part}" for part in ("elbow", "wrist", "hand"))
        carrier = role if role in places else wrist
        joint = placed[carrier][0]
        if carrier == wrist and hand not in own and own[wrist] != own.get(elbow):
            found.append(HeldPoint(role, "", *_end(figure, joint), thing=True, share=share, base=base))
            continue
        place = places[carrier]
        if role == hand and {elbow, wrist} <= places.keys():
            way, forearm = place - places[wrist], float(np.linalg.norm(places[wrist] - places[elbow]))
            far = _length(motion, joints, wrist, role) / _length(motion, joints, elbow, wrist) * forearm
            most = max(float(np.linalg.norm(way)), 1e-9)
            place = places[wrist] + share * min(far / most, 1.0) * way
        within = np.array(data.oMi[joint].actInv(place))
        found.append(HeldPoint(role, "", joint, within, thing=True, share=share, base=base))
    return found


def _end(figure: Figure, joint: int) -> tuple[int, Array]:
    """The last joint of an arm before its fingers, from its wrist on, and the middle (3,) of what it carries."""
    parents = np.array(figure.model.parents[1:])
    while len(below := np.flatnonzero(parents == joint)) == 1:
        joint = int(below[0]) + 1
    pieces = [piece for piece in figure.geometry.geometryObjects if piece.parentJoint == joint]
    corners = [piece.placement.act(corner) for piece in pieces for corner in box_corners(piece.geometry)]
    return joint, 0.5 * (np.min(corners, axis=0) + np.max(corners, axis=0)) if corners else np.zeros(3)


def _sole(figure: Figure, data: pin.Data, roles: Roles, side: str, told: str) -> list[HeldPoint]:
    """Heel and front of a sole, where the skeleton's joint is slow, and both edges; the front rests as role `told`."""
    own, ankle, heel = roles.places(figure), f"{side}_ankle", f"{side}_heel"
    frame = heel if heel in figure.frames else roles.frames[ankle]
    foot = int(figure.model.frames[figure.frame_id(frame)].parentJoint)
    every = np.concatenate([part_corners(figure, data, foot), data.oMi[foot].translation[None]])
    low, flat = float(every[:, 2].min()), _flat(every)
    (back, right), (front, left) = flat.min(axis=0), flat.max(axis=0)
    middle, toes, tip = 0.5 * (left + right), foot, front
    joint, place = own[ankle]
    below = float(np.clip(data.oMi[joint].act(place)[0], back, front))
    hinge = np.array([front, middle, low])
    joint, place = own.get(f"{side}_toe", (foot, place))
    if joint != foot and len(more := part_corners(figure, data, joint)):
        hinge, toes, tip = data.oMi[joint].act(place), joint, float(_flat(more)[:, 0].max())
    rests = np.array([below, middle, hinge[2]])  # as high as the hinge, so that both keep their distance from above
    found, above = list[HeldPoint](), float(hinge[2] - low)
    for role, at, carrier, edge in ((ankle, rests, foot, back), (told, hinge, toes, tip)):
        lifts = at is rests and below > back
        found.append(HeldPoint(role, side, foot, data.oMi[foot].actInv(at), lifts=lifts, above=above))
        for y in (left, right):
            local = data.oMi[carrier].actInv(np.array([edge, y, low]))
            found.append(HeldPoint(role, side, carrier, local, edge=True))
    return found


def part_corners(figure: Figure, data: pin.Data, joint: int) -> Array:
    """(k, 3) lowest points, of spheres and edges too, of the pieces that a joint carries; none without pieces."""
    found = []
    for piece in figure.geometry.geometryObjects:
        if piece.parentJoint == joint:
            swept, at = swept_points(piece.geometry), data.oMi[joint] * piece.placement
            if len(swept.points):
                found.append(swept.points @ at.rotation.T + at.translation - [0.0, 0.0, swept.radius])
    return np.concatenate(found or [np.zeros((0, 3))])


def _flat(corners: Array) -> Array:
    """(k, 2) where the lowest of corners are, which are a sole."""
    return np.asarray(corners[corners[:, 2] <= corners[:, 2].min() + 0.002, :2])  # m


def _length(motion: SkeletonMotion, joints: Mapping[str, str], first: str, last: str) -> float:
    """Metres from one joint of a skeleton to another, in the middle of its frames; never zero."""
    start, end = (motion.positions[:, motion.names.index(joints[role])] for role in (first, last))
    return max(float(np.median(np.linalg.norm(end - start, axis=1))), 1e-6)
