"""TRAC-IK: Newton's method with restarts and a quadratic program on one frame's error, beside each other."""

from __future__ import annotations

from typing import Any

import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.bench.suite.adapters.one_chain import Chain, OneChain


class _Chain(Chain):
    def __init__(self, model: pin.Model, frame: int) -> None:
        super().__init__(model, frame)
        self._solver: Any = None
        self._asked, self._model = 0.0, model

    def values(self, start: Array, target: pin.SE3, tolerance: float) -> Any:
        if tolerance != self._asked:  # which it takes when it is made
            from trac_ik import TracIK

            with self.written(self._model) as (path, first, last):
                self._solver = TracIK(first, last, str(path), timeout=0.05, epsilon=0.3 * tolerance)
            self._asked = tolerance
        return self._solver.ik(target.translation, target.rotation, start)


class Tracik(OneChain):
    """TRAC-IK as a method."""

    name = "tracik"
    chain = _Chain
    way = "by its restarts"
    failure = "TRAC-IK found no posture in its time"
