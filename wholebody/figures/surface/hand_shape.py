"""The solid of a hand with its fingers, from the hand's table; the person's hand and the hand on its own share it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.anthropometry import FINGER_BASES, Dimensions, Person, keyed_hand
from wholebody.figures.figure import Figure
from wholebody.figures.hand import FINGERS, PARTS, hand_figure_of, part_radius
from wholebody.figures.surface.fields import Field, ellipsoid, placed, round_cone, union
from wholebody.figures.surface.garments import Claim


class HandShape(NamedTuple):
    """A hand in its own frame."""

    field: Field  # the solid in the binding posture
    claims: tuple[Claim, ...]  # regions of the bones "<side>_hand", "<side>_forearm" and of every finger's segments
    corners: tuple[Array, ...]  # points that its box contains
    bind: dict[str, Array]  # placement (4, 4) of each of its segments in the binding posture
    rest: dict[str, Array]  # the same with the fingers as a person holds them whose hand is one segment


def hand_shape(person: Person, side: str) -> HandShape:
    """Return the hand of a person."""
    size, figure = Dimensions(person), hand_figure_of(person, side)
    # Degrees of abduction in the binding posture: fingers side by side would melt into one.
    apart = {"index": 14.0, "ring": 14.0, "little": 18.0}
    spread = {f"{side}_{finger}_mcp_abduction": angle for finger, angle in apart.items()}
    bind, rest = _placements(figure, side, spread), _placements(figure, side, _resting(side))
    _bring_thumb(rest, side, np.array([size.thumb.x, 0.0, -size.thumb.tip]))
    sign = 1.0 if side == "left" else -1.0
    palm = _palm(size, sign)
    fingers: list[Field] = []
    claims = [Claim(f"{side}_hand", palm, 0.004)]
    for finger, parts in FINGERS.items():
        bones: list[Field] = []
        for part in parts:
            segment = f"{side}_{finger}_{PARTS[part]}"
            shape = placed(_bone(size, finger, part), bind[segment])
            bones.append(shape)
            claims.append(Claim(segment, shape, 0.0035))
        fingers.append(union(bones))
    wrist = person.radius("wrist")
    above = 0.05  # m: of forearm that the surface has above the wrist; a sleeve covers it
    stump = union(
        [round_cone((x, 0.0, above), (x, 0.0, -0.004), 0.56 * wrist, 0.72 * wrist) for x in (-0.3 * wrist, 0.3 * wrist)]
    )
    claims.append(Claim(f"{side}_forearm", lambda points: np.maximum(-points[:, 2], 0.0), 0.006))
    thenar = _thenar(size, sign, bind[f"{side}_thumb_proximal"])
    solid = union([union([union(fingers, 0.002), palm], 0.007), thenar], 0.010)
    ends = [bind[f"{side}_{finger}_distal"] @ [0.0, 0.0, -0.03, 1.0] for finger in FINGERS]
    corners = (*(end[:3] for end in ends), np.array([-0.05, 0.0, 0.0]), np.array([0.03, 0.0, above + 0.02]))
    return HandShape(union([solid, stump], 0.012), tuple(claims), corners, bind, rest)


def _placements(figure: Figure, side: str, degrees: dict[str, float]) -> dict[str, Array]:
    q = figure.with_joints(pin.neutral(figure.model), {name: np.radians(angle) for name, angle in degrees.items()})
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, figure.clamp(q))
    root = data.oMf[figure.frame_id(f"{side}_hand")].inverse()
    return {name: np.array((root * data.oMf[figure.frame_id(name)]).homogeneous) for name in figure.segments}


def _bring_thumb(rest: dict[str, Array], side: str, target: Array) -> None:
    """Turn the resting thumb about its first joint, so that it points to where the person's thumb ends."""
    first, last = f"{side}_thumb_proximal", f"{side}_thumb_distal"
    origin = rest[first][:3, 3].copy()
    now, wanted = rest[last][:3, 3] - origin, target - origin
    axis = np.cross(now, wanted)
    angle = np.arctan2(np.linalg.norm(axis), now @ wanted)
    turn = np.eye(4)
    turn[:3, :3] = pin.exp3(angle * axis / max(float(np.linalg.norm(axis)), 1e-12))
    turn[:3, 3] = origin - turn[:3, :3] @ origin
    for segment in (first, last):
        rest[segment] = turn @ rest[segment]


def _resting(side: str) -> dict[str, float]:
    """Degrees of flexion of fingers where the hand is one segment: the index leads a reach, the others curl."""
    found = {f"{side}_thumb_mcp_flexion": 8.0, f"{side}_thumb_ip_flexion": 12.0}
    curled = {"middle": (8.0, 12.0, 6.0), "ring": (12.0, 16.0, 8.0), "little": (14.0, 18.0, 8.0)}
    for finger, angles in {"index": (0.0, 0.0, 0.0), **curled}.items():
        for joint, angle in zip(("mcp", "pip", "dip"), angles, strict=True):
            found[f"{side}_{finger}_{joint}_flexion"] = angle
    return found


def _bone(size: Dimensions, finger: str, part: str) -> Field:
    """One part of a finger, in its own frame; its last part ends where the finger ends."""
    key, order = f"{finger}_{part}", FINGERS[finger]
    length, radius = keyed_hand(key, "length") * size.hand_length, part_radius(size, key)
    if part == order[-1]:
        tip = 0.84 * radius
        return round_cone((0.0, 0.0, 0.0), (0.0, 0.0, -(length - tip)), 1.03 * radius, tip)
    following = part_radius(size, f"{finger}_{order[order.index(part) + 1]}")
    return round_cone((0.0, 0.0, 0.0), (0.0, 0.0, -length), 1.03 * radius, 1.03 * following)


def _palm(size: Dimensions, sign: float) -> Field:
    """Four metacarpals side by side, and the heel of the hand below the little finger."""
    breadth, length = size.hand_breadth, size.hand_length
    rays = []
    for finger in ("index", "middle", "ring", "little"):
        lateral, distal = FINGER_BASES[finger]
        root, knuckle = (0.55 * lateral * breadth, 0.0, -0.03 * length), (lateral * breadth, 0.0, -distal * length)
        rays.append(round_cone(root, knuckle, 0.155 * breadth, 0.135 * breadth))
    middle = (-0.24 * breadth, -sign * 0.03 * breadth, -0.19 * length)
    heel = ellipsoid(middle, (0.17 * breadth, 0.155 * breadth, 0.17 * length))
    return union([union(rays, 0.008), heel], 0.010)


def _thenar(size: Dimensions, sign: float, thumb: Array) -> Field:
    """The ball of the thumb: from the wrist to the thumb's first free joint."""
    breadth, length = size.hand_breadth, size.hand_length
    root = np.array([0.20 * breadth, -sign * 0.02 * breadth, -0.09 * length])
    joint = thumb[:3, 3]
    ball = round_cone(root, joint, 0.17 * breadth, 0.135 * breadth)
    web = round_cone(0.5 * (root + joint), (0.20 * breadth, 0.0, -0.33 * length), 0.13 * breadth, 0.11 * breadth)
    return union([ball, web], 0.012)
