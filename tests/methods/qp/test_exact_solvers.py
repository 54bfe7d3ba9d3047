"""Every solver alone is exact: against bounded least squares of scipy, on programs that hypothesis makes up."""

from __future__ import annotations

import daqp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from wholebody.base.records import with_values
from wholebody.methods.qp.quadratic_program import QuadraticProgram
from wholebody.methods.qp.solvers.osqp_solver import OSQPSolver
from wholebody.methods.qp.solvers.quadprog_solver import inverse_factor
from wholebody.methods.qp.solvers.registry import make_solver, solver_names
from wholebody.methods.qp.solvers.split_form import empty_form, scaled_split, split

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
    solver = make_solver(name, hot_start=False)
    once, again = solver.solve(program, None), solver.solve(program, None)
    assert once.exact
    assert once.x == pytest.approx(by_least_squares(program), abs=TOLERANCE)
    assert once.x == pytest.approx(again.x, abs=1e-9), "from its own last answer"
    fresh = make_solver(name, hot_start=False).solve(program, None)
    assert np.array_equal(fresh.x, once.x)
    assert (fresh.by, fresh.iterations) == (once.by, once.iterations)


@settings(max_examples=20, deadline=None)
@given(program=programs())
def test_osqps_arrays_are_those_of_the_scaled_split_form(program):
    workspace = OSQPSolver().workspace(program)
    n, m, slots = workspace.n, workspace.m, workspace.slots
    form = scaled_split(program, empty_form(n, m, slots))
    assert workspace.hessian == pytest.approx(form.diagonal)
    assert workspace.gradient == pytest.approx(form.linear)
    assert workspace.matrix().toarray() == pytest.approx(np.vstack([np.eye(n, n + m + slots), form.matrix]))
    assert workspace.low == pytest.approx(np.concatenate([form.box_lower[:n], form.lower]))
    assert np.minimum(workspace.high, 1e30) == pytest.approx(
        np.minimum(np.concatenate([form.box_upper[:n], form.upper]), 1e30)
    )


@settings(max_examples=20, deadline=None)
@given(program=programs())
def test_the_scaled_form_is_the_same_program(program):
    """Its variables are those of the split form, scaled; the objective is the same, whatever the weights."""
    n, m, k = program.size, len(program.target), len(program.least)
    plain, form = split(program), scaled_split(program, empty_form(n, m, k))
    rng = np.random.default_rng(0)
    x = rng.uniform(program.lower, program.upper)
    z = np.concatenate([x, program.rows @ x - program.target, np.maximum(program.least - program.elastic @ x, 0.0)])
    roots = np.sqrt(np.concatenate([program.weight, program.elastic_weight]))
    scaled = np.concatenate([100.0 * x, roots * z[n:]])
    value = [0.5 * (one.diagonal * point) @ point + one.linear @ point for one, point in ((plain, z), (form, scaled))]
    assert value[0] == pytest.approx(value[1], rel=1e-9)
    rows = form.matrix @ scaled
    assert rows[:m] == pytest.approx(form.lower[:m], abs=1e-9 * (1.0 + np.abs(form.lower[:m]).max(initial=0.0)))
    assert (rows[m:] >= form.lower[m:] - 1e-9 * np.abs(form.lower[m:]) - 1e-12).all()


def test_a_form_that_was_used_is_as_good_as_a_new_one(random_program):
    """A program with fewer elastic rows leaves nothing behind of the one before."""
    rng = np.random.default_rng(1)
    more, fewer = random_program(rng, 7, 3, 6), random_program(rng, 7, 3, 2)
    used = scaled_split(fewer, scaled_split(more, empty_form(7, 3, 8)))
    for one, other in zip(used, scaled_split(fewer, empty_form(7, 3, 8)), strict=True):
        assert np.array_equal(one, other)


@settings(max_examples=20, deadline=None)
@given(program=programs())
def test_quadprog_gets_a_factor_of_the_inverse_hessian(program):
    factor = inverse_factor(program)
    assert np.array_equal(factor, np.triu(factor))
    hessian = np.diag(program.diagonal) + (program.rows.T * program.weight) @ program.rows
    assert factor.T @ hessian @ factor == pytest.approx(np.eye(program.size), abs=1e-8)


@pytest.mark.parametrize("name", ["quadprog", "piqp"])
def test_solvers_whose_hessian_has_the_weights_close_programs_with_heavy_rows(name, random_program):
    """Weights of 1e10 beside 1; what a solver answers itself is near, before its active set is corrected."""
    rng, closed, off = np.random.default_rng(2), 0, []
    for _ in range(100):
        program = with_values(random_program(rng), weight=np.array([1.0, 1e10, 1e4, 1e10]))
        solver = make_solver(name, hot_start=False)
        answer = solver.solve(program, None)
        closed += answer.by == name
        off.append(np.abs(solver.uncorrected() - answer.x).max())
    assert closed >= 90
    assert np.quantile(off, 0.9) < 1e-3


def test_daqp_may_refuse_a_program(monkeypatch):
    """It did where five joints were frozen and two holds contradicted each other (-6: too many equalities)."""

    class Refusing:
        def setup(self, *_):
            return -6, 0.0

    monkeypatch.setattr(daqp, "Model", Refusing)
    program = QuadraticProgram(
        np.ones(2), np.array([-1.0, 2.0]), np.eye(2)[:1], np.array([0.1]), np.array([3.0]), np.array([[1.0, 1.0]]),
        np.array([0.2]), np.array([1e4]), np.full(2, -0.5), np.full(2, 0.5),
    )  # fmt: skip
    answer = make_solver("daqp").solve_cold(program)
    assert answer.by != "daqp"
    assert answer.x == pytest.approx(make_solver("quadprog").solve_cold(program).x, abs=1e-9)
