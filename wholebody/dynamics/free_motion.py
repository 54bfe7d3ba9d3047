"""How the joints of a figure move in a step without contacts: the midpoint rule, with implicit springs."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.dynamics.impulse_kernel import by_inertia


class Springs(NamedTuple):
    """Springs and dampers (nv,) towards a tracked posture, the way there, and its velocity.

    Their forces are those at a share of a step (nv,): half way they do the work of the step, and its end is safe where
    contacts press, or where they are so stiff that half way would turn the velocity round.
    """

    stiffness: Array
    damping: Array
    apart: Array
    steady: Array
    share: Array

    @staticmethod
    def shares(stiffness: Array, damping: Array, inertia: Array, time: float, near: Array) -> Array:
        """Shares of a step of freedoms that move inertias (nv,), and what is near along rows (k, nv)."""
        soft = np.maximum(time * (damping + time * stiffness) / inertia, 1e-9)
        return np.where(near.any(axis=0), 1.0, np.maximum(0.5, 1.0 - 1.0 / soft))

    def taken(self, begin: Array, end: Array) -> Array:
        """The velocity (nv,) at the share of a step."""
        return np.asarray(begin + self.share * (end - begin))

    def forces(self, time: float, velocity: Array) -> Array:
        """Forces (nv,) at the share of a step that moves with a velocity (nv,)."""
        return self._pull(time, velocity) + self.damping * (self.steady - velocity)

    def excess(self, time: float, velocity: Array, left: Array) -> float:
        """Work of the springs beyond what they had stored and the tracker gave, J; `left` (nv,) is the way at the end.

        Turns of a root are no vectors, so along one the springs do not quite do the work that they store.
        """
        pull = self._pull(time, velocity)
        stored = 0.5 * float(self.stiffness @ (self.apart**2 - left**2)) + time * float(pull @ self.steady)
        return max(0.0, time * float(pull @ velocity) - stored)

    def _pull(self, time: float, velocity: Array) -> Array:
        return self.stiffness * (self.apart + self.share * time * (self.steady - velocity))


class FreeMotion(NamedTuple):
    """The end of a step without contacts."""

    inertia: Array  # (nv, nv) that impulses meet, with what the implicit springs add
    velocity: Array  # (nv,)
    mean: Array  # (nv,) of the step
    borne: Array  # (nv,) weight that springs bear


def free_motion(
    model: pin.Model,
    data: pin.Data,
    inertia: Callable[[Array], Array],
    q: Array,
    begin: Array,
    time: float,
    springs: Springs,
) -> FreeMotion:
    """The motion of a step from a posture (nq,) and a velocity (nv,); `inertia` of joints at a posture.

    Where two axes of a joint nearly align, the forces of motion change so much within a step that the rule makes a
    thousand times the energy. A step whose kinetic energy would be more than twice what is there and what the forces
    do has weight and springs alone, with the inertia at its start.
    """
    soft = time * springs.damping + time * time * springs.share * springs.stiffness
    there = 0.5 * float(begin @ inertia(q) @ begin)

    def ended(middle: Array, mean: Array) -> tuple[FreeMotion, float]:
        """The step with the forces at a posture and a velocity, and the work of those of motion."""
        weight = np.asarray(pin.computeGeneralizedGravity(model, data, middle)).copy()
        forces = np.asarray(pin.nonLinearEffects(model, data, middle, mean)).copy()
        masses, borne = inertia(middle), np.where(springs.stiffness > 0.0, weight, 0.0)
        driven = masses + np.diag(springs.share * soft)
        pull = springs.stiffness * springs.apart - forces + borne
        lead = soft * (springs.steady - (1.0 - springs.share) * begin)
        velocity = by_inertia(driven, masses @ begin + time * pull + lead)
        half = 0.5 * (begin + velocity)
        kinetic = 0.5 * float(velocity @ masses @ velocity)
        done = kinetic - 0.5 * float(begin @ masses @ begin) + time * float(half @ (forces - weight))
        return FreeMotion(driven, velocity, half, borne), kinetic - 2.0 * (there + max(0.0, done))

    motion, _ = ended(q, begin)  # first with the forces at the start, then those half way
    motion, excess = ended(np.asarray(pin.integrate(model, q, 0.5 * time * motion.mean)), motion.mean)
    return motion if excess <= 0.0 else ended(q, np.zeros(model.nv))[0]


def aligning(model: pin.Model) -> Mask:
    """Freedoms (nv,) of the first and the last of three hinges in a point, whose axes can align."""
    found: Mask = np.zeros(model.nv, dtype=bool)
    for last in range(1, model.njoints):
        middle = model.parents[last]
        first = model.parents[middle]
        hinges = [model.joints[k] for k in (first, middle, last)]
        apart = max(np.abs(model.jointPlacements[k].translation).max() for k in (middle, last))
        if (
            first
            and apart < 1e-9
            and all(hinge.nv == 1 and hinge.shortname().startswith("JointModelR") for hinge in hinges)
        ):
            found[[hinges[0].idx_v, hinges[2].idx_v]] = True
    return found
