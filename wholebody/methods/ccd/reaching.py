"""Reaching: sweeps of cyclic coordinate descent until the goals are met or nothing moves."""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, inf, pi
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.methods.ccd.cones import guards
from wholebody.methods.ccd.limbs import Limbs, Placement, floats, moved, rotated
from wholebody.methods.ccd.sweep import Aims, sweep
from wholebody.methods.ccd.terms import Request, Wish
from wholebody.methods.control import Control

LEVER = 0.3  # m per radian: weight of orientation against position; about the length of a forearm
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
WINDOW = 25  # sweeps over which progress is judged: near a goal convergence is linear, and sometimes slow
PROGRESS = 0.97  # the descent ends if a window leaves more than this share of the error


class Reached(NamedTuple):
    """End of a descent: the largest remaining error (metres or radians), sweeps used, and whether it converged."""

    error: float
    sweeps: int
    rested: bool


class _Aim(NamedTuple):
    """One goal: its node, the point and axes in the node's frame, their targets, and its index in the aims."""

    node: int
    local: tuple[float, float, float]
    place: tuple[float, float, float] | None
    axes: tuple[tuple[float, float, float], ...]
    wanted: tuple[tuple[float, float, float], ...]
    weight: float


class Reach:
    """The joints of a request, and its goals."""

    def __init__(self, figure: Figure, request: Request, control: Control) -> None:
        """Prepare the joints."""
        self._control = control
        self._model, self._request = figure.model, request
        self.limbs = Limbs(figure.model, request.joints)
        self._guards = guards(figure, self.limbs, request.cones)
        self._data = figure.model.createData()

    def run(self, q: Array, tolerance: float, most: int) -> tuple[Array, Reached]:
        """Descend from a posture q (nq,) until every goal is met to a tolerance, at most `most` sweeps."""
        limbs = self.limbs
        q = q.copy()
        pin.forwardKinematics(self._model, self._data, q)
        limbs.read(q, self._data)
        limbs.forward()
        for guard in self._guards:
            guard.read(self._data)
            guard.keep()
        goals = [_aim(self._model, limbs, self._data, wish) for wish in self._request.wishes]
        aims = _aims(goals)
        self._carry(aims, goals)
        steps = aims.plan(limbs)
        error, last = _error(aims, goals), inf
        sweeps, rested = 0, not steps
        while error > tolerance and sweeps < most and not rested and not self._control.over:
            if sweeps % WINDOW == 0:
                rested = error > PROGRESS * last
                last = error
                if rested:
                    break
            change = sweep(limbs, aims, steps)
            limbs.forward()
            for guard in self._guards:
                guard.keep()
            self._carry(aims, goals)
            error = _error(aims, goals)
            sweeps += 1
            rested = change < 1e-9
        limbs.write(q)
        return q, Reached(error, sweeps, rested)

    def disturbed(self, q: Array, size: float, rng: np.random.Generator) -> Array:
        """Copy of a posture q (nq,) with random joints, near their values or anywhere.

        Args:
            q: (nq,) posture.
            size: standard deviation, radians or metres; infinite for anywhere within the limits.
            rng: the random generator.
        """
        q = q.copy()
        limbs = self.limbs
        pin.forwardKinematics(self._model, self._data, q)
        limbs.read(q, self._data)
        for node, value in enumerate(limbs.values):
            low, high = max(limbs.lower[node], -pi), min(limbs.upper[node], pi)
            new = float(rng.uniform(low, high)) if size == inf else value + size * float(rng.normal())
            limbs.values[node] = min(max(new, limbs.lower[node]), limbs.upper[node])
        limbs.write(q)
        return q

    def _carry(self, aims: Aims, goals: Sequence[_Aim]) -> None:
        """Write the present positions of the points and axes."""
        k = 0
        for goal in goals:
            frame = self.limbs.frames[goal.node]
            if goal.place is not None:
                aims.here[k] = moved(frame, *goal.local)
                k += 1
            for axis in goal.axes:
                aims.here[k] = rotated(frame, *axis)
                k += 1


def _aim(model: Any, limbs: Limbs, data: Any, wish: Wish) -> _Aim:
    frame = model.frames[wish.frame]
    joint = int(frame.parentJoint)
    node = limbs.carrier(joint)
    at = data.oMi[limbs.joints[node]].actInv(data.oMi[joint] * frame.placement) if node >= 0 else pin.SE3.Identity()
    local: Placement = floats(at)
    axes = wanted = ()
    if wish.rotation is not None:
        axes = tuple(rotated(local, *axis) for axis in AXES)  # type: ignore[assignment]
        wanted = tuple(tuple(column) for column in wish.rotation.T.tolist())  # type: ignore[assignment]
    return _Aim(node, moved(local, *wish.offset), wish.place, axes, wanted, wish.weight)


def _aims(goals: Sequence[_Aim]) -> Aims:
    """Points with the weight of their goal, axes with half of it.

    Rotating three axes by a small angle gives squared distances whose sum is twice the square of the angle.
    """
    aims, nowhere = Aims(), (0.0, 0.0, 0.0)
    for goal in goals:
        if goal.place is not None:
            aims.add(goal.node, nowhere, goal.place, weight=goal.weight)
        for wanted in goal.wanted:
            aims.add(goal.node, nowhere, wanted, weight=0.5 * LEVER * LEVER * goal.weight, direction=True)
    return aims


def _error(aims: Aims, goals: Sequence[_Aim]) -> float:
    """Largest remaining distance or angle."""
    worst, k = 0.0, 0
    for goal in goals:
        if goal.place is not None:
            (x, y, z), (tx, ty, tz) = aims.here[k], goal.place
            worst = max(worst, ((x - tx) ** 2 + (y - ty) ** 2 + (z - tz) ** 2) ** 0.5)
            k += 1
        if goal.axes:
            square = 0.0
            for n, wanted in enumerate(goal.wanted):
                here = aims.here[k + n]
                square += sum((a - b) ** 2 for a, b in zip(here, wanted, strict=True))
            # the sum over the three axes is 4 (1 - cos angle) = 8 sin^2(angle / 2)
            worst = max(worst, acos(max(-1.0, 1.0 - square / 4.0)))
            k += 3
    return worst
