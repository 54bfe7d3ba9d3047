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
from wholebody.methods.ccd.limbs import Limbs, Placement, compiled_kernel, floats, moved, rotated
from wholebody.methods.ccd.sweep import Aims, sweep
from wholebody.methods.ccd.terms import GoalPlace, Request
from wholebody.methods.control import Control

LEVER = 0.3  # m per radian: weight of orientation against position; about the length of a forearm
NOWHERE = (0.0, 0.0, 0.0)
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
WINDOW = 25  # sweeps over which progress is judged: near a goal convergence is linear, and sometimes slow
PROGRESS = 0.97  # the descent ends if a window leaves more than this share of the error


class Reached(NamedTuple):
    """End of a descent: the largest remaining error (metres or radians), sweeps used, and whether it converged."""

    error: float
    sweeps: int
    converged: bool


class _Goals:
    """The points and axes of all goals with their targets, each in the frame of the node that carries it.

    A goal's place comes first, then its three axes. Places have the weight of their goal, axes half of it: the squared
    distances of three axes from themselves turned by a small angle add up to twice its square.

    Attributes:
        aims: as sweeps take them.
    """

    def __init__(self, model: Any, limbs: Limbs, data: Any, goals: Sequence[GoalPlace]) -> None:
        """Take the goals, with joints that these limbs do not move where `data` has them."""
        self.aims, self._frames, self._kernel = Aims(), limbs.frames, compiled_kernel()
        nodes, local = [], []
        for goal in goals:
            frame = model.frames[goal.frame]
            joint = int(frame.parentJoint)
            node, placed = limbs.carrier(joint), data.oMi[joint] * frame.placement
            at = data.oMi[limbs.joints[node]].actInv(placed) if node >= 0 else pin.SE3.Identity()
            stand: Placement = floats(at)
            if goal.place is not None:
                nodes.append(node)
                local.append(moved(stand, *goal.offset))
                self.aims.add(node, NOWHERE, goal.place, weight=goal.weight)
            if goal.rotation is not None:
                for axis, wanted in zip(AXES, goal.rotation.T, strict=True):
                    nodes.append(node)
                    local.append(rotated(stand, *axis))
                    self.aims.add(node, NOWHERE, wanted, weight=0.5 * LEVER * LEVER * goal.weight, direction=True)
        self._nodes, self._local = np.array(nodes, dtype=np.intp), np.array(local, dtype=float).reshape(-1, 3)
        self._points = self.aims.points

    def carry(self) -> None:
        """Update the present values."""
        self._kernel.carry(self._frames, self._nodes, self._local, self._points, self.aims.here)

    @property
    def error(self) -> float:
        """Largest remaining distance or angle."""
        return float(self._kernel.greatest_error(self.aims.here, self.aims.there, self._points))


class Reach:
    """The joints of a request, and its goals."""

    def __init__(self, figure: Figure, request: Request, control: Control) -> None:
        """Prepare the joints."""
        self._model = figure.model
        self.begin(request, control)
        self.limbs = Limbs(figure.model, request.joints)
        self._guards = guards(figure, self.limbs, request.cones, request.ranges)
        self._data = figure.model.createData()

    def begin(self, request: Request, control: Control) -> None:
        """Begin a run for the goals of a request with the same joints, cones and ranges."""
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
        goals = _Goals(self._model, limbs, self._data, self._goals)
        goals.carry()
        aims = goals.aims
        steps = aims.plan(limbs)
        error, last = goals.error, inf
        sweeps, converged = 0, not len(steps.nodes)
        while error > tolerance and sweeps < most and not converged and not self._control.over:
            if sweeps % WINDOW == 0:
                converged = error > PROGRESS * last
                last = error
                if converged:
                    break
            change = sweep(limbs, aims, steps)
            limbs.forward()
            for guard in self._guards:
                guard.keep()
            goals.carry()
            error = goals.error
            sweeps += 1
            converged = change < 1e-9
        limbs.write(q)
        return q, Reached(error, sweeps, converged)

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
        for node, value in enumerate(limbs.values.tolist()):
            low, high = max(limbs.lower[node], -pi), min(limbs.upper[node], pi)
            new = float(rng.uniform(low, high)) if size == inf else value + size * float(rng.normal())
            limbs.values[node] = min(max(new, limbs.lower[node]), limbs.upper[node])
        limbs.write(q)
        return q
