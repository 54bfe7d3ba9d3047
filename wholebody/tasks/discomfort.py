"""Measures: discomfort of joints near limits, and the change of the segments' potential energy."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import Measure, filled
from wholebody.tasks.distance import LEAST_CURVATURE

STEEPNESS = 2.5  # Half the 5.0 in eq. 3.14: the penalty at the ratio r from a limit is cos(2.5 r)^200

POWER = 200
"""Twice the exponent in eq. 3.14: the penalty is 1 at the limit, 0.2 at 5 % of the range from it and 0.002 at 10 %."""


class LimitedJoints(NamedTuple):
    """The n joints that have two limits."""

    idx_q: NDArray[np.intp]  # (n,) indices in the posture
    idx_v: NDArray[np.intp]  # (n,) indices in the tangent vector
    neutral: Array  # (n,) values in the neutral posture
    weights: Array  # (n,) g over the squared range
    limits: Array  # (2, n) upper, then lower limits
    phase: Array  # (2, n) derivative of the phase 2.5 r by the joint's value: r falls towards the upper limit


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
    a limit P stays 1, with zero slope.

    Attributes:
        weight: factor on the measure.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> relaxed = wb.tasks.Discomfort(weight=0.1)
    """

    weight: inputs.Weight = 1.0
    limited: LimitedJoints = field(init=False, repr=False)  # the joints that have two limits

    def resolve(self, scene: Scene, start: Array) -> Discomfort:
        """Read the limits, the neutral posture and the weights of the figure."""
        return filled(self, limited=inputs.once(scene, Discomfort, partial(_limited, scene.figure)))

    def value(self, state: State) -> float:
        """The discomfort."""
        joints = self.limited
        q = state.q[joints.idx_q]
        away = q - joints.neutral
        return float(joints.weights @ (away * away) + (np.cos(self._phase(q)) ** POWER).sum())

    def gradient(self, state: State) -> Array:
        """(nv,) derivative [1/rad]."""
        joints = self.limited
        q = state.q[joints.idx_q]
        phase = self._phase(q)
        slope = (-POWER * np.cos(phase) ** (POWER - 1) * np.sin(phase) * joints.phase).sum(axis=0)
        result = np.zeros(state.model.nv)
        result[joints.idx_v] = 2.0 * joints.weights * (q - joints.neutral) + slope
        return result

    def curvature(self, state: State) -> Array:
        """(nv,) second derivative, which is diagonal; its negative part near the limits is left out [1/rad^2]."""
        joints = self.limited
        phase = self._phase(state.q[joints.idx_q])
        cosine, sine = np.cos(phase), np.sin(phase)
        bend = POWER * cosine ** (POWER - 2) * ((POWER - 1) * sine * sine - cosine * cosine) * joints.phase**2
        result = np.full(state.model.nv, LEAST_CURVATURE)
        result[joints.idx_v] += 2.0 * joints.weights + np.maximum(bend, 0.0).sum(axis=0)
        return result

    def _phase(self, q: Array) -> Array:
        """(2, n) 2.5 r to the upper and lower limits, kept between zero at one limit and 2.5 at the other."""
        joints = self.limited
        return np.asarray(np.minimum(np.maximum((q - joints.limits) * joints.phase, 0.0), STEEPNESS))


def _limited(figure: Figure) -> LimitedJoints:
    limits = figure.limits
    moves = (limits.upper > limits.lower) & np.isfinite(limits.upper - limits.lower)
    idx_q, idx_v = limits.idx_q[moves], limits.idx_v[moves]
    ends = np.array([limits.upper[moves], limits.lower[moves]])
    span = ends[0] - ends[1]
    weights = figure.effort_weights[idx_v]
    greatest = np.ones(len(weights))
    for joints in figure.bodies.values():  # each figure's weights over the greatest of its own
        mine = np.isin(idx_v, [figure.model.joints[k].idx_v for k in joints])
        greatest[mine] = max(float(weights[mine].max(initial=0.0)), LEAST_CURVATURE)
    weights = weights / (greatest * span * span)
    phase = STEEPNESS * np.array([-1.0 / span, 1.0 / span])
    found = LimitedJoints(idx_q, idx_v, figure.neutral[idx_q], weights, ends, phase)
    for each in found:
        each.flags.writeable = False  # every problem of the scene shares them
    return found


