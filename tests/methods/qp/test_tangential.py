"""The two parts of a step against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from tests.reference import active_set as reference
from tests.reference.active_set import same
from wholebody.base.arrays import with_values
from wholebody.methods.qp.active_set import Parts, parts_of, room_for
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.settings import DESCENT
from wholebody.methods.qp.solvers.registry import make_solver

NO_SHIFT = np.zeros(0)


def free_program(n: int) -> QuadraticProgram:
    """A program of n variables without rows, in a box that holds nothing."""
    none, rows, wide = np.zeros(0), np.zeros((0, n)), np.full(n, 1e6)
    return QuadraticProgram(np.ones(n), np.zeros(n), rows, none, none, rows, none, none, -wide, wide)


def parts(program: QuadraticProgram, shift: np.ndarray = NO_SHIFT) -> tuple[Parts, QPSolution]:
    """The parts of the program's answer, and the answer."""
    solver = make_solver("active_set")
    answer = solver.solve_cold(program)
    return parts_of(program, answer, shift, room_for(program)), answer


def test_the_normal_part_is_the_answer_without_gradient_on_the_same_face(random_program):
    """Without the bounds that have room, unless the answer without them comes to one of them."""
    rng, ways = np.random.default_rng(0), set()
    for _ in range(60):
        program = random_program(rng, int(rng.integers(4, 40)), int(rng.integers(1, 9)), int(rng.integers(0, 20)))
        split, answer = parts(program)
        plain, held = with_values(program, linear=np.zeros(program.size)), answer.active
        near = held._replace(
            lower=held.lower & (program.lower >= -DESCENT.room), upper=held.upper & (program.upper <= DESCENT.room)
        )
        left = (held.lower | held.upper) & ~(near.lower | near.upper)
        expected = np.clip(reference.minimise_on_face(plain, near).x, program.lower, program.upper)
        free = ((program.lower < expected) & (expected < program.upper))[left].all()
        ways.add((bool(left.any()), bool(free)))
        if not free:
            expected = np.clip(reference.minimise_on_face(plain, held).x, program.lower, program.upper)
        assert split.normal == pytest.approx(expected, abs=1e-9)
        assert split.normal + split.tangential == pytest.approx(answer.x, abs=1e-12)
    assert {(True, True), (True, False)} <= ways


def test_the_tangential_part_saves_half_of_its_curvature(random_program):
    """What the measures g'x + x'Dx/2 are lower at x than at n, against t'Dt/2, with rows as hard as rounding allows."""
    rng = np.random.default_rng(1)
    for _ in range(40):
        program = random_program(rng, int(rng.integers(6, 30)), int(rng.integers(1, 5)), 0)
        program = with_values(program, weight=np.full(len(program.target), 1e9), lower=program.lower - 1e3,
                          upper=program.upper + 1e3)  # fmt: skip
        (n, t), answer = parts(program)

        def measures(at, program=program):
            return program.linear @ at + 0.5 * (program.diagonal * at) @ at

        assert measures(n) - measures(answer.x) == pytest.approx(0.5 * (program.diagonal * t) @ t, rel=1e-4, abs=1e-6)
        assert program.rows @ t == pytest.approx(0.0, abs=1e-5)


def test_the_shift_of_the_multipliers_makes_up_for_a_gradient_that_the_normal_part_has_not():
    """One soft row of finite weight: the normal part meets the error itself, not the error and the shift."""
    program = with_values(
        free_program(2), linear=np.array([0.0, 3.0]), rows=np.array([[1.0, 1.0]]), target=np.array([0.1 - 0.02]),
        weight=np.array([1e6]),
    )  # fmt: skip
    split, _ = parts(program, np.array([0.02]))
    assert split.normal == pytest.approx([0.05, 0.05], abs=1e-6)


@pytest.mark.parametrize(("off", "along"), [(5e-4, 0.0), (2.0, -2.0)])
def test_a_near_bound_stays_held_and_the_way_to_a_far_one_is_tangential(off, along):
    lower = np.array([-off, -2.0, -2.0])
    program = with_values(free_program(3), linear=np.array([9.0, -1.0, 0.5]), lower=lower, upper=np.full(3, 2.0))
    split, answer = parts(program)
    assert same(answer.active, ActiveSet(*np.array([[True, False, False], [False] * 3]), np.zeros(0, dtype=bool)))
    assert split.tangential == pytest.approx([along, 1.0, -0.5])
