"""Measure: change of the potential energy of the segments."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import Measure, filled
from wholebody.tasks.distance import LEAST_CURVATURE


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
