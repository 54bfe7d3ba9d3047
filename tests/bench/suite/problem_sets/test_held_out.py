"""Held-out sets: witnesses are answers, people and things are others than those of the sets."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.suite.problem_sets.bodies import human
from wholebody.bench.suite.problem_sets.registry import NAMED, SETS, problem_set

HELD_OUT = ("uniform_witnesses", "other_people", "other_clutter", "arms_among_things")


@pytest.mark.parametrize("name", HELD_OUT)
def test_a_witness_meets_everything(name: str) -> None:
    for number in range(2):
        case = problem_set(name).make(number, 1)
        judged = wb.assess(case.problem, case.witness)
        assert judged.holds(1e-8)
        assert max(judged.goal_error, judged.goal_angle) < 1e-8
        if number == 0:
            assert np.array_equal(case.witness, problem_set(name).make(number, 1).witness)
        # the start is no answer
        assert wb.assess(case.problem, case.problem.start).goal_error > 0.01


def test_they_take_part_only_where_they_are_named() -> None:
    assert set(HELD_OUT) <= set(NAMED)
    assert not set(NAMED) & set(SETS)


def test_people_differ_and_legs_move() -> None:
    people = [problem_set("other_people").make(number, 0).problem.scene.figure for number in (0, 5)]
    assert abs(people[0].posture("standing")[2] - people[1].posture("standing")[2]) > 0.05
    witnesses = [problem_set("uniform_witnesses").make(number, 0).witness for number in range(3)]
    knees = [human().joint_values(q)["left_knee_flexion"] for q in witnesses]
    assert max(knees) - min(knees) > 0.2
