"""The objective against its formula, and programs against a dense solver."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
import qpsolvers
import scipy.sparse as sp

import wholebody as wb
from wholebody.motion.trajectory import banded_qp
from wholebody.motion.trajectory.banded_qp import SOLVERS, BandedQP, banded_solver, warn_of_osqp
from wholebody.motion.trajectory.objective import Objective

TIME, DT = 0.1, 0.05


@pytest.mark.parametrize("seams", [(True, True), (False, True), (True, False), (False, False)])
def test_the_objective_is_its_formula(seams: tuple[bool, bool]) -> None:
    random = np.random.default_rng(0)
    x, weights = random.normal(size=(7, 3)), np.array([1.0, 2.0, 0.5])
    padded = np.vstack([*([np.zeros((2, 3))] if seams[0] else []), x, *([np.zeros((2, 3))] if seams[1] else [])])
    acceleration = np.diff(padded, n=2, axis=0) / DT**2
    expected = 0.5 * (weights * (x**2).sum(axis=0)).sum()
    expected += 0.5 * TIME**4 * (weights * (acceleration**2).sum(axis=0)).sum()
    assert Objective(7, weights, TIME, DT, seams).value(x) == pytest.approx(expected, rel=1e-12)


def banded(frames: int, dofs: int, seed: int) -> BandedQP:
    """A program with rows in every frame, some of which are violated at zero."""
    random = np.random.default_rng(seed)
    bands = Objective(frames, np.ones(dofs), TIME, DT, (True, True)).bands
    P = sp.csc_matrix(sp.kron(sp.csc_matrix(bands), sp.eye(dofs)))
    G = sp.csc_matrix(sp.block_diag([random.normal(size=(2, dofs)) for _ in range(frames)]))
    lower = random.normal(-0.1, 0.1, G.shape[0])
    n = frames * dofs
    return BandedQP(P, 0.1 * random.normal(size=n), G, lower, np.full(len(lower), np.inf), np.full(n, -1.0), np.ones(n))


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("seed", range(3))
def test_solvers_agree_with_a_dense_one(name: str, seed: int) -> None:
    pytest.importorskip(SOLVERS[name][0])
    program = banded(12, 4, seed)
    answer = banded_solver(name)[1](program)
    dense = qpsolvers.solve_qp(
        program.P.toarray(), program.c, -program.G.toarray(), -program.lower, lb=program.least, ub=program.most,
        solver="daqp",
    )  # fmt: skip
    assert answer.solved
    np.testing.assert_allclose(answer.z, dense, atol=2e-4)


def test_a_long_run_without_piqp_is_told_before(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    warn_of_osqp(None, 10**6)
    assert not caplog.records or importlib.util.find_spec("piqp") is None
    caplog.clear()
    monkeypatch.setattr(banded_qp, "find_spec", lambda name: None)
    warn_of_osqp(None, 10)
    warn_of_osqp("osqp", 10**6)
    assert not caplog.records
    warn_of_osqp(None, 10**6)
    assert "pip install piqp" in caplog.text


def test_an_unknown_solver_is_refused() -> None:
    with pytest.raises(wb.UnknownNameError, match="osqp"):
        wb.Trajectory(solver="osq")
    with pytest.raises(wb.InputError, match="solver"):
        wb.Trajectory(solver=3)  # type: ignore[arg-type]
