"""Recorded programs: a seed has the same ones, files say the same to qpsolvers, figures are those of the answers."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tests.audits.qp_programs import files
from tests.audits.qp_programs.measuring import measure, residuals, summaries
from tests.audits.qp_programs.recording import Recorded, record
from tests.reference.active_set import objective
from wholebody.base.arrays import with_values
from wholebody.base.errors import FileFormatError, InputError, UnknownNameError
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.registry import make_solver, solver_names


@pytest.fixture(scope="module")
def recorded() -> list[Recorded]:
    return record(["robot_arm", "drag"], 6, seed=3)


def same(one: QuadraticProgram, other: QuadraticProgram) -> bool:
    return all(map(np.array_equal, one, other))


def test_a_seed_has_the_same_programs(recorded: list[Recorded]) -> None:
    again = record(["robot_arm", "drag"], 6, seed=3)
    assert [one.name for one in again] == [one.name for one in recorded]
    assert all(same(one.program, other.program) for one, other in zip(again, recorded, strict=True))
    assert [one.set for one in recorded] == ["robot_arm"] * 3 + ["drag"] * 3
    others = record(["robot_arm"], 1, seed=4)
    assert not any(same(one.program, other.program) for one in others for other in recorded)


def test_more_programs_than_there_are_and_unknown_sets_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.audits.qp_programs.recording.CASES", 1)
    with pytest.raises(InputError, match=r"robot_arm has . programs in 1 cases; ask for fewer than 100"):
        record(["robot_arm"], 100, seed=0)
    with pytest.raises(UnknownNameError, match="robot_arm"):
        record(["robot_arms"], 1, seed=0)


def test_the_test_set_of_qpbenchmark_has_every_program(
    recorded: list[Recorded], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where qpbenchmark is not installed, by a stand-in with the two classes that the file uses."""
    qpsolvers = pytest.importorskip("qpsolvers")
    try:
        import qpbenchmark  # noqa: F401
    except ImportError:
        known = ModuleType("qpbenchmark")
        monkeypatch.setitem(vars(known), "TestSet", object)
        monkeypatch.setitem(vars(known), "Problem", qpsolvers.Problem)
        monkeypatch.setitem(sys.modules, "qpbenchmark", known)
    files.save(recorded, tmp_path)
    found = runpy.run_path(str(tmp_path / "wholebody_postures.py"))["WholebodyPostures"]()
    sizes = [len(problem.q) for problem in found]
    assert len(sizes) == len(recorded)
    programs = [one.program for one in sorted(recorded, key=lambda one: one.name)]
    assert sizes == [one.size + len(one.target) + len(one.least) for one in programs]
    assert found.title == "Whole-body postures"


def test_files_come_back_and_are_programs_of_qpsolvers(recorded: list[Recorded], tmp_path: Path) -> None:
    qpsolvers = pytest.importorskip("qpsolvers")
    files.save(recorded, tmp_path)
    back = {one.name: one for one in files.load(tmp_path)}
    assert set(back) == {one.name for one in recorded}
    for one in recorded:
        assert same(back[one.name].program, one.program)
        problem = qpsolvers.Problem.load(str(tmp_path / f"{one.name}.npz"))
        x = make_solver("daqp", hot_start=False).solve(one.program).x
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


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="has no programs"):
        files.load(tmp_path)
    np.savez(tmp_path / "robot_arm-000-000.npz", P=np.eye(2))
    with pytest.raises(FileFormatError, match="is no program"):
        files.load(tmp_path)
    (tmp_path / "robot_arm-000-000.npz").rename(tmp_path / "other.npz")
    with pytest.raises(FileFormatError, match="other"):
        files.load(tmp_path)


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
