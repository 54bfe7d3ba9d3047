"""Reaching: sweeps of cyclic coordinate descent until the goals are met or nothing moves."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, pi
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.methods.ccd.guard_kernel import compiled_kernel
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


class _Pursuit:
    """What the limbs carry to its targets, which they may carry too, where `data` has the joints that they don't."""

    def __init__(self, limbs: Limbs, data: Any, goals: Sequence[GoalPlace]) -> None:
        # A place, then three axes of half the weight: their squared distances add up to twice that of a small angle.
        lever = 0.3  # m per radian: weight of orientation against position; about the length of a forearm
        rows: list[tuple[int, Any, int, Any, bool, float, int | None]] = []
        for goal in goals:
            carried, to = CarriedFrame(limbs, goal.frame), CarriedFrame(limbs, goal.to)
            carried.read(data)
            to.read(data)
            if goal.place is not None:
                point, there = moved(carried.placement, *goal.offset), moved(to.placement, *goal.place)
                rows.append((carried.node, point, to.node, there, True, goal.weight, goal.half))
            if goal.rotation is not None:
                for axis, wanted in zip(np.eye(3).tolist(), goal.rotation.T.tolist(), strict=True):
                    own, there = rotated(carried.placement, *axis), rotated(to.placement, *wanted)
                    weight = 0.5 * lever * lever * goal.weight
                    rows.append((carried.node, own, to.node, there, False, weight, goal.half))
        nodes, local, bases, targets, points, weights, halves = zip(*rows, strict=True) if rows else ((),) * 7
        where = Aims(limbs, bases, targets, np.zeros((len(rows), 3)), points)
        self.aims = Aims(limbs, nodes, local, where.here, points, weights)
        # factors of all aims in each half of a sweep: one of two frames moves while the other one is its target
        still = [1 - half for half in (0, 1)] if {0, 1} <= set(halves) else [-1]
        moving = np.array([np.where([part == half for part in halves], 0.0, weights) for half in still])
        # for `descend`: aims and their nodes, targets and theirs, factors in each half of a sweep
        self.arrays = *self.aims.arrays, *where.arrays, moving.reshape(len(still), -1)
        self._frames = limbs.frames

    def carry(self) -> None:
        """Update where aims and targets are, after `limbs.forward`."""
        compiled_kernel().carry_both(self._frames, *self.arrays[:4])


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
        self._read(q)
        self._guards.read(q, self._data)
        self._guards.keep()
        pursuit = _Pursuit(limbs, self._data, self._goals)
        plan, descend = pursuit.aims.plan(), compiled_kernel().descend
        arrays = limbs.arrays, pursuit.arrays, tuple(plan), tuple(self._guards.tables), self._guards.inside
        error, last, state = pursuit.aims.error, inf, np.zeros(3)  # sweeps, halves of one, largest change
        converged = not len(plan.turns)
        while error > tolerance and state[0] < most and not converged and not self._control.over:
            if error > 0.97 * last:
                converged = True
                break
            # near a goal convergence is linear, and sometimes slow
            last, until = error, min(float(state[0]) + 25.0, float(most))
            while descend(*arrays, state, tolerance, until):
                self._guards.keep()
                pursuit.carry()
            error, converged = pursuit.aims.error, bool(state[2] < 1e-9)
        limbs.write(q)
        return q, Reached(error, int(state[0]), converged)

    def error(self, q: Array) -> float:
        """Largest error of the goals at a posture q (nq,), metres or radians."""
        self._read(q)
        return _Pursuit(self.limbs, self._data, self._goals).aims.error

    def _read(self, q: Array) -> None:
        """Move the limbs to a posture q (nq,)."""
        pin.forwardKinematics(self._model, self._data, q)
        self.limbs.read(q, self._data)
        self.limbs.forward()

    def disturbed(self, q: Array, size: float, rng: np.random.Generator) -> Array:
        """Copy of a posture q (nq,) with random joints, of a deviation `size` [rad, m] or, if infinite, anywhere."""
        q = q.copy()
        limbs = self.limbs
        self._read(q)
        for node, value in enumerate(limbs.values.tolist()):
            low, high = max(limbs.lower[node], -pi), min(limbs.upper[node], pi)
            new = float(rng.uniform(low, high)) if size == inf else value + size * float(rng.normal())
            limbs.values[node] = min(max(new, limbs.lower[node]), limbs.upper[node])
        limbs.write(q)
        return q
