"""Recorded programs: a seed has the same ones, files say the same to qpsolvers, figures are those of the answers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.audits.qp_programs import files
from tests.audits.qp_programs.measuring import residuals
from tests.audits.qp_programs.recording import Recorded, record
from tests.reference.active_set import objective
from wholebody.base.arrays import with_values
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.registry import make_solver


@pytest.fixture(scope="module")
def recorded() -> list[Recorded]:
    return record(["robot_arm", "drag"], 6, seed=3)


def same(one: QuadraticProgram, other: QuadraticProgram) -> bool:
    return all(map(np.array_equal, one, other))


def test_files_come_back_and_are_programs_of_qpsolvers(recorded: list[Recorded], tmp_path: Path) -> None:
    qpsolvers = pytest.importorskip("qpsolvers")
    files.save(recorded, tmp_path)
    back = {one.name: one for one in files.load(tmp_path)}
    assert set(back) == {one.name for one in recorded}
    for one in recorded:
        assert same(back[one.name].program, one.program)
        problem = qpsolvers.Problem.load(str(tmp_path / f"{one.name}.npz"))
        x = make_solver("daqp").solve(one.program).x
        r = one.program.rows @ x - one.program.target
        s = np.maximum(one.program.least - one.program.elastic @ x, 0.0)
        z = np.concatenate([x, r, s])
        assert problem.A @ z == pytest.approx(problem.b, abs=1e-12)
        assert (problem.G @ z <= problem.h + 1e-12).all()
        assert (z >= problem.lb).all()
        assert (z <= problem.ub).all()
        least = objective(one.program, x)
        constant = 0.5 * z @ problem.P @ z + problem.q @ z
        assert constant == pytest.approx(least, rel=1e-9, abs=1e-9)


def test_residuals_of_a_program_that_is_solved_by_hand() -> None:
    """Minimise x^2/2 + 5 (x - 1)^2 / 2 with x at most 0.5: x = 0.5, held by a multiplier of 2."""
    program = QuadraticProgram(
        diagonal=np.ones(1), linear=np.zeros(1), rows=np.ones((1, 1)), target=np.ones(1), weight=np.full(1, 5.0),
        elastic=np.zeros((0, 1)), least=np.zeros(0), elastic_weight=np.zeros(0), lower=np.zeros(1),
        upper=np.full(1, 0.5),
    )  # fmt: skip
    none, one = np.zeros(1, dtype=bool), np.ones(1, dtype=bool)
    held = QPSolution(np.array([0.5]), ActiveSet(none, one, none[:0]), True, 1)
    assert residuals(program, held) == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)
    outside = residuals(program, held._replace(x=np.array([0.6])))
    assert outside.primal == pytest.approx(0.1)
    short = residuals(program, held._replace(x=np.array([0.4])))
    assert short.dual == pytest.approx(0.1)  # as far as the bound allows
    assert short.gap > 0.01
    free = with_values(program, upper=np.ones(1))
    assert residuals(free, held._replace(x=np.array([5.0 / 6.0]))) == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)
