"""EAIK: all branches of arms of six turning joints in closed form, of which the nearest within limits is taken."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.bench.suite.adapters.one_chain import Chain, OneChain
from wholebody.problem import Problem

TURN = 2.0 * np.pi


class _Chain(Chain):
    def __init__(self, model: pin.Model, frame: int) -> None:
        from eaik.IK_HP import HPRobot

        super().__init__(model, frame)
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        places = [data.oMi[joint] for joint in self.joints]
        axes = np.array([data.J[3:, model.joints[joint].idx_v] for joint in self.joints])
        points = np.array([np.zeros(3), *(place.translation for place in places), places[-1].translation])
        self._robot, self._turned = HPRobot(axes, np.diff(points, axis=0)), places[-1].rotation
        self._lower, self._upper = (
            limit[self.places] for limit in (model.lowerPositionLimit, model.upperPositionLimit)
        )

    def values(self, start: Array, target: pin.SE3, tolerance: float) -> Any:
        found = self._robot.IK(pin.SE3(target.rotation @ self._turned.T, target.translation).homogeneous)
        exact = np.atleast_2d(found.Q)[~np.asarray(found.is_LS, dtype=bool)]
        near = exact + TURN * np.round((start - exact) / TURN)
        near -= TURN * np.ceil((near - self._upper) / TURN).clip(0.0)
        near += TURN * np.ceil((self._lower - near) / TURN).clip(0.0)
        near = near[(near <= self._upper).all(axis=1)]
        return near[((near - start) ** 2).sum(axis=1).argmin()] if len(near) else None


class Eaik(OneChain):
    """EAIK as a method."""

    name = "eaik"
    chain = _Chain
    way = "in closed form"
    failure = "EAIK found no branch within limits"

    def unsupported(self, problem: Problem) -> list[str]:
        """Names of what EAIK cannot express."""
        refused = super().unsupported(problem)
        if not refused:
            (goal,) = problem.goals
            model = problem.scene.model
            chain = list(model.supports[goal.residual.place.joint])[1:]  # type: ignore[attr-defined]
            if len(chain) != 6 or any(model.joints[joint].shortname().startswith("JointModelP") for joint in chain):
                refused = ["an arm of other than six turning joints"]
        return refused
