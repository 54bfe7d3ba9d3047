"""The attraction of the shown posture to the tracked one, and the bound on the speed with which it follows.

Unlike other terms these two change between steps, because the tracker is read in every frame.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.tasks.base import Bound
from wholebody.tasks.bounds import clipped
from wholebody.tasks.distance import DistanceMeasure, SquaredDistance


class Attraction(DistanceMeasure):
    """Weighted squared distance from the tracked posture: ``sum_i w_i d_i^2``, d the tangent vector from there.

    Its unconstrained minimum is the tracked posture itself, which one program reaches in one step without contact. In
    contact the minimum is the nearest posture that touches. A goal would behave differently: it is met at any cost in
    the other joints, and its force does not grow with the distance.
    """

    def __init__(self, model: pin.Model, q: Array, weights: Array) -> None:
        """Attract to q (nq,) with weights (nv,), 1/rad^2 and 1/m^2."""
        self.distance = SquaredDistance.build(model, q, weights)
        self._weights = self.distance.weights.copy()

    def toward(self, q: Array) -> None:
        """Attract to another posture (nq,)."""
        self.distance.reference[:] = q

    def weigh(self, factors: Array) -> None:
        """Multiply the weights of the beginning by factors (nv,), which are positive."""
        np.multiply(self._weights, factors, out=self.distance.weights)
        np.multiply(2.0, self.distance.weights, out=self.distance.curvature)


class FrameMotionLimit(Bound):
    """Bounds the motion of a whole frame, whatever the number of its steps."""

    def __init__(self, model: pin.Model, limit: Array) -> None:
        """Allow `limit` (nv,) a frame to either side, radians and metres."""
        self._limit = limit
        self._begin = pin.neutral(model)

    def begin(self, q: Array) -> None:
        """Begin a frame at the posture q (nq,)."""
        self._begin = np.array(q)

    def kept(self, model: pin.Model, q: Array) -> Array:
        """The posture q (nq,), or the nearest one within the motion of a frame."""
        return clipped(model, self._begin, q, np.stack([-self._limit, self._limit]))

    def bounds(self, state: State, dt: float | None) -> tuple[Array, Array]:
        """The remaining motion of the frame."""
        gone = np.asarray(pin.difference(state.model, self._begin, state.q))
        return np.minimum(-self._limit - gone, 0.0), np.maximum(self._limit - gone, 0.0)
