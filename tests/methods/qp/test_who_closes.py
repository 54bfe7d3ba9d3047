"""What `solver` means: which solver is asked for which program, and what the answer tells of it."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.arrays import with_values
from wholebody.methods.qp.active_set import last_resort
from wholebody.methods.qp.solvers import base, registry
from wholebody.methods.qp.solvers.registry import make_solver, solver_names

NAMED = [name for name in solver_names() if name != "active_set"]


@pytest.fixture(scope="module")
def over_a_table(spatial_arm) -> wb.Problem:
    scene = wb.Scene(spatial_arm()).add(wb.Box((0.5, 0.8, 0.1)), name="table", at=(0.55, 0.0, 0.35))
    start = np.array([-0.9, 0.5, 0.9, 0.0, 0.5, 0.0])
    goals = [wb.Point("tip", (0.55, 0.35, 0.45))]
    return wb.Problem(
        scene, start, goals=goals, measures=[wb.Effort(), wb.tasks.Discomfort(1e-3)]
    )  # no projection alone


@pytest.fixture(scope="module")
def spatial_arm():
    from wholebody.bench.suite.stability.bodies import spatial_arm

    return spatial_arm


@pytest.fixture
def asked(monkeypatch):
    """Answers of all solvers that are asked, in order."""
    answers = []
    make = registry.make_solver

    def watched(name):
        solver = make(name)
        inner = solver.solve_cold

        def solve_cold(program):
            answers.append(inner(program))
            return answers[-1]

        solver.solve_cold = solve_cold
        return solver

    monkeypatch.setattr("wholebody.methods.qp.method.make_solver", watched)
    return answers


def test_as_it_comes_no_solver_is_asked(over_a_table, asked):
    solution = wb.methods.QP().solve(over_a_table)
    assert solution.method == "qp"
    assert solution.programs["active set"] > 0.9 * sum(solution.programs.values())
    assert set(solution.programs) <= {"active set", "semismooth newton"}
    assert not asked


@pytest.mark.parametrize("name", NAMED)
def test_every_program_is_the_named_solvers(over_a_table, asked, name):
    solution = wb.methods.QP(solver=name).solve(over_a_table)
    assert solution.solved
    assert solution.method == f"qp/{name}"
    assert set(solution.programs) <= {name, "semismooth newton"}
    assert len(asked) >= sum(solution.programs.values())
    assert all(answer.iterations > 0 for answer in asked), "the solver's own iterations"


@pytest.mark.parametrize("solver", ["osqp", "active_set"])
def test_counts_add_up_to_the_programs(over_a_table, solver):
    for measures in (True, False):
        solution = wb.methods.QP(solver=solver, measures=measures).solve(over_a_table)
        without = sum(entry.note == "seed" for entry in solution.trace)
        assert sum(solution.programs.values()) + without == solution.iterations


def test_other_methods_have_no_programs(over_a_table):
    assert wb.methods.Newton().solve(over_a_table).programs == {}


@pytest.mark.parametrize("method", [wb.methods.QP(), wb.methods.QP(solver="osqp")])
def test_a_tracker_tells_of_every_step(over_a_table, method):
    tracker, q = method.tracker(over_a_table, 0.01), over_a_table.start
    steps = []
    for _ in range(8):
        steps.append(tracker.step(q))
        q = steps[-1].q
    assert all(sum(step.programs.values()) >= 1 for step in steps)
    if method.name == "qp":
        assert all(list(step.programs) == ["active set"] for step in steps)
    else:
        assert all(list(step.programs) == ["osqp"] and step.iterations > 0 for step in steps)


@pytest.mark.parametrize("name", solver_names())
def test_every_way_comes_to_the_same_posture(over_a_table, name):
    expected = wb.methods.QP(tolerance=1e-7).solve(over_a_table).q
    assert wb.methods.QP(solver=name, tolerance=1e-7).solve(over_a_table).q == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize(
    ("settings", "name"), [({}, "qp"), ({"solver": "active_set"}, "qp"), ({"solver": "daqp"}, "qp/daqp")]
)
def test_the_name_says_what_runs(settings, name):
    assert wb.methods.QP(**settings).name == name


def test_with_active_sets_osqp_is_asked_for_what_nothing_else_closes(random_program, monkeypatch):
    """Semismooth Newton steps are several times as fast as the setting up of a solver."""
    program = random_program(np.random.default_rng(0))
    assert make_solver("active_set").solve(program).by == "semismooth newton"
    monkeypatch.setattr(base, "last_resort", lambda *given: with_values(last_resort(*given), exact=False))
    assert make_solver("active_set").solve(program).by == "osqp"
    assert make_solver("daqp").solve(program).by == "daqp"


def test_programs_are_counted_until_they_are_asked_for():
    solver = make_solver("osqp")
    for by in ("osqp", "active set", "osqp"):
        assert solver.count(by) == by
    assert solver.counted() == {"osqp": 2, "active set": 1}
    assert solver.counted() == {}
