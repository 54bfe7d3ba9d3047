"""Random programs, and what every answer of a solve must be."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.suite.stability.bodies import Builder
from wholebody.methods.qp.quadratic_program import QuadraticProgram


def _random_program(rng: np.random.Generator, n: int = 12, m: int = 4, k: int = 9) -> QuadraticProgram:
    """A program in which some bounds and some elastic rows are at work."""
    return QuadraticProgram(
        diagonal=10.0 ** rng.uniform(-2, 1, n),
        linear=rng.normal(size=n),
        rows=rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.7),
        target=0.3 * rng.normal(size=m),
        weight=10.0 ** rng.uniform(0, 8, m),
        elastic=rng.normal(size=(k, n)),
        least=0.3 * rng.normal(size=k),
        elastic_weight=10.0 ** rng.uniform(2, 10, k),
        lower=-rng.uniform(0.0, 0.3, n) * (rng.random(n) < 0.9),
        upper=rng.uniform(0.0, 0.3, n) * (rng.random(n) < 0.9),
    )


@pytest.fixture(scope="session")
def random_program() -> Callable[..., QuadraticProgram]:
    """Return a function: generator, sizes -> a program."""
    return _random_program


@pytest.fixture(scope="session")
def honest(least_distance: Callable[..., float]) -> Callable[..., wb.Solution]:
    """Return a function that checks an answer against its status and returns it."""

    def checked(problem: wb.Problem, solution: wb.Solution, tolerance: float = 1e-5) -> wb.Solution:
        """Check that an answer is what its status says it is; return it."""
        q, figure = solution.q, problem.scene.figure
        assert np.isfinite(q).all()
        assert q == pytest.approx(pin.normalize(figure.model, q), abs=1e-9)
        assert figure.within_limits(q)
        judged = wb.assess(problem, q)
        assert judged.goal_error == pytest.approx(solution.assessment.goal_error, abs=1e-12)
        slack = 1.1 * tolerance + 2e-6
        if solution.status in ("solved", "unreachable"):
            assert least_distance(problem.scene, q) >= problem.clearances.min(initial=0.0) - slack
            assert judged.holds(slack)
        if solution.status == "solved":
            assert judged.met(slack)
        if solution.status == "unreachable":
            assert not judged.met(tolerance)
        return solution

    return checked


@pytest.fixture(scope="module")
def two_arms() -> wb.Figure:
    """A slide that carries two arms of three joints."""
    builder = Builder("two arms")
    base = builder.joint("py", "slide")
    for side, y in (("left", 0.2), ("right", -0.2)):
        joint, at = base, (0.0, y, 0.0)
        for kind, name in (("rz", "yaw"), ("ry", "lift"), ("ry", "bend")):
            joint = builder.joint(kind, f"{side}_{name}", parent=joint, at=at)
            at = (0.3, 0.0, 0.05)
        builder.frame(joint, side, at)
    return builder.figure()
