"""How fast pieces can approach each other on the way from one posture to another.

On the geodesic q(t) = integrate(q0, t v), v = difference(q0, q1), every joint turns with a twist (l, w) that is
constant in its own frame. A point at distance r from the joint's origin then moves, relative to the joint's base,
with a speed of at most |l| + |w| r, and r is at most the sum of the distances between the moving joints on the way to
the point, plus the travel of the sliding ones: lengths that do not change, because what lies between two moving
joints is rigid. The speed of approach of two pieces is at most the sum over the joints that carry exactly one of them
(common ancestors move both).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.errors import InputError
from wholebody.geometry.pieces import Array

TURNING_AXES = ("Composite", "Mimic", "SphericalZYX", "Universal", "Ellipsoid")
"""Joints whose twist is not constant along a geodesic, by a part of Pinocchio's name for them."""


class MotionBounds:
    """Bounds for one geometry model, renewed for each motion by `update`.

    Attributes:
        speed: (n, njoints) most speed that joint j gives to a point of piece i, metres for the whole way; 0 where it
            gives none.
        turn: (njoints,) angle that each joint turns by on the way, radians.
    """

    def __init__(self, model: pin.Model, joint: NDArray[np.intp], reach: Array) -> None:
        """Read the tree once.

        Args:
            model: the model.
            joint: (n,) the joint that carries each piece; 0 is the world.
            reach: (n,) radius of each piece about its origin; infinite for a half-space.

        Raises:
            InputError: a joint whose axis turns as it moves (composite, mimic, Euler angles, universal).
        """
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

    def update(self, data: Any, velocity: Array, centers: Array) -> None:
        """Bound the motion from where `data` is.

        Args:
            data: Pinocchio's data after forwardKinematics at the start, with `velocity`.
            velocity: (nv,) difference of the two postures.
            centers: (n, 3) the origins of the pieces at the start, world.
        """
        for j in range(1, self.model.njoints):
            kind = self.model.joints[j]
            rates = velocity[kind.idx_v : kind.idx_v + kind.nv]
            if rates.any():
                twist = np.asarray(data.joints[j].S).reshape(6, -1) @ rates
                self._slide[j], self.turn[j] = np.linalg.norm(twist[:3]), np.linalg.norm(twist[3:])
            else:
                self._slide[j] = self.turn[j] = 0.0
        origins = np.array([data.oMi[j].translation for j in range(self.model.njoints)])
        finite = np.isfinite(self.reach)
        self.speed = self._speeds(origins, centers, np.where(finite, self.reach, 0.0))
        if not finite[self.joint > 0].all():
            # Of a half-space only the part near other pieces counts: where two pieces are nearest, either of the two
            # points gives the same speed along the normal, and all other pieces stay within this sphere.
            travel = self.speed.sum(axis=1)
            extent = np.where(finite, self.reach, 0.0) + travel
            around = np.linalg.norm(centers[:, None] - centers, axis=2) + extent + travel[:, None]
            wide = np.where(finite, around, 0.0).max(axis=1, initial=0.0)
            self.speed = self._speeds(origins, centers, np.where(finite, self.reach, wide))

    def _speeds(self, origins: Array, centers: Array, reach: Array) -> Array:
        speed = np.zeros((len(centers), self.model.njoints))
        between = np.linalg.norm(origins[:, None] - origins, axis=2)
        moving = (self._slide > 0.0) | (self.turn > 0.0)
        for joint in np.unique(self.joint):
            pieces = np.flatnonzero(self.joint == joint)
            chain = [int(j) for j in np.flatnonzero(self.carries[joint] & moving)][::-1]
            if not chain:
                continue
            farthest = np.linalg.norm(centers[pieces] - origins[chain[0]], axis=1) + reach[pieces]
            for j, above in zip(chain, [*chain[1:], 0], strict=True):
                speed[pieces, j] = self._slide[j] + self.turn[j] * farthest
                farthest = farthest + self._slide[j] + between[j, above]
        return speed

    def approach(self, first: NDArray[np.intp], second: NDArray[np.intp]) -> Array:
        """Most speed with which the distance of each pair can change, (k,), metres for the whole way."""
        a, b = self.carries[self.joint[first]], self.carries[self.joint[second]]
        return np.asarray((self.speed[first] * (a & ~b) + self.speed[second] * (b & ~a)).sum(axis=1))

    def curvature(self, first: int, second: int, gap: float) -> float:
        """Most acceleration of a point of the first piece seen from the second, metres for the whole way squared.

        With the joints between the two pieces taken as a product of exponentials, the second derivative of the point
        is a sum over pairs of joints: each speed is turned twice by every joint nearer to the second piece, and once
        by its own.

        Args:
            first: the piece with the points; of finite reach.
            second: the piece it is seen from.
            gap: distance of the two now, metres.
        """
        a, b = self.carries[self.joint[first]], self.carries[self.joint[second]]
        near, far = a & ~b, b & ~a
        turn = self.turn * (near | far)
        speed = self.speed[first] * near + self.speed[second] * far
        # A joint under the second piece is as far from the first one's points as from the second's, the gap, and
        # what is across the first.
        across = max(gap, 0.0) + float(speed.sum()) + 2.0 * float(self.reach[first])
        speed = speed + self.turn * far * across
        return float((speed * (2.0 * turn.sum() - turn)).sum())
