"""The attraction of the shown posture to the tracked one, and the bound on the speed with which it follows.

Unlike other terms these two change between steps, because the tracker is read in every frame.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.figures.state import State
from wholebody.tasks.base import Bound, Measure
from wholebody.tasks.distance import SquaredDistance


class Attraction(Measure):
    """Weighted squared distance from the tracked posture: ``sum_i w_i d_i^2``, d the tangent vector from there.

    Its unconstrained minimum is the tracked posture itself, which one program reaches in one step without contact. In
    contact the minimum is the nearest posture that touches. A goal would behave differently: it is met at any cost in
    the other joints, and its force does not grow with the distance.
    """

    def __init__(self, model: pin.Model, q: Array, weights: Array) -> None:
        """Attract to q (nq,) with weights (nv,), 1/rad^2 and 1/m^2."""
        self._distance = SquaredDistance.build(model, q, weights)
        self._weights = self._distance.weights.copy()

    def toward(self, q: Array) -> None:
        """Attract to another posture (nq,)."""
        self._distance.reference[:] = q

    def weigh(self, factors: Array) -> None:
        """Multiply the weights of the beginning by factors (nv,), which are positive."""
        np.multiply(self._weights, factors, out=self._distance.weights)
        np.multiply(2.0, self._distance.weights, out=self._distance.curvature)

    def value(self, state: State) -> float:
        """The squared distance."""
        return self._distance.value(state)

    def gradient(self, state: State) -> Array:
        """(nv,) its derivative."""
        return self._distance.gradient(state)

    def curvature(self, state: State) -> Array:
        """(nv,) its second derivative; exact for joints of one degree of freedom."""
        return self._distance.curvature


class Pace(Bound):
    """Bounds the motion of a whole frame, whatever the number of its steps."""

    def __init__(self, model: pin.Model, limit: Array) -> None:
        """Allow `limit` (nv,) a frame to either side, radians and metres."""
        self._limit = limit
        self._begin = pin.neutral(model)

    def begin(self, q: Array) -> None:
        """Begin a frame at the posture q (nq,)."""
        self._begin = np.array(q)

    def bounds(self, state: State, dt: float | None) -> tuple[Array, Array]:
        """The remaining motion of the frame."""
        gone = np.asarray(pin.difference(state.model, self._begin, state.q))
        return np.minimum(-self._limit - gone, 0.0), np.maximum(self._limit - gone, 0.0)
