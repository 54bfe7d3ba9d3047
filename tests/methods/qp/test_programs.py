"""Quadratic programs: every solver against quadprog on the textbook form, and against enumeration."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tests.reference import active_set as reference
from tests.reference.active_set import guess_active_set, objective, same
from wholebody.base.arrays import with_values
from wholebody.base.compiled import compiled
from wholebody.base.errors import UnknownNameError
from wholebody.methods.qp.active_set import solve_from
from wholebody.methods.qp.face_kernel import Face, minimise_on_face
from wholebody.methods.qp.quadratic_program import ActiveSet
from wholebody.methods.qp.settings import CORRECTIONS
from wholebody.methods.qp.solvers.base import WorkingSet
from wholebody.methods.qp.solvers.registry import make_solver, solver_names


def by_quadprog(program):
    """The minimiser from quadprog, with residuals and slacks as variables, scaled by the roots of their weights."""
    quadprog = pytest.importorskip("quadprog")
    n, m, k = program.size, len(program.target), len(program.least)
    root, elastic = np.sqrt(program.weight), np.sqrt(program.elastic_weight)
    hessian = np.diag(np.concatenate([program.diagonal, np.ones(m + k)]))
    linear = -np.concatenate([program.linear, np.zeros(m + k)])
    soft = np.hstack([program.rows * root[:, None], -np.eye(m), np.zeros((m, k))])
    rows = np.hstack([program.elastic * elastic[:, None], np.zeros((k, m)), np.eye(k)])
    box = np.hstack([np.eye(n), np.zeros((n, m + k))])
    matrix = np.vstack([soft, rows, box, -box])
    bound = np.concatenate([program.target * root, program.least * elastic, program.lower, -program.upper])
    return quadprog.solve_qp(hessian, linear, matrix.T, bound, m)[0][:n]


def by_enumeration(program):
    """The least value over all faces of the box and all sets of pushing rows."""
    n, k = program.size, len(program.least)
    best, x = np.inf, None
    for state in itertools.product((0, 1, 2), repeat=n):
        lower, upper = np.array(state) == 1, np.array(state) == 2
        for pushing in itertools.product((False, True), repeat=k):
            point = reference.minimise_on_face(program, ActiveSet(lower, upper, np.array(pushing, dtype=bool)))
            candidate = np.clip(point.x, program.lower, program.upper)
            if objective(program, candidate) < best:
                best, x = objective(program, candidate), candidate
    return x


def test_enumeration_and_quadprog_agree(random_program):
    for seed in range(4):
        program = random_program(np.random.default_rng(seed), n=3, m=2, k=3)
        mild = with_values(program, weight=np.minimum(program.weight, 1e4), elastic_weight=np.full(3, 1e4))
        assert by_quadprog(mild) == pytest.approx(by_enumeration(mild), abs=1e-7)


@pytest.mark.parametrize("name", solver_names())
def test_every_solver_gives_the_same_answer(random_program, name):
    rng = np.random.default_rng(3)
    solver = make_solver(name)
    for case in range(25):
        size = (int(rng.integers(2, 40)), int(rng.integers(0, 9)), int(rng.integers(0, 30)))
        program = random_program(rng, *size)
        answer = solver.solve_cold(program)
        assert answer.exact, (case, size)
        assert ((answer.x >= program.lower) & (answer.x <= program.upper)).all()
        mild = with_values(
            program, weight=np.minimum(program.weight, 1e5), elastic_weight=np.minimum(program.elastic_weight, 1e5)
        )
        assert solver.solve_cold(mild).x == pytest.approx(by_quadprog(mild), abs=1e-7)
        assert program.optimality(answer.x) < 1e-7  # weights of 1e10 leave so much rounding


def test_the_active_set_of_an_answer_leads_to_it(random_program):
    rng = np.random.default_rng(9)
    solver = make_solver("active_set")
    for _ in range(20):
        program = random_program(rng)
        answer = solver.solve_cold(program)
        again = solve_from(program, answer.active, 1)
        assert again.x == pytest.approx(answer.x, abs=1e-11)


def test_programs_of_a_run_need_no_solver(random_program):
    rng = np.random.default_rng(12)
    closed, working_set = [], WorkingSet(make_solver("active_set"))
    for _ in range(40):
        program = random_program(rng)
        weight, elastic_weight = np.minimum(program.weight, 1e5), np.minimum(program.elastic_weight, 1e5)
        program = with_values(program, weight=weight, elastic_weight=elastic_weight)
        answer = working_set.solve(program, np.arange(len(program.least)))
        assert answer.x == pytest.approx(by_quadprog(program), abs=1e-7)
        closed.append(answer.by)
    assert set(closed) <= {"active set", "semismooth newton"}


def test_active_set_method_needs_only_a_guess_that_is_near(random_program):
    rng = np.random.default_rng(10)
    settled = 0
    for _ in range(40):
        program = random_program(rng)
        right = make_solver("daqp").solve_cold(program).active
        elastic = right.elastic.copy()
        elastic[rng.integers(len(elastic))] ^= True
        answer = solve_from(program, ActiveSet(right.lower, right.upper, elastic), 12)
        if answer is not None:  # sets may go round in circles; then nothing is claimed
            settled += 1
            assert program.optimality(answer.x) < 1e-5  # through weights of 1e10 rounding reads as this
    assert settled > 10


ROWS = (4, 9), (0, 9), (4, 0), (0, 0), (30, 60)


def guessed_set(rng, size, rows):
    """Bounds and elastic rows of which a fifth are active."""
    guess = ActiveSet(*(rng.random(count) < 0.2 for count in (size, size, rows)))
    return guess._replace(upper=guess.upper & ~guess.lower)


@compiled(error_model="numpy")
def on_face(program, active, face, count, tolerance, x):
    """The minimiser, which compiled loops alone call."""
    return minimise_on_face(program, active, face, count, tolerance, x)


@pytest.mark.parametrize("rows", ROWS)
def test_the_compiled_minimiser_on_a_face_is_that_of_array_code(random_program, rows):
    """200 random programs of each kind, 1,000 in all: the minimiser, the gradient there and the push of every row."""
    rng = np.random.default_rng(22)
    for _ in range(200):
        program = random_program(rng, int(rng.integers(2, 56)), *rows)
        program = with_values(
            program, weight=np.minimum(program.weight, 1e4), elastic_weight=np.minimum(program.elastic_weight, 1e4)
        )
        active, n = guessed_set(rng, program.size, rows[1]), program.size
        wanted = reference.minimise_on_face(program, active)
        stacked = np.vstack([program.rows, program.elastic[active.elastic]])
        right = np.concatenate([program.target, program.least[active.elastic]])
        weight = np.concatenate([program.weight, program.elastic_weight[active.elastic]])
        count = len(right)
        push, gradient, x = np.empty(count), np.empty(n), np.empty(n)
        face = Face(
            stacked, right, 1.0 / weight, push, gradient, np.empty(0), np.empty((max(n, 1), n)), np.empty(n * n),
            np.empty(n), np.empty(n),
        )  # fmt: skip
        finite = on_face(program, active, face, count, CORRECTIONS.tolerance, x)
        assert finite
        assert np.abs(x - wanted.x).max() < 1e-9
        scale = 1.0 + np.abs(push).max(initial=0.0)
        assert np.abs(gradient - wanted.gradient).max() < 1e-8 * scale
        assert np.abs(-push[rows[0] :] - wanted.push).max(initial=0.0) < 1e-8 * scale


@pytest.mark.parametrize("rows", ROWS)
def test_compiled_loops_correct_an_active_set_as_array_code_does(random_program, rows):
    rng = np.random.default_rng(21)
    settled = []
    for _ in range(25):
        program = random_program(rng, int(rng.integers(2, 56)), *rows)
        program = with_values(
            program, weight=np.minimum(program.weight, 1e4), elastic_weight=np.minimum(program.elastic_weight, 1e4)
        )
        guess = guessed_set(rng, program.size, rows[1])
        kept = ActiveSet(*(part.copy() for part in guess))
        mine, wanted = (way(program, guess, 60) for way in (solve_from, reference.solve_from))
        assert same(kept, guess)
        assert (mine is None) == (wanted is None)
        if mine is not None:
            assert np.abs(mine.x - wanted.x).max() < 1e-9
            assert same(mine.active, wanted.active)
            assert program.optimality(mine.x) < 1e-7
        settled.append(mine is not None)
    assert any(settled)


def test_active_set_is_read_off_a_near_answer(random_program):
    rng = np.random.default_rng(12)
    for _ in range(10):
        program = with_values(random_program(rng), weight=np.full(4, 10.0), elastic_weight=np.full(9, 10.0))
        answer = make_solver("osqp").solve_cold(program)
        read = guess_active_set(program, by_quadprog(program), 1e-7)
        assert same(read, answer.active)


def test_gradient_is_the_derivative_of_the_value(random_program):
    rng = np.random.default_rng(1)
    program = random_program(rng)
    program = with_values(program, weight=np.minimum(program.weight, 10.0), elastic_weight=np.full(9, 10.0))
    x = 0.2 * rng.normal(size=program.size)
    for k, direction in enumerate(np.eye(program.size)):
        slope = (objective(program, x + 1e-6 * direction) - objective(program, x - 1e-6 * direction)) / 2e-6
        assert program.gradient(x)[k] == pytest.approx(slope, abs=1e-6)


@pytest.mark.parametrize("name", solver_names())
def test_programs_at_the_edge_of_sense(random_program, name):
    solver = make_solver(name)
    program = random_program(np.random.default_rng(5))
    fixed = with_values(program, lower=np.zeros(12), upper=np.zeros(12))
    assert np.array_equal(solver.solve_cold(fixed).x, np.zeros(12))
    twice = with_values(  # rows that repeat each other, and rows that are zero
        program,
        rows=np.vstack([program.rows, program.rows, np.zeros((2, 12))]),
        target=np.concatenate([program.target, program.target, [1.0, -1.0]]),
        weight=np.concatenate([program.weight, program.weight, [1e8, 1e8]]),
    )
    single = with_values(program, weight=2.0 * program.weight)
    assert solver.solve_cold(twice).x == pytest.approx(solver.solve_cold(single).x, abs=1e-7)
    against = with_values(  # rows that contradict each other share what is left
        program,
        elastic=np.vstack([np.eye(12)[:1], -np.eye(12)[:1]]),
        least=np.array([1.0, 1.0]),
        elastic_weight=np.full(2, 1e10),
        lower=np.full(12, -0.3),
        upper=np.full(12, 0.3),
    )
    assert solver.solve_cold(against).x[0] == pytest.approx(0.0, abs=1e-2)


def test_unknown_solver_is_answered_with_the_names():
    with pytest.raises(UnknownNameError, match="osqp"):
        make_solver("oskp")


PARTS = ("diagonal", "linear", "rows", "target", "weight", "elastic", "least", "elastic_weight", "lower", "upper")
BAD = (np.nan, np.inf, -np.inf, 1e300, -1e300, 0.0, -1.0)


@pytest.mark.parametrize("name", solver_names())
def test_a_program_of_no_use_prints_nothing_and_is_answered_inside_its_box(random_program, name, capfd):
    """Terms of somebody's own may be anything; the programs after such a one are solved as ever."""
    rng = np.random.default_rng(11)
    good, whole = random_program(rng, 12, 4, 9), random_program(rng, 12, 4, 9)
    solver = make_solver(name)
    solver.solve(good)
    for part, value in itertools.product(PARTS, BAD):
        array = getattr(good, part).copy()
        array.flat[1] = value
        program = with_values(good, **{part: array})
        answer = solver.solve(program)
        assert np.isfinite(answer.x).all(), (part, value)
        box = np.minimum(program.lower, program.upper) - 1e-9, np.maximum(program.lower, program.upper) + 1e-9
        bounded = np.isfinite(box[0]) & np.isfinite(box[1])
        assert ((answer.x >= box[0]) & (answer.x <= box[1]))[bounded].all(), (part, value)
    answer = solver.solve(whole)
    assert answer.exact
    assert whole.optimality(answer.x) < 1e-7
    assert capfd.readouterr().out == ""
