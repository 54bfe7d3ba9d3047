"""Reaching: sweeps of cyclic coordinate descent until the goals are met or nothing moves."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, pi
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.methods.ccd.guards import guards
from wholebody.methods.ccd.limbs import CarriedFrame, Limbs, moved, rotated
from wholebody.methods.ccd.sweep import Aims
from wholebody.methods.ccd.terms import GoalPlace, Request
from wholebody.methods.control import Control


class Reached(NamedTuple):
    """End of a descent: the largest remaining error (metres or radians), sweeps used, and whether it converged."""

    error: float
    sweeps: int
    converged: bool


def _aims(limbs: Limbs, data: Any, goals: Sequence[GoalPlace]) -> Aims:
    """The points and axes of all goals with their targets, where `data` has the joints that these limbs do not move."""
    # A place, then three axes of half the weight: their squared distances add up to twice that of a small angle.
    lever = 0.3  # m per radian: weight of orientation against position; about the length of a forearm
    rows: list[tuple[int, Any, Any, bool, float]] = []
    for goal in goals:
        carried = CarriedFrame(limbs, goal.frame)
        carried.read(data)
        if goal.place is not None:
            rows.append((carried.node, moved(carried.placement, *goal.offset), goal.place, True, goal.weight))
        if goal.rotation is not None:
            for axis, wanted in zip(np.eye(3).tolist(), goal.rotation.T, strict=True):
                weight = 0.5 * lever * lever * goal.weight
                rows.append((carried.node, rotated(carried.placement, *axis), wanted, False, weight))
    nodes, local, there, points, weights = zip(*rows, strict=True) if rows else ((), (), (), (), ())
    return Aims(limbs, nodes, local, there, points, weights)


class Reach:
    """The joints of a request, and its goals."""

    def __init__(self, figure: Figure, request: Request, control: Control) -> None:
        self._model = figure.model
        self.begin(request, control)
        self.limbs = Limbs(figure.model, request.joints)
        self._guards = guards(figure, self.limbs, request.kept)
        self._data = figure.model.createData()

    def begin(self, request: Request, control: Control) -> None:
        """Begin a run for the goals of a request that moves and keeps the same joints."""
        self._goals, self._control = request.goals, control

    def run(self, q: Array, tolerance: float, most: int) -> tuple[Array, Reached]:
        """Descend from a posture q (nq,) until every goal is met to a tolerance, at most `most` sweeps."""
        limbs = self.limbs
        q = q.copy()
        pin.forwardKinematics(self._model, self._data, q)
        limbs.read(q, self._data)
        limbs.forward()
        for guard in self._guards:
            guard.read(q, self._data)
            guard.keep()
        aims = _aims(limbs, self._data, self._goals)
        plan = aims.plan()
        error, last = aims.error, inf
        sweeps, converged = 0, not len(plan.turns)
        while error > tolerance and sweeps < most and not converged and not self._control.over:
            if sweeps % 25 == 0:  # near a goal convergence is linear, and sometimes slow
                converged = error > 0.97 * last
                last = error
                if converged:
                    break
            change = aims.sweep(plan)
            limbs.forward()
            for guard in self._guards:
                guard.keep()
            aims.carry()
            error = aims.error
            sweeps += 1
            converged = change < 1e-9
        limbs.write(q)
        return q, Reached(error, sweeps, converged)

    def disturbed(self, q: Array, size: float, rng: np.random.Generator) -> Array:
        """Copy of a posture q (nq,) with random joints, of a deviation `size` [rad, m] or, if infinite, anywhere."""
        q = q.copy()
        limbs = self.limbs
        pin.forwardKinematics(self._model, self._data, q)
        limbs.read(q, self._data)
        for node, value in enumerate(limbs.values.tolist()):
            low, high = max(limbs.lower[node], -pi), min(limbs.upper[node], pi)
            new = float(rng.uniform(low, high)) if size == inf else value + size * float(rng.normal())
            limbs.values[node] = min(max(new, limbs.lower[node]), limbs.upper[node])
        limbs.write(q)
        return q
