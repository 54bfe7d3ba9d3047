"""Weighted squared distance of a posture from another, with its derivatives, and the measures that are one."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.figures.state import State
from wholebody.tasks.base import Measure

LEAST_CURVATURE = 1e-6
"""Curvature [1/rad^2] of degrees of freedom without weight: positive, as methods require, and far below any in use."""


class SquaredDistance(NamedTuple):
    """``sum_i w_i d_i^2`` with d the tangent vector (nv,) from a reference posture.

    Attributes:
        reference: (nq,) posture that has distance zero.
        weights: (nv,) not negative.
        curvature: (nv,) positive diagonal of the second derivative.
        straight: whether the Jacobian of d is the identity.
    """

    reference: Array
    weights: Array
    curvature: Array
    straight: bool

    @classmethod
    def build(cls, model: Any, reference: Array, weights: Array) -> SquaredDistance:
        """Distance of postures of `model` from `reference`."""
        weights = np.array(weights, dtype=float)
        curvature = np.maximum(2.0 * weights, LEAST_CURVATURE)
        # A free-flyer without weight has no part in the distance, so its curved tangent space has none either.
        curved = [joint for joint in model.joints[1:] if joint.nq != joint.nv]
        straight = not any(weights[joint.idx_v : joint.idx_v + joint.nv].any() for joint in curved)
        return cls(np.array(reference, dtype=float), weights, curvature, straight)

    def value(self, state: State) -> float:
        """The distance."""
        difference = pin.difference(state.model, self.reference, state.q)
        return float(self.weights @ (difference * difference))

    def gradient(self, state: State) -> Array:
        """(nv,) its derivative."""
        force = 2.0 * self.weights * pin.difference(state.model, self.reference, state.q)
        if self.straight:
            return np.asarray(force)
        return np.asarray(force @ pin.dDifference(state.model, self.reference, state.q, pin.ARG1))


class DistanceMeasure(Measure):
    """A measure that is a weighted squared distance from a posture.

    Attributes:
        distance: the posture, and the weight of every degree of freedom; once resolved.
    """

    distance: SquaredDistance

    def value(self, state: State) -> float:
        """The distance [rad^2]."""
        return self.distance.value(state)

    def gradient(self, state: State) -> Array:
        """(nv,) derivative [rad]."""
        return self.distance.gradient(state)

    def curvature(self, state: State) -> Array:
        """(nv,) second derivative; exact for joints of one degree of freedom."""
        return self.distance.curvature
