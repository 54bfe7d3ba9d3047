from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from wholebody.assessment.posture import assess
from wholebody.base.arrays import Array
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.problem import Problem
from wholebody.solution import Solution, Status


@dataclass
class Fake:
    """A method that answers with a posture and a status, whatever they are worth."""

    answer: Callable[[Problem], Array]
    status: Status
    name: str = "fake"

    def solve(self, problem: Problem) -> Solution:
        q = self.answer(problem)
        judged = assess(problem, np.where(np.isfinite(q), q, 0.0))
        return Solution(q, self.status, 0.0, 1, judged, (), self.name, "as it is")


@pytest.fixture
def fake() -> Callable[..., Adapter]:
    """Return a function: an answer to a problem, and a status -> an adapter."""

    def made(answer: Callable[[Problem], Array], status: Status = "stalled") -> Adapter:
        return Adapter("fake", lambda tolerance, iterations: Fake(answer, status), ())

    return made
