"""Measure: change of the potential energy of the segments."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.tasks import inputs
from wholebody.tasks.base import Surroundings, filled
from wholebody.tasks.distance import SumOfSquares


class Masses(NamedTuple):
    """The masses: joint indices, the centre of each mass in its joint, squared weights, rest heights."""

    joints: NDArray[np.intp]
    centres: Array
    weights: Array
    heights: Array


@dataclass(frozen=True, eq=False)
class PotentialEnergy(SumOfSquares):
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
        >>> lazy = wb.PotentialEnergy(weight=1e-3)
    """

    weight: inputs.Weight = 1.0
    masses: Masses = field(init=False, repr=False)  # of the segments

    def resolve(self, scene: Surroundings, start: Array) -> PotentialEnergy:
        """Compute the weights of the segments, and their heights in the neutral posture."""
        model = scene.model
        neutral = np.array(scene.figure.neutral, dtype=float)
        for joint in scene.figure.roots.values():
            root = model.joints[joint]
            neutral[root.idx_q : root.idx_q + root.nq] = start[root.idx_q : root.idx_q + root.nq]
        state = State(model).update(neutral)
        joints = np.array([k for k in range(1, model.njoints) if model.inertias[k].mass > 0.0], dtype=np.intp)
        centres = np.array([model.inertias[int(k)].lever for k in joints]).reshape(-1, 3)
        # standard acceleration of gravity [m/s^2] (CGPM 1901).
        weights = np.array([(model.inertias[int(k)].mass * 9.80665) ** 2 for k in joints])
        heights = _centres(state, joints, centres)[:, 2]
        return filled(self, masses=Masses(joints, centres, weights, heights))

    def squares(self, state: State) -> tuple[Array, Array]:
        """How far each segment has risen times its weight (k,) [J], and the derivative (k, nv)."""
        bodies = self.masses
        centres, roots = _centres(state, bodies.joints, bodies.centres), np.sqrt(bodies.weights)
        lifts = np.zeros((len(centres), 6))  # wrenches of upward unit forces at the centres: [z, c x z]
        lifts[:, 2], lifts[:, 3], lifts[:, 4] = 1.0, centres[:, 1], -centres[:, 0]
        rows = state.rows(lifts, bodies.joints, np.zeros_like(bodies.joints))
        return roots * (centres[:, 2] - bodies.heights), roots[:, None] * rows


def _centres(state: State, joints: NDArray[np.intp], centres: Array) -> Array:
    """(k, 3) centres of mass in the world."""
    placed = state.joints[joints]  # (k, 4, 3) columns of the rotation, then the translation
    return np.asarray(np.einsum("ki,kij->kj", centres, placed[:, :3]) + placed[:, 3])
