"""Anderson acceleration on sequences whose limit is known."""

from __future__ import annotations

import numpy as np
import pytest

from wholebody.methods.newton.measures import STRETCH, Anderson


def run(matrix, start, count):
    """Errors of x <- x + step with steps of the linear iteration x <- matrix x, whose limit is 0."""
    memory, x, errors = Anderson(), np.array(start), []
    for _ in range(count):
        step = matrix @ x - x
        fast = memory.propose(step)
        way = step if fast is None else fast
        memory.record(way)
        x = x + way
        errors.append(float(np.abs(x).max()))
    return errors


def test_linear_sequence_ends_in_as_many_steps_as_it_has_modes():
    rng = np.random.default_rng(0)
    basis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix = basis @ np.diag([0.7, 0.5, 0.3]) @ basis.T
    errors = run(matrix, rng.normal(size=3), 12)
    assert errors[-1] < 1e-9
    assert 0.7**12 > 1e-2  # which is where the plain sequence would be


def test_slow_sequence_in_many_dimensions_gets_faster():
    rng = np.random.default_rng(1)
    basis = np.linalg.qr(rng.normal(size=(30, 30)))[0]
    matrix = basis @ np.diag(np.concatenate([[0.95, 0.9], np.full(28, 0.1)])) @ basis.T
    errors = run(matrix, rng.normal(size=30), 30)
    assert errors[-1] < 1e-3 * 0.95**30


def test_no_proposal_before_something_is_known_or_after_forgetting():
    memory = Anderson()
    for _ in range(2):
        for scale in (1.0, 0.5):
            assert memory.propose(np.array([scale, 0.0])) is None
            memory.record(np.array([scale, 0.0]))
        assert memory.propose(np.array([0.25, 0.0])) == pytest.approx([0.5, 0.0])  # 1/4 + 1/8 + ...
        memory.reset()


def test_a_proposal_is_bounded():
    memory = Anderson()
    for scale in (1.0, 0.999):
        memory.propose(np.array([scale, 0.0]))
        memory.record(np.array([scale, 0.0]))
    fast = memory.propose(np.array([0.998, 0.0]))
    assert np.abs(fast).max() == pytest.approx(STRETCH * 0.998)


def test_steps_that_repeat_say_nothing_and_break_nothing():
    memory = Anderson()
    for _ in range(5):
        fast = memory.propose(np.array([0.1, -0.2]))
        memory.record(np.array([0.1, -0.2]))
    assert np.isfinite(fast).all()


def test_a_way_that_was_not_proposed_for_is_not_remembered():
    memory = Anderson()
    memory.record(np.array([5.0, 0.0]))
    for scale in (1.0, 0.5):
        assert memory.propose(np.array([scale, 0.0])) is None
        memory.record(np.array([scale, 0.0]))
    assert memory.propose(np.array([0.25, 0.0])) == pytest.approx([0.5, 0.0])
