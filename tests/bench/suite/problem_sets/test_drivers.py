"""Drivers: the witness of a cabin is seated in it, whatever touches, and another number is another person or cabin."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.suite.problem_sets.registry import problem_set
from wholebody.tasks.grasp import Grasp
from wholebody.tasks.touch import Touch


@pytest.mark.parametrize("number", [3, 3 + 14 * 3])
def test_the_witness_sits_in_the_cabin(number: int) -> None:
    case = problem_set("drivers").make(number, 0)
    judged = wb.assess(case.problem, case.witness)
    assert judged.met(1e-6)
    assert judged.holds(1e-6)
    assert judged.penetration <= 1e-6
    assert not wb.assess(case.problem, case.problem.start).met(0.01)
    again = problem_set("drivers").make(number, 0)
    np.testing.assert_array_equal(again.witness, case.witness)


def test_controls_change_with_the_number() -> None:
    first, last = (problem_set("drivers").make(number, 0).problem for number in (3, 3 + 14 * 3))
    assert sum(isinstance(goal, Grasp) for goal in first.goals) == 2
    assert sum(isinstance(goal, Touch) for goal in last.goals) == 3