class Masses(NamedTuple):
    """The masses: joint indices, the centre of each mass in its joint, squared weights, rest heights."""

    joints: NDArray[np.intp]
    centres: tuple[Array, ...]
    weights: Array
    heights: Array
    support: Array


@dataclass(frozen=True, eq=False)
class PotentialEnergy(Measure):
    """Squared change of the potential energy of every segment from the neutral posture [J^2].

    ``sum_k (m_k g)^2 (h_k - h_k_neutral)^2`` with h the height of a segment's centre of mass: the delta potential
    energy of Yang, Marler, Kim, Arora and Abdel-Malek 2004 ("Multi-Objective Optimization for Upper Body Posture
    Prediction"), over all segments. The neutral posture has the root's placement at the start. Both arms of an
    average man held out to the sides cost 100 J^2, so with a weight of 0.01 that counts like one radian of `Effort`.

    Attributes:
        weight: factor on the measure [1/J^2].

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> lazy = wb.tasks.PotentialEnergy(weight=1e-3)
    """

    weight: inputs.Weight = 1.0
    masses: Masses = field(init=False, repr=False)  # of the segments

    def resolve(self, scene: Scene, start: Array) -> PotentialEnergy:
        """Compute the weights of the segments, and their heights in the neutral posture."""
        model = scene.model
        neutral = np.array(scene.figure.neutral, dtype=float)
        for joint in scene.figure.roots.values():
            root = model.joints[joint]
            neutral[root.idx_q : root.idx_q + root.nq] = start[root.idx_q : root.idx_q + root.nq]
        joints = np.array([k for k in range(1, model.njoints) if model.inertias[k].mass > 0.0], dtype=np.intp)
        centres = tuple(np.array(model.inertias[int(k)].lever) for k in joints)
        # standard acceleration of gravity [m/s^2] (CGPM 1901).
        weights = np.array([(model.inertias[int(k)].mass * 9.80665) ** 2 for k in joints])
        with scene.figure.posed(neutral) as state:
            heights, support = _centres(state, joints, centres)[:, 2], state.support[joints]
        return filled(self, masses=Masses(joints, centres, weights, heights, support))

    def value(self, state: State) -> float:
        """The measure [J^2]."""
        bodies = self.masses
        rise = _centres(state, bodies.joints, bodies.centres)[:, 2] - bodies.heights
        return float(bodies.weights @ (rise * rise))

    def gradient(self, state: State) -> Array:
        """(nv,) derivative [J^2/rad and J^2/m]."""
        bodies = self.masses
        centres = _centres(state, bodies.joints, bodies.centres)
        wrenches = _lifts(centres) * (2.0 * bodies.weights * (centres[:, 2] - bodies.heights))[:, None]
        # All descendants of a joint act on it: sum their wrenches first, then multiply by each of its columns.
        columns = ((bodies.support.T @ wrenches) * state.jacobian.T).sum(axis=1)
        return np.asarray(state.folded(columns[None])[0])

    def curvature(self, state: State) -> Array:
        """(nv,) diagonal of the Gauss-Newton matrix of the heights [J^2/rad^2 and J^2/m^2]."""
        bodies = self.masses
        lifts = _lifts(_centres(state, bodies.joints, bodies.centres))
        rows = state.folded((lifts @ state.jacobian) * bodies.support)
        return np.asarray(2.0 * (bodies.weights @ (rows * rows)) + LEAST_CURVATURE)


def _centres(state: State, joints: NDArray[np.intp], centres: tuple[Array, ...]) -> Array:
    """(k, 3) centres of mass in the world."""
    places = state.data.oMi
    found = [places[joint].act(centre) for joint, centre in zip(joints.tolist(), centres, strict=True)]
    return np.array(found).reshape(-1, 3)


def _lifts(centres: Array) -> Array:
    """(k, 6) wrenches of upward unit forces at the centres: [z, c x z]."""
    rows = np.zeros((len(centres), 6))
    rows[:, 2] = 1.0
    rows[:, 3] = centres[:, 1]
    rows[:, 4] = -centres[:, 0]
    return rows
