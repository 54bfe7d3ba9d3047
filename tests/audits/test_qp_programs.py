"""Recorded programs: a seed has the same ones, figures are those of the answers."""

from __future__ import annotations

import numpy as np
import pytest

from tests.audits.qp_programs.measuring import measure, residuals, summaries
from tests.audits.qp_programs.recording import Recorded, record
from wholebody.base.arrays import with_values
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.registry import solver_names


@pytest.fixture(scope="module")
def recorded() -> list[Recorded]:
    return record(["robot_arm", "drag"], 6, seed=3)


def same(one: QuadraticProgram, other: QuadraticProgram) -> bool:
    return all(map(np.array_equal, one, other))


def test_a_seed_has_the_same_programs(recorded: list[Recorded]) -> None:
    assert [one.set for one in recorded] == ["robot_arm"] * 3 + ["drag"] * 3
    again = record(["robot_arm"], 3, seed=3)
    assert [one.name for one in again] == [one.name for one in recorded[:3]]
    assert all(same(one.program, other.program) for one, other in zip(again, recorded, strict=False))
    others = record(["robot_arm"], 3, seed=4)
    assert not any(same(one.program, other.program) for one in others for other in recorded)


def test_more_programs_than_there_are_and_unknown_sets_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.audits.qp_programs.recording.CASES", 1)
    with pytest.raises(InputError, match=r"robot_arm has . programs in 1 cases; ask for fewer than 100"):
        record(["robot_arm"], 100, seed=0)
    with pytest.raises(UnknownNameError, match="robot_arm"):
        record(["robot_arms"], 1, seed=0)


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


def test_every_solver_is_given_every_program(recorded: list[Recorded]) -> None:
    solvers = solver_names()
    rows = measure(recorded, solvers)
    assert len(rows) == len(recorded) * len(solvers)
    totals = summaries(rows, solvers)
    assert [total.solver for total in totals] == list(solvers)
    for total in totals:
        assert total.programs == total.closed + total.handed_on + total.failed == len(recorded)
        assert total.share.low <= total.closed / total.programs == total.share.value <= total.share.high
        assert total.failed == 0
        assert 0.0 < total.median_us.low <= total.median_us.value <= total.median_us.high
        assert total.dual < 1e-4
    daqp = next(total for total in totals if total.solver == "daqp")
    assert daqp.closed == daqp.programs
    assert daqp.own_error < 1e-6
