"""Programs with far more rows than variables, and with rows that repeat each other: exact, and in bounded work."""

from __future__ import annotations

import numpy as np
import pytest

from tests.methods.qp.test_programs import by_quadprog
from tests.reference import active_set as reference
from tests.reference import semismooth_newton
from tests.reference.active_set import same
from wholebody.base.arrays import with_values
from wholebody.methods.qp.active_set import minimise, solve_from
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram
from wholebody.methods.qp.solvers.registry import make_solver


def crowded(rng, n=12, m=3, k=400, diagonal=2e-3):
    """A hand among overlapping things: hundreds of heavy elastic rows that contradict each other, and a weak D."""
    few = rng.normal(size=(k // 20, n)) * (rng.random((k // 20, n)) < 0.6)
    rows = few[rng.integers(len(few), size=k)] * rng.choice([-1.0, 1.0], size=(k, 1)) + 1e-4 * rng.normal(size=(k, n))
    return QuadraticProgram(
        diagonal=diagonal * rng.uniform(1.0, 1e3, n),
        linear=np.zeros(n),
        rows=rng.normal(size=(m, n)),
        target=0.1 * rng.normal(size=m),
        weight=np.full(m, 1e5),
        elastic=rows,
        least=rng.uniform(-0.05, 0.05, k),
        elastic_weight=np.full(k, 1e10),
        lower=np.full(n, -0.6),
        upper=np.full(n, 0.6),
    )


@pytest.mark.parametrize("k", [40, 400, 2000])
def test_crowded_programs_are_solved_to_rounding(k):
    rng = np.random.default_rng(k)
    for _ in range(5):
        program = crowded(rng, k=k)
        x, _, used = minimise(program, np.zeros(program.size), 300)
        assert used < 300
        assert program.optimality(x) < 1e-10
        assert (x >= program.lower).all()
        assert (x <= program.upper).all()


def test_quadprog_agrees():
    rng = np.random.default_rng(3)
    for _ in range(10):
        program = crowded(rng, n=6, k=60, diagonal=1.0)
        mild = with_values(program, elastic_weight=np.full(60, 1e4))
        x, active, _ = minimise(mild, rng.normal(size=6), 300)
        assert x == pytest.approx(by_quadprog(mild), abs=1e-6)
        assert np.array_equal(active.elastic, mild.elastic @ x < mild.least)


@pytest.mark.parametrize("k", [0, 20, 100, 400])
def test_the_compiled_loop_is_the_array_code(k):
    """100 random programs of each size, 400 in all, after one, two and five iterations in turn; three to the end."""
    rng = np.random.default_rng(k)
    for number in range(100):
        program = crowded(rng, k=k)
        start = rng.normal(size=program.size)
        for iterations in ((1, 2, 5)[number % 3], *((300,) if number < 3 else ())):
            x, active, used = minimise(program, start, iterations)
            expected, its_active, its_used = semismooth_newton.minimise(program, start, iterations)
            # Faces on the way are minimised to 1e-8; the last one is looked at again, to 1e-11.
            assert np.abs(x - expected).max() < (1e-10 if iterations == 300 else 1e-7)
            if iterations < 300:
                assert its_used <= used <= its_used + 1
                assert same(active, its_active)


def test_correcting_a_set_takes_the_smaller_system():
    rng = np.random.default_rng(8)
    for _ in range(5):
        program = crowded(rng, n=10, k=600, diagonal=1.0)
        _, active, _ = minimise(program, np.zeros(10), 300)
        answer = solve_from(program, active, 5)
        assert answer is not None
        assert program.optimality(answer.x) < 1e-10


def test_rows_that_repeat_each_other_have_multipliers_that_belong_to_their_residuals():
    rng = np.random.default_rng(2)
    base = rng.normal(size=(4, 12))
    program = with_values(
        crowded(rng, k=20),
        elastic=np.repeat(base, 2, axis=0) + 1e-9 * rng.normal(size=(8, 12)),
        least=rng.uniform(0.0, 0.05, 8),
        elastic_weight=np.full(8, 1e10),
    )
    none = np.zeros(12, dtype=bool)
    point = reference.minimise_on_face(program, ActiveSet(none, none, np.ones(8, dtype=bool)))
    lack = program.least - program.elastic @ point.x
    assert point.push == pytest.approx(1e10 * lack, rel=1e-3, abs=1e-3)
    assert np.abs(point.gradient).max() < 1e-3


@pytest.mark.parametrize("name", ["osqp", "daqp"])
def test_a_solver_hands_on_what_is_too_large_for_it(name):
    program = crowded(np.random.default_rng(11), n=24, k=2500)
    answer = make_solver(name).solve(program)
    assert answer.exact
    assert program.optimality(answer.x) < 1e-9
