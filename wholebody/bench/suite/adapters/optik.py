"""optik: random restarts of a bounded quasi-Newton method (SLSQP) on the error of one frame at the end of a chain."""

from __future__ import annotations

from typing import Any

import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.bench.suite.adapters.one_chain import Chain, OneChain


class _Chain(Chain):
    def __init__(self, model: pin.Model, frame: int) -> None:
        import optik

        super().__init__(model, frame)
        with self.written(model) as (path, first, last):
            self._robot = optik.Robot.from_urdf_file(str(path), first, last)
        self._robot.set_parallelism(1)

    def values(self, start: Array, target: pin.SE3, tolerance: float) -> Any:
        import optik

        # optik bounds the squared error, here of the frame itself; its restarts end after 1 s.
        settings = optik.SolverConfig(solution_mode="speed", max_time=1.0, tol_f=(0.5 * tolerance) ** 2)
        answer: Any = self._robot.ik(settings, (target * self.end).homogeneous, start, self.end.homogeneous)
        return None if answer is None else answer[0]


class Optik(OneChain):
    """optik as a method."""

    name = "optik"
    chain = _Chain
    way = "by its restarts"
    failure = "optik found no posture in its time"
