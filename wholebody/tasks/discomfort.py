"""Discomfort: away from neutral, and close to the limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.figures.state import State
from wholebody.tasks import inputs
from wholebody.tasks.base import Array, Measure, Surroundings, filled
from wholebody.tasks.distance import LEAST_CURVATURE

STEEPNESS = 2.5
"""Half the 5.0 in eq. 3.14: the penalty at the ratio r from a limit is cos(2.5 r)^200."""

POWER = 200
"""Twice the exponent in eq. 3.14: the penalty is 1 at the limit, 0.2 at 5 % of the range from it and 0.002 at 10 %."""


class _Joints(NamedTuple):
    """The joints that have two limits, each array (n,)."""

    idx_q: NDArray[np.intp]
    idx_v: NDArray[np.intp]
    lower: Array
    upper: Array
    neutral: Array
    span: Array
    weights: Array


@dataclass(frozen=True, eq=False)
class Discomfort(Measure):
    """Discomfort of the joints that have two limits; about 1 for a joint at its limit [no unit].

    ``sum_i [g_i ((q_i - n_i) / (u_i - l_i))^2 + P((u_i - q_i) / (u_i - l_i)) + P((q_i - l_i) / (u_i - l_i))]`` with n
    the neutral posture, l and u the limits and
    ``P(r) = [(sin(5 r + pi/2) + 1) / 2]^100 = cos(2.5 r)^200``: Abdel-Malek and Arora 2013, "Human Motion Simulation:
    Predictive Dynamics", eqs. 3.13 to 3.16, with two changes. The factor 1/2 applies to the whole bracket: as printed,
    ``(sin(5 r + 1.571) / 2 + 1)^100`` is 4e17 at a limit, whereas the text says it goes from 0 to 1. And g
    are the figure's `effort_weights`, which rank the joints as table 3.3 does, over the greatest of them, in place of
    weights of 1 to 1e8 over 1e6: the stiffest joint over its whole range weighs as much as a joint at its limit. Beyond
    a limit P stays 1, with no slope.

    Attributes:
        weight: factor on the measure.
    """

    weight: float = 1.0
    _joints: _Joints = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the value."""
        object.__setattr__(self, "weight", inputs.positive(self.weight, "Discomfort: weight"))

    def resolve(self, scene: Surroundings, start: Array) -> Discomfort:
        """Take the limits, the neutral posture and the weights of the figure."""
        figure = scene.figure
        limits = figure.limits
        moves = (limits.upper > limits.lower) & np.isfinite(limits.upper - limits.lower)
        idx_q, idx_v = limits.idx_q[moves], limits.idx_v[moves]
        lower, upper = limits.lower[moves], limits.upper[moves]
        weights = figure.effort_weights[idx_v]
        greatest = float(weights.max(initial=0.0))
        weights = weights / greatest if greatest > 0.0 else np.zeros_like(weights)
        joints = _Joints(idx_q, idx_v, lower, upper, figure.neutral[idx_q], upper - lower, weights)
        return filled(self, _joints=joints)

    def value(self, state: State) -> float:
        """The discomfort."""
        joints = self._joints
        away = (state.q[joints.idx_q] - joints.neutral) / joints.span
        above, below = self._phases(state)
        return float(joints.weights @ (away * away) + (np.cos(above) ** POWER).sum() + (np.cos(below) ** POWER).sum())

    def gradient(self, state: State) -> Array:
        """(nv,) derivative [1/rad]."""
        joints = self._joints
        away = (state.q[joints.idx_q] - joints.neutral) / joints.span
        above, below = self._phases(state)
        slope = STEEPNESS * POWER * (_slope(above) - _slope(below))
        result = np.zeros(state.model.nv)
        result[joints.idx_v] = (2.0 * joints.weights * away + slope) / joints.span
        return result

    def curvature(self, state: State) -> Array:
        """(nv,) second derivative, which is diagonal; its negative part near the limits is left out [1/rad^2]."""
        joints = self._joints
        above, below = self._phases(state)
        bend = STEEPNESS**2 * POWER * (_bend(above) + _bend(below))
        result = np.full(state.model.nv, LEAST_CURVATURE)
        result[joints.idx_v] += (2.0 * joints.weights + bend) / (joints.span * joints.span)
        return result

    def _phases(self, state: State) -> tuple[Array, Array]:
        """2.5 r to the upper and lower limits; zero beyond them."""
        joints = self._joints
        q = state.q[joints.idx_q]
        scale = STEEPNESS / joints.span
        above = np.clip((joints.upper - q) * scale, 0.0, STEEPNESS)
        below = np.clip((q - joints.lower) * scale, 0.0, STEEPNESS)
        return above, below


def _slope(phase: Array) -> Array:
    """-1/POWER times the derivative of cos(phase)^POWER."""
    return np.asarray(np.cos(phase) ** (POWER - 1) * np.sin(phase))


def _bend(phase: Array) -> Array:
    """1/POWER times the second derivative of cos(phase)^POWER, where that is positive."""
    cosine, sine = np.cos(phase), np.sin(phase)
    return np.asarray(np.maximum(cosine ** (POWER - 2) * ((POWER - 1) * sine * sine - cosine * cosine), 0.0))
