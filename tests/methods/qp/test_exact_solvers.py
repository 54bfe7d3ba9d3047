"""Every solver alone is exact: against bounded least squares of scipy, on programs that hypothesis makes up."""

from __future__ import annotations

import numpy as np
import pytest
import qpsolvers
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from tests.reference.active_set import objective
from wholebody.base.arrays import with_values
from wholebody.methods.qp.quadratic_program import QuadraticProgram
from wholebody.methods.qp.solvers.base import SCALING, scaled_split
from wholebody.methods.qp.solvers.registry import make_solver, solver_names

TOLERANCE = 1e-6  # rad: bounded least squares of weights that differ by a factor of 1e6 are as exact as this


def by_least_squares(program):
    """The minimiser, with what an elastic row has to spare as a variable that is not negative."""
    n, k = program.size, len(program.least)
    own, soft, pushing = (
        np.sqrt(values)[:, None] for values in (program.diagonal, program.weight, program.elastic_weight)
    )
    table = np.vstack(
        [
            np.hstack([own * np.eye(n), np.zeros((n, k))]),
            np.hstack([soft * program.rows, np.zeros((len(program.rows), k))]),
            np.hstack([pushing * program.elastic, -pushing * np.eye(k)]),
        ]
    )
    right = np.concatenate([-program.linear / own[:, 0], soft[:, 0] * program.target, pushing[:, 0] * program.least])
    bounds = np.concatenate([program.lower, np.zeros(k)]), np.concatenate([program.upper, np.full(k, np.inf)])
    return lsq_linear(table, right, bounds, method="bvls", tol=1e-14, max_iter=1000).x[:n]


@st.composite
def programs(draw):
    n, m, k = draw(st.integers(1, 8)), draw(st.integers(0, 4)), draw(st.integers(0, 8))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    heaviest = draw(st.sampled_from([1e2, 1e4, 1e6]))
    return QuadraticProgram(
        diagonal=10.0 ** rng.uniform(-1, 1, n),
        linear=rng.normal(size=n),
        rows=rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.7),
        target=0.3 * rng.normal(size=m),
        weight=rng.uniform(1.0, heaviest, m),
        elastic=rng.normal(size=(k, n)),
        least=0.3 * rng.normal(size=k),
        elastic_weight=rng.uniform(1.0, heaviest, k),
        lower=-rng.uniform(0.01, 0.3, n),
        upper=rng.uniform(0.01, 0.3, n),
    )


@pytest.mark.parametrize("name", solver_names())
@settings(max_examples=20, deadline=None)
@given(program=programs())
def test_every_solver_is_exact(name, program):
    solver = make_solver(name)
    once, again = solver.solve(program), solver.solve(program)
    assert once.exact
    assert once.x == pytest.approx(by_least_squares(program), abs=TOLERANCE)
    assert once.x == pytest.approx(again.x, abs=1e-9), "from its own last answer"
    fresh = make_solver(name).solve(program)
    assert np.array_equal(fresh.x, once.x)
    assert (fresh.by, fresh.iterations) == (once.by, once.iterations)


@settings(max_examples=20, deadline=None)
@given(program=programs())
def test_the_scaled_form_is_the_same_program(program):
    """At the residuals and slacks of a displacement, the objective is the program's, whatever the weights."""
    m, form = len(program.target), scaled_split(program)
    rng = np.random.default_rng(0)
    x = rng.uniform(program.lower, program.upper)
    r, s = program.rows @ x - program.target, np.maximum(program.least - program.elastic @ x, 0.0)
    z = np.concatenate([SCALING.x * x, np.sqrt(program.weight) * r, np.sqrt(program.elastic_weight) * s])
    assert 0.5 * (form.diagonal * z) @ z + form.linear @ z == pytest.approx(objective(program, x), rel=1e-9)
    rows = form.matrix @ z
    assert rows[:m] == pytest.approx(form.least[:m], abs=1e-9 * (1.0 + np.abs(form.least[:m]).max(initial=0.0)))
    assert (rows[m:] >= form.least[m:] - 1e-9 * np.abs(form.least[m:]) - 1e-12).all()


@pytest.mark.parametrize("name", ["quadprog", "piqp"])
def test_solvers_of_qpsolvers_close_programs_with_heavy_rows(name, random_program):
    """Weights of 1e10 beside 1; what a solver answers itself is near, before its active set is corrected."""
    rng, closed, off = np.random.default_rng(2), 0, []
    for _ in range(100):
        program = with_values(random_program(rng), weight=np.array([1.0, 1e10, 1e4, 1e10]))
        solver = make_solver(name)
        answer = solver.solve(program)
        closed += answer.by == name
        off.append(np.abs(solver.uncorrected - answer.x).max())
    assert closed >= 90
    assert np.quantile(off, 0.9) < 1e-3


def test_a_solver_may_refuse_a_program(monkeypatch, random_program):
    """DAQP did where five joints were frozen and two holds contradicted each other (too many equalities)."""

    def refuse(*_, **__):
        raise ValueError("constraints are inconsistent, no solution")

    monkeypatch.setattr(qpsolvers, "solve_problem", refuse)
    program = random_program(np.random.default_rng(4))
    answer = make_solver("daqp").solve_cold(program)
    assert answer.by != "daqp"
    assert answer.x == pytest.approx(make_solver("osqp").solve_cold(program).x, abs=1e-9)
