"""Weighted squared distance of a posture from another, and the measures that are one: `Effort` and `Displacement`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.tasks import inputs
from wholebody.tasks.base import Measure, Surroundings, filled

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

    def squares(self, state: State) -> tuple[Array, Array]:
        """Residuals (k,) whose squares the distance is the sum of, and their derivatives (k, nv)."""
        counts = np.flatnonzero(self.weights)
        roots = np.sqrt(self.weights[counts])
        difference = pin.difference(state.model, self.reference, state.q)
        rows = (
            np.eye(len(self.weights))
            if self.straight
            else pin.dDifference(state.model, self.reference, state.q, pin.ARG1)
        )
        return roots * difference[counts], roots[:, None] * rows[counts]


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


@dataclass(frozen=True, eq=False)
class Effort(DistanceMeasure):
    """Squared displacement of every joint from the start, weighted by joint [rad^2].

    ``sum_i gamma_i (q_i - q_i_start)^2`` (Marler and Arora's effort; eq. 2.5 of the thesis on posture prediction), with
    the figure's `effort_weights` for gamma: moving the spine costs more than moving an arm.

    The angles of a ball joint that is made of three hinges count one by one, which is not the square of its rotation
    vector: near an arm stretched to the side two of them turn it alike. `RotationEffort` counts the rotation vector;
    docs/theory/person.md says how far the two are apart.

    Attributes:
        weight: factor on the measure [1/rad^2].
        distance: the start, and the weight of every degree of freedom; once resolved.
    """

    weight: inputs.Weight = 1.0
    distance: SquaredDistance = field(init=False, repr=False)

    def resolve(self, scene: Surroundings, start: Array) -> Effort:
        """Store the start."""
        return filled(self, distance=SquaredDistance.build(scene.model, start, scene.figure.effort_weights))


@dataclass(frozen=True, eq=False)
class Displacement(DistanceMeasure):
    """Squared displacement of every joint from the neutral posture, weighted by joint [rad^2].

    ``sum_i w_i (q_i - q_i_neutral)^2``, the joint displacement of Abdel-Malek and Arora 2013 ("Human Motion Simulation:
    Predictive Dynamics", chapter 3), with the figure's `neutral_weights` for w.

    Attributes:
        weight: factor on the measure [1/rad^2].
        distance: the neutral posture, and the weight of every degree of freedom; once resolved.
    """

    weight: inputs.Weight = 1.0
    distance: SquaredDistance = field(init=False, repr=False)

    def resolve(self, scene: Surroundings, start: Array) -> Displacement:
        """Read the neutral posture and the weights of the figure."""
        figure = scene.figure
        return filled(self, distance=SquaredDistance.build(scene.model, figure.neutral, figure.neutral_weights))
