"""Flesh that spreads where a limb is bent: hips are broader on a seat than of who stands.

Pinocchio's pieces are rigid. A piece that is marked as flesh is where the geometry model has it as long as its limb is
bent. Where the limb is straight, it is in the piece before it, which meets things first. In between it goes from one
place to the other. Contact rows leave this motion out: 16 mm while a hip bends by 30 degrees. `Spreading` has it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, cross

SPREADS = "spreads"
"""Mark of flesh, in the `meshPath` of its piece: Pinocchio copies it with the piece, and convex pieces have no file."""

# Cosines of the angles of 30 and 60 degrees between the limb and what carries it, up to which the limb is straight, and
# from which on it is bent: people walk with less, and sit with more (estimate).
STRAIGHT, BENT = 0.866, 0.5

NUMBERS = 12  # of a placement: columns of the rotation, then the translation


def mark_flesh(model: pin.Model, geometry: pin.GeometryModel, number: int) -> None:
    """Let a piece be flesh that spreads out of the piece before it, against the first piece of what carries it."""
    pieces = geometry.geometryObjects
    first: dict[int, int] = {}
    for k, piece in enumerate(pieces):
        first.setdefault(int(piece.parentJoint), k)
    joint = int(model.parents[pieces[number].parentJoint])
    while joint and joint not in first:
        joint = int(model.parents[joint])
    trunk = pieces[first[joint]]
    up, along = trunk.placement.rotation[2], pieces[number - 1].placement.rotation[2, 2]
    column = int(np.argmax(np.abs(up)))
    # by number, as joints of a reduced model and names of outer pieces are others
    pieces[number].meshPath = f"{SPREADS} {number - first[joint]} {column} {np.sign(up[column] * along):.0f}"


def is_flesh(piece: pin.GeometryObject) -> bool:
    """Whether a piece is flesh."""
    return str(piece.meshPath).startswith(SPREADS)


class Flesh(NamedTuple):
    """A piece that spreads out of the one before it."""

    piece: int  # index in the geometry model
    limb: int  # where in the flat placements of the pieces the axis of the piece before it begins
    trunk: int  # where the axis begins that is along it when the limb is straight, of a piece of what carries the limb
    sign: float  # of their product when the limb is straight

    def placed(self, geometry: pin.GeometryModel, joints: Any) -> pin.SE3:
        """Where it is in the world, with the joints at Pinocchio's placements."""
        number, column = divmod(self.trunk, NUMBERS)
        trunk, limb, own = (geometry.geometryObjects[k] for k in (number, self.piece - 1, self.piece))
        joint, carrier = joints[own.parentJoint], joints[trunk.parentJoint]
        straight = joint * limb.placement
        axis = carrier.rotation @ trunk.placement.rotation[:, column // 3]
        cosine = self.sign * float(axis @ straight.rotation[:, 2])
        if cosine >= STRAIGHT:
            return straight
        bent = joint * own.placement
        if cosine <= BENT:
            return bent
        share = (STRAIGHT - cosine) / (STRAIGHT - BENT)
        ends = [np.vstack([at.rotation.T, at.translation]) for at in (straight, bent)]
        now = between(ends[0], ends[1], share * share * (3.0 - 2.0 * share))
        return pin.SE3(now[:3].T, now[3])


class Spreading(NamedTuple):
    """How flesh moves beside its limb at a posture.

    The share of the way to where it is of a bent limb changes by `turn` . (w_limb - w_trunk), angular velocities.
    """

    turn: Array  # (3,) a radian
    limb: int  # joint
    trunk: int  # joint
    joint: pin.SE3  # where the limb's joint is
    now: pin.SE3  # of the flesh in it
    way: Array  # (4, 3) from where it is of a straight limb to where it is of a bent one, columns and translation

    def rate(self, point: Array) -> Array:
        """By how much a point (3,) of the flesh in the world moves with the share, (3,) metres."""
        local = self.now.actInv(self.joint.actInv(point))
        return np.asarray(self.joint.rotation @ (local @ self.way[:3] + self.way[3]))


def spreading(geometry: pin.GeometryModel, flesh: Flesh, joints: Any) -> Spreading | None:
    """How flesh moves, with the joints at Pinocchio's placements; None where the limb is straight or bent."""
    number, column = divmod(flesh.trunk, NUMBERS)
    trunk, straight, bent = (geometry.geometryObjects[k] for k in (number, flesh.piece - 1, flesh.piece))
    joint = joints[bent.parentJoint]
    axis = (joints[trunk.parentJoint] * trunk.placement).rotation[:, column // 3]
    own = (joint * straight.placement).rotation[:, 2]
    share = (STRAIGHT - flesh.sign * float(axis @ own)) / (STRAIGHT - BENT)
    if not 0.0 < share < 1.0:
        return None
    turn = -6.0 * share * (1.0 - share) / (STRAIGHT - BENT) * flesh.sign * cross(own, axis)
    ends = [np.vstack([one.placement.rotation.T, one.placement.translation]) for one in (straight, bent)]
    now = between(ends[0], ends[1], share * share * (3.0 - 2.0 * share))
    return Spreading(
        turn, int(bent.parentJoint), int(trunk.parentJoint), joint, pin.SE3(now[:3].T, now[3]), ends[1] - ends[0]
    )


def spread(flesh: tuple[Flesh, ...], placed: Array, flat: Any) -> None:
    """Move flesh among placements (n, 4, 3) of the pieces; `flat` is a memoryview of their numbers, which is fast."""
    for piece, limb, trunk, sign in flesh:
        cosine = flat[limb] * flat[trunk] + flat[limb + 1] * flat[trunk + 1] + flat[limb + 2] * flat[trunk + 2]
        cosine *= sign
        if cosine >= STRAIGHT:
            begin = NUMBERS * piece
            flat[begin : begin + NUMBERS] = flat[begin - NUMBERS : begin]
        elif cosine > BENT:
            share = (STRAIGHT - cosine) / (STRAIGHT - BENT)
            placed[piece] = between(placed[piece - 1], placed[piece], share * share * (3.0 - 2.0 * share))


def beside_limbs(pieces: Sequence[pin.GeometryObject], reach: Array) -> Array:
    """(n,) most that pieces of reach (n,) move a radian beside what their joints move them by, m: 0 but for flesh."""
    most, rate = np.zeros(len(pieces)), 1.5 / (STRAIGHT - BENT) * np.sqrt(1.0 - BENT**2)  # of the share, a radian
    for k, piece in enumerate(pieces):
        if is_flesh(piece):
            moved = pieces[k - 1].placement.actInv(piece.placement)
            turned = np.linalg.norm(moved.rotation - np.eye(3), 2)
            most[k] = rate * (np.linalg.norm(moved.translation) + turned * reach[k])
    return most


def flesh_of(geometry: pin.GeometryModel) -> tuple[Flesh, ...]:
    """Flesh among the pieces of a geometry model."""
    pieces, found = geometry.geometryObjects, []
    for k in [k for k, piece in enumerate(pieces) if is_flesh(piece)]:
        back, column, sign = (int(number) for number in pieces[k].meshPath.split(" ")[1:])
        trunk = NUMBERS * (k - back) + 3 * column
        found.append(Flesh(k, NUMBERS * (k - 1) + 6, trunk, sign))  # a capsule's axis is the last column
    return tuple(found)


def in_joints(geometry: pin.GeometryModel, joints: Any) -> dict[int, Array]:
    """Placements (4, 4) in their joints of the pieces of flesh, by their numbers, with the joints at Pinocchio's."""
    pieces = geometry.geometryObjects
    return {
        flesh.piece: (joints[pieces[flesh.piece].parentJoint].inverse() * flesh.placed(geometry, joints)).homogeneous
        for flesh in flesh_of(geometry)
    }


def settled(model: pin.Model, geometry: pin.GeometryModel, q: Array) -> pin.GeometryModel:
    """The geometry model for programs to which all pieces are rigid: with flesh where it is at the posture q (nq,)."""
    data, made = model.createData(), geometry.copy()
    pin.forwardKinematics(model, data, q)
    for number, place in in_joints(geometry, data.oMi).items():
        made.geometryObjects[number].placement = pin.SE3(place)
    return made


def between(straight: Array, bent: Array, share: float) -> Array:
    """A placement (4, 3), columns of the rotation and the translation, between two that differ by a small angle."""
    # in numbers: every query of a figure with flesh does it, and numpy takes four times as long for vectors so small
    (_, (b, e, h), (c, f, i), at) = (straight + share * (bent - straight)).tolist()
    size = 1.0 / math.sqrt(c * c + f * f + i * i)
    c, f, i = size * c, size * f, size * i
    a, d, g = e * i - h * f, h * c - b * i, b * f - e * c
    size = 1.0 / math.sqrt(a * a + d * d + g * g)
    a, d, g = size * a, size * d, size * g
    return np.array([(a, d, g), (f * g - i * d, i * a - c * g, c * d - f * a), (c, f, i), at])
