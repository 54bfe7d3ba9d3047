"""How fast, and how much, pieces can approach each other during a motion.

On the geodesic q(t) = integrate(q0, t v), v = difference(q0, q1), every joint moves with a twist (l, w) that is
constant in its own frame. A point at distance r from the joint's origin then moves, relative to the joint's base,
with a speed of at most |l| + |w| r. Here r is at most the sum of the distances between the moving joints from there to
the point, plus the travel of the prismatic ones; these distances are constant, because the parts between two moving
joints are rigid. The speed of approach of two pieces is at most the sum over the joints that carry exactly one of them
(common ancestors move both). `largest_approach` bounds in the same way, wherever the joints are.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.geometry.proximity import PairTable

TURNING_AXES = ("Composite", "SphericalZYX", "Universal", "Ellipsoid")
"""Joints whose twist is not constant along a geodesic, by a part of Pinocchio's name for them."""

_NONE: Array = np.zeros((6, 0))


class MotionBounds:
    """Bounds for one geometry model, renewed for each motion by `update`.

    Attributes:
        speed: (n, njoints) largest speed that joint j gives to a point of piece i, metres for the whole motion; 0 where
            it gives none.
        turn: (njoints,) rotation angle of each joint during the motion, radians.
    """

    def __init__(self, model: pin.Model, joint: NDArray[np.intp], reach: Array) -> None:
        """Read the tree: `joint` (n,) carries each piece of `reach` (n,); an InputError for axes that turn."""
        for name, kind in zip(model.names, model.joints, strict=True):
            if any(word in kind.shortname() for word in TURNING_AXES):
                raise InputError(
                    f"joint {name} is a {kind.shortname()}, whose motion between two postures cannot be bounded; "
                    "use single joints in a row, or a spherical joint"
                )
        self.model, self.joint, self.reach = model, joint, reach
        self.carries: NDArray[np.bool_] = np.zeros((model.njoints, model.njoints), dtype=bool)
        for j in range(1, model.njoints):
            self.carries[j] = self.carries[model.parents[j]]
            self.carries[j, j] = True
        self.turn: Array = np.zeros(model.njoints)
        self._slide: Array = np.zeros(model.njoints)
        self.speed: Array = np.zeros((len(joint), model.njoints))
        self._finite = np.isfinite(reach)
        self._size = np.where(self._finite, reach, 0.0)
        # one column a degree of freedom, in the order of the joints: a table over all pairs of them would be large
        joints = list(model.joints)[1:]
        sizes = np.array([joint.nvExtended for joint in joints], dtype=np.intp)
        self._twists: Array = np.hstack([_NONE, *(np.asarray(made.createData().S).reshape(6, -1) for made in joints)])
        self._first = np.cumsum(sizes) - sizes
        self._column = np.array([made.idx_v + k for made in joints for k in range(made.nvExtended)], dtype=np.intp)
        self._parents = [int(parent) for parent in model.parents]

    def update(self, data: Any, velocity: Array, centers: Array) -> None:
        """Bound the motion of `velocity` (nv,) from the posture of `data`, pieces' origins at `centers` (n, 3)."""
        if len(self._first):
            twists = np.add.reduceat(self._twists * velocity[self._column], self._first, axis=1)
            self._slide[1:], self.turn[1:] = np.sqrt(np.einsum("ijk,ijk->ik", *[twists.reshape(2, 3, -1)] * 2))
        origins = np.array([place.translation for place in data.oMi])
        self.speed = self._speeds(origins, centers, self._size)
        if not self._finite[self.joint > 0].all():
            # Of a half-space only the part near other pieces matters: where two pieces are nearest, either of the two
            # points gives the same speed along the normal, and all other pieces stay within this sphere.
            travel = self.speed.sum(axis=1)
            extent = self._size + travel
            around = np.linalg.norm(centers[:, None] - centers, axis=2) + extent + travel[:, None]
            wide = np.where(self._finite, around, 0.0).max(axis=1, initial=0.0)
            self.speed = self._speeds(origins, centers, np.where(self._finite, self.reach, wide))

    def _speeds(self, origins: Array, centers: Array, reach: Array) -> Array:
        """Translations of the joints, and rotations times the distances to the pieces along the moving joints."""
        moving = ((self._slide > 0.0) | (self.turn > 0.0)).tolist()
        above = [0] * len(moving)  # the joint that moves, itself or the nearest to the root
        inner = [0] * len(moving)  # the next one from there
        for j in range(1, len(moving)):
            parent = above[self._parents[j]]
            above[j], inner[j] = (j, parent) if moving[j] else (parent, 0)
        step = origins - origins[inner]
        lengths = (self._slide + np.sqrt(np.einsum("ij,ij->i", step, step))).tolist()
        depth = [0.0] * len(moving)
        for j in range(1, len(moving)):
            if moving[j]:
                depth[j] = depth[inner[j]] + lengths[j]
        along, first = np.array(depth), np.array(above)[self.joint]
        lever = centers - origins[first]
        own = np.sqrt(np.einsum("ij,ij->i", lever, lever)) + reach
        farthest = (own + along[first])[:, None] - along
        return np.where(self.carries[self.joint], self._slide + self.turn * farthest, 0.0)

    def approach(self, first: NDArray[np.intp], second: NDArray[np.intp]) -> Array:
        """Largest rate of change of the distance of each pair, (k,), metres for the whole motion."""
        against = self.speed @ ~self.carries.T  # of each piece against what each joint carries
        return np.asarray(against[first, self.joint[second]] + against[second, self.joint[first]])


