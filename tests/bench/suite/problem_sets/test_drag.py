"""Drags are possible in every frame and smooth."""

from __future__ import annotations

import numpy as np

import wholebody as wb
from wholebody.bench.suite.problem_sets import reaching
from wholebody.bench.suite.problem_sets.bodies import human
from wholebody.bench.suite.problem_sets.case import generator
from wholebody.bench.suite.problem_sets.registry import problem_set


def test_a_known_posture_meets_each_frame() -> None:
    case = problem_set("drag").make(0, 0)
    problem, postures = case.problem, reaching.way(human(), generator("drag", 0, 0))
    assert 100 <= len(case.frames) == len(postures) - 1 <= 200
    for q, goals in zip(postures[1::6], case.frames[::6], strict=True):
        problem.retarget(goals)
        judged = wb.assess(problem, q)
        assert judged.met(1e-6)
        assert judged.holds(1e-6)


def test_the_goals_move_far_smoothly_and_at_a_speed_of_people() -> None:
    case = problem_set("drag").make(1, 0)
    goals = [goals[0] for goals in (case.problem.goals, *case.frames)]
    places = np.array([goal.target for goal in goals if isinstance(goal, wb.Point)])
    assert np.linalg.norm(places - places[0], axis=1).max() > 0.2
    speed = np.diff(places, axis=0) / case.dt
    assert np.linalg.norm(speed, axis=1).max() < 4.0  # m/s
    jump = np.linalg.norm(np.diff(speed, axis=0), axis=1) / case.dt
    assert jump.max() < 40.0  # m/s^2: no frame kinks
    assert np.linalg.norm(speed[0]) < 0.01
    assert np.linalg.norm(speed[-1]) < 0.01
