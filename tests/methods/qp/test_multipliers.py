"""Multipliers of a program's rows and the Lagrangian that steps near the goals are judged by."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.arrays import with_values
from wholebody.bench.suite.problem_sets.bodies import TIPS
from wholebody.bench.suite.problem_sets.reaching import reach_among
from wholebody.bench.suite.stability.catalogue import cases
from wholebody.methods.qp.active_set import parts_of, room_for
from wholebody.methods.qp.quadratic_program import Multipliers, QuadraticProgram, Rows
from wholebody.methods.qp.solvers.registry import make_solver
from wholebody.methods.qp.subproblem import lagrangian, multipliers_of


def rows_of(program, rng):
    """Rows with the sizes and elastic rows of a program, keys in no order."""
    key = rng.permutation(1000)[: len(program.least)]
    return Rows(program.rows, -program.target, program.weight, len(program.target), program.elastic, program.least,
                np.arange(len(key)), len(key), key, program.elastic_weight)  # fmt: skip


def test_with_the_multipliers_the_gradient_vanishes_where_no_bound_holds(random_program):
    """Karush, Kuhn, Tucker: D x + g + T'y - C'z = 0 in units of the scaled measures, z >= 0, and z (C x - l) = 0."""
    rng, scale = np.random.default_rng(0), 0.3
    for _ in range(60):
        program = random_program(rng, int(rng.integers(4, 40)), int(rng.integers(1, 9)), int(rng.integers(0, 20)))
        soft = np.minimum(program.weight, 1e3)  # rounding of x times a weight is what a multiplier is off by
        program = with_values(program, weight=soft, elastic_weight=np.minimum(program.elastic_weight, 1e3))
        answer = make_solver("active_set").solve_cold(program)
        y, z, _ = multipliers_of(program, answer, rows_of(program, rng), scale)
        gradient = program.diagonal * answer.x + program.linear + scale * (y @ program.rows - z @ program.elastic)
        free = ~(answer.active.lower | answer.active.upper)
        assert gradient[free] == pytest.approx(0.0, abs=1e-6)
        assert (z >= 0.0).all()
        assert z[program.elastic @ answer.x > program.least + 1e-9] == pytest.approx(0.0)


def test_along_the_rows_the_lagrangian_falls_by_half_of_the_curvature(random_program):
    """Straight rows and measures g'x + x'Dx/2, from a place that misses the rows: L(0) - L(t) = t'Dt/2."""
    rng = np.random.default_rng(1)
    for _ in range(40):
        program = random_program(rng, int(rng.integers(6, 30)), int(rng.integers(1, 5)), 0)
        program = with_values(program, weight=np.full(len(program.target), 1e9), lower=program.lower - 1e3,
                          upper=program.upper + 1e3)  # fmt: skip
        solver = make_solver("active_set")
        answer = solver.solve_cold(program)
        t = parts_of(program, answer, np.zeros(0), room_for(program)).tangential
        rows = rows_of(program, rng)
        multipliers = multipliers_of(program, answer, rows, 1.0)
        before = lagrangian(multipliers, 0.0, rows)
        measure = float(program.linear @ t + 0.5 * (program.diagonal * t) @ t)
        after = lagrangian(multipliers, measure, rows._replace(soft_error=program.rows @ t - program.target))
        assert before - after == pytest.approx(0.5 * (program.diagonal * t) @ t, rel=1e-4, abs=1e-5)


def test_what_a_step_to_a_bound_is_to_bring_counts_the_way_there():
    """Measures (x - 1)^2 / 2 + (y - 1)^2 / 2 with y = 0 asked, and x at most 0.2: L falls by 0.18 along x."""
    program = QuadraticProgram(
        np.ones(2), -np.ones(2), np.array([[0.0, 1.0]]), np.zeros(1), np.array([1e6]), np.zeros((0, 2)), np.zeros(0),
        np.zeros(0), -np.ones(2), np.array([0.2, 1.0]),
    )  # fmt: skip
    solver = make_solver("active_set")
    answer = solver.solve_cold(program)
    t = parts_of(program, answer, np.zeros(0), room_for(program)).tangential
    assert t == pytest.approx([0.2, 0.0], abs=1e-5)
    multipliers = multipliers_of(program, answer, rows_of(program, np.random.default_rng(0)), 1.0)
    model = float(-program.linear @ t - 0.5 * t @ t)
    assert model - multipliers.change(program, t) == pytest.approx(0.2 - 0.5 * 0.2**2, abs=1e-5)


def test_a_descent_does_not_stop_at_the_first_limit():
    """From a straight arm the last joint comes to its limit. Its way there counts, so no step there is rejected."""
    solution = wb.methods.QP().solve(cases(["collinear-start"])[0].question().problem)
    assert solution.solved
    assert not any("rejected" in entry.note for entry in solution.trace)


def test_elastic_rows_count_by_their_names():
    multipliers = Multipliers(np.array([2.0]), np.array([0.0, 3.0, 5.0]), np.array([7, 9, 4]))
    rows = Rows(np.zeros((1, 1)), np.array([0.1]), np.ones(1), 1, np.zeros((3, 1)), np.array([100.0, 0.01, -0.02]),
                np.arange(3), 3, np.array([7, 4, 9]), np.ones(3))  # fmt: skip
    assert lagrangian(multipliers, 1.0, rows) == pytest.approx(1.0 + 2.0 * 0.1 + 5.0 * 0.01 + 3.0 * -0.02)
    fewer = rows._replace(elastic_violation=np.array([100.0, 0.01]), key=np.array([7, 4]))
    assert lagrangian(multipliers, 1.0, fewer) == pytest.approx(1.0 + 2.0 * 0.1 + 5.0 * 0.01)


def test_steps_do_not_swing_across_a_curved_constraint():
    """Judged by the measures alone, steps of this reach grew from one to the next until one was rejected, 88 in all."""
    problem, _ = reach_among("clutter", wb.load("human"), TIPS[0], np.random.default_rng(26))
    solution = wb.methods.QP(restarts=0).solve(problem)
    assert solution.solved
    assert solution.iterations < 60