def largest_approach(table: PairTable, centres: Array, most: Array) -> Array:
    """Most (pairs,) [m] by which distances can fall for displacements `most` (nv,), or (pairs, m) for (nv, m)."""
    # `centres` (n,): how far a piece's origin is from its joint's, infinite where placed anew
    model = table.model
    moved = np.array([_motion(model, joint, most) for joint in range(model.njoints)])
    lengths = np.array([_length(model, joint) for joint in range(model.njoints)])
    parents = np.array(list(model.parents), dtype=np.intp)
    joint = table.joint[table.pairs]
    own, lever = (centres + table.reach)[table.pairs], np.zeros(joint.shape)
    approach = np.zeros((len(joint), *most.shape[1:]))
    with np.errstate(invalid="ignore"):  # an infinite lever of what does not turn
        # a joint comes after the one that carries it: the later of two is never an ancestor of the other
        while len(row := np.flatnonzero(joint[:, 0] != joint[:, 1])):
            later = (row, (joint[row, 1] > joint[row, 0]).astype(np.intp))
            number = joint[later]
            slide, turn = moved[number].swapaxes(0, 1)
            far = (lever[later] + own[later]).reshape(-1, *[1] * (most.ndim - 1))
            approach[row] += slide + np.where(turn > 0.0, turn * far, 0.0)
            lever[later] += lengths[number]
            joint[later] = parents[number]
    return approach


def _motion(model: pin.Model, joint: int, most: Array) -> Array:
    """How far a joint can slide, and how far it can turn, (2,) or (2, m)."""
    found = np.zeros((2, *most.shape[1:]))
    if joint == 0:
        return found
    kind: Any = model.joints[joint]
    size = most[kind.idx_v : kind.idx_v + kind.nvExtended]
    turning = any(word in kind.shortname() for word in TURNING_AXES)
    known = np.isfinite(size).all(axis=0) & (np.logical_not(turning) | (size == 0.0).all(axis=0))
    part = np.abs(_axes(model, kind)) @ np.where(known, size, 0.0)
    found[0], found[1] = (np.sqrt((half**2).sum(axis=0)) for half in (part[:3], part[3:]))
    found[0] = np.where(known, found[0], np.inf)
    return found


def _length(model: pin.Model, joint: int) -> float:
    """Most that the origin of a joint can be away from the origin of the one that carries it."""
    kind: Any = model.joints[joint]
    if joint == 0:
        return 0.0
    length = float(np.linalg.norm(model.jointPlacements[joint].translation))
    if not _axes(model, kind)[:3].any():
        return length
    if kind.nq != 1:
        return np.inf
    return length + float(max(abs(model.lowerPositionLimit[kind.idx_q]), abs(model.upperPositionLimit[kind.idx_q])))


def _axes(model: pin.Model, joint: Any) -> Array:
    """(6, k) motions of a joint by its k degrees of freedom, in its own frame."""
    data = joint.createData()
    joint.calc(data, pin.neutral(model))
    return np.asarray(data.S).reshape(6, -1)
