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

from wholebody.base.arrays import Array, Indices
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
        self._carried = np.flatnonzero(joint > 0)  # what the world carries never moves
        self._row = np.full(len(joint), len(self._carried), dtype=np.intp)  # where a piece is among these
        self._row[self._carried] = np.arange(len(self._carried))
        self._others = (~self.carries.T).astype(float)
        self._against: Array = np.zeros((len(self._carried) + 1, model.njoints))
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
        self._bound_speeds(origins, centers, self._size)
        if not self._finite[self.joint > 0].all():
            # Of a half-space only the part near other pieces matters: where two pieces are nearest, either of the two
            # points gives the same speed along the normal, and all other pieces stay within this sphere.
            travel = self.speed.sum(axis=1)
            extent = self._size + travel
            reach = self.reach.copy()
            for endless in np.flatnonzero(~self._finite).tolist():
                around = np.linalg.norm(centers[endless] - centers, axis=1) + extent + travel[endless]
                reach[endless] = around.max(initial=0.0, where=self._finite)
            self._bound_speeds(origins, centers, reach)

    def _bound_speeds(self, origins: Array, centers: Array, reach: Array) -> None:
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
        carried, joint = self._carried, self.joint[self._carried]
        along, first = np.array(depth), np.array(above)[joint]
        lever = centers[carried] - origins[first]
        own = np.sqrt(np.einsum("ij,ij->i", lever, lever)) + reach[carried]
        farthest = (own + along[first])[:, None] - along
        self.speed[carried] = np.where(self.carries[joint], self._slide + self.turn * farthest, 0.0)

    def approach(self, first: NDArray[np.intp], second: NDArray[np.intp]) -> Array:
        """Largest rate of change of the distance of each pair, (k,), metres for the whole motion."""
        # of each piece that is carried, and at last of one that is not, against what each joint carries
        against, row, joint = self._against, self._row, self.joint
        np.matmul(self.speed[self._carried], self._others, out=against[:-1])
        return np.asarray(against[row[first], joint[second]] + against[row[second], joint[first]])


def meeting_blocks(table: PairTable, centers: Array, speed: Array) -> Indices:
    """Numbers (k,) of the pairs without those blocks whose bodies cannot come to what stands; see `pair_blocks`.

    Origins of pieces are at `centers` (n, 3), and no point of a piece goes farther than `speed` (n,) metres.
    """
    begin, second, body, first, members = table.blocks
    if not len(second):
        return np.arange(len(table.pairs))
    counts, own = np.diff(first), centers[members]
    middle = np.add.reduceat(own, first[:-1]) / counts[:, None]
    out = np.linalg.norm(own - np.repeat(middle, counts, axis=0), axis=1) + table.reach[members] + speed[members]
    radius = np.maximum.reduceat(out, first[:-1])
    meet = second < 0
    beside = np.flatnonzero(~meet)
    away = np.linalg.norm(centers[second[beside]] - middle[body[beside]], axis=1) - table.reach[second[beside]]
    meet[beside] = away < radius[body[beside]]
    return np.flatnonzero(np.repeat(meet, np.diff(begin)))


def pair_kinds(table: PairTable) -> tuple[Indices, Indices]:
    """A pair (k, 2) for each kind, and the kind of every pair (pairs,): to what stands one piece comes alike."""
    count = len(table.joint)
    moving = np.where(table.joint > 0, np.arange(count), count)
    first, second = moving[table.pairs].T
    _, row, kind = np.unique(first * (count + 1) + second, return_index=True, return_inverse=True)
    return table.pairs[row], np.asarray(kind, dtype=np.intp)


def largest_approach(table: PairTable, centres: Array, most: Array, pairs: Indices) -> Array:
    """Most by which the distances of pairs (k, 2) of pieces can fall (k,), metres; infinite where nothing is known.

    `centres` (n,): how far a piece's origin is from its joint's, infinite where placed anew; `most` (nv,) or (nv, m):
    largest displacements of one motion or of m, radians and metres, for which the answer is (k, m).
    """
    model = table.model
    moved = np.array([_motion(model, joint, most) for joint in range(model.njoints)])
    lengths = np.array([_length(model, joint) for joint in range(model.njoints)])
    parents = np.array(list(model.parents), dtype=np.intp)
    joint = table.joint[pairs]
    own, lever = (centres + table.reach)[pairs], np.zeros(joint.shape)
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
    size = next(one.nq for one in model.joints if one.nq and one.idx_q == kind.idx_q)  # its own, or of whom it follows
    if size != 1:
        return np.inf
    ends = np.array((model.lowerPositionLimit[kind.idx_q], model.upperPositionLimit[kind.idx_q]))
    if kind.nq == 0:
        law = kind.extract()
        ends = law.scaling * ends + law.offset
    return length + float(np.abs(ends).max())


def _axes(model: pin.Model, joint: Any) -> Array:
    """(6, k) motions of a joint by its k degrees of freedom, in its own frame."""
    data = joint.createData()
    joint.calc(data, pin.neutral(model))
    return np.asarray(data.S).reshape(6, -1)
