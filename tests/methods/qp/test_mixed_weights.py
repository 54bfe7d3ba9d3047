"""Goals of weights from 1 to 1e6 beside each other: none that can be met gives way to measures or waits for others."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb

DT = 1.0 / 60.0
MET = 1e-4  # m, rad
MIXED = ((1000.0, 1.0), (1.0, 1000.0), (1.0, 1e6))


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


def problem(scene: wb.Scene, seed: int, point: float, orientation: float, away: float = 0.0) -> wb.Problem:
    """The palm is asked to be as in a posture that differs by up to 1.5 rad in each joint of the upper body."""
    figure, rng = scene.figure, np.random.default_rng(seed)
    start = figure.clamp(figure.neutral)
    legs = [any(part in name for part in ("hip", "knee", "ankle", "toe")) for name in figure.model.names]
    still = np.array([figure.model.joints[k].idx_q for k, leg in enumerate(legs) if leg])
    limits = figure.limits
    for _ in range(100):
        turns = rng.uniform(-1.5, 1.5, len(limits.idx_q)) * ~np.isin(limits.idx_q, still)
        there = start.copy()
        there[limits.idx_q] = np.clip(start[limits.idx_q] + turns, limits.lower, limits.upper)
        if not len(scene.contacts(there, within=-1e-3).distance):
            break
    palm = scene.state(there).frame(scene.frame_id("right_palm"))
    goals = [
        wb.Point("right_palm", palm.translation + (away, 0.0, 0.0), weight=point),
        wb.Orientation("right_palm", palm.rotation, weight=orientation),
    ]
    return wb.Problem(scene, start, goals=goals, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")])


def errors(problem: wb.Problem, q: np.ndarray) -> np.ndarray:
    state = problem.scene.state(q)
    return np.array([np.linalg.norm(goal.error(state)) for goal in problem.goals])


def frames_until_met(problem: wb.Problem, most: int) -> int:
    tracker, q = wb.methods.QP().tracker(problem, DT), problem.start
    for frame in range(1, most + 1):
        q = tracker.frame(q).q
        if errors(problem, q).max() < MET:
            return frame
    return most + 1


def test_mixed_weights_take_at_most_three_times_the_frames_of_equal_ones(scene: wb.Scene) -> None:
    seed = 107
    equal = frames_until_met(problem(scene, seed, 1.0, 1.0), 40)
    assert equal <= 40
    for weights in MIXED:
        assert frames_until_met(problem(scene, seed, *weights), 3 * equal) <= 3 * equal


def test_where_goals_conflict_their_weights_decide(scene: wb.Scene) -> None:
    """Half a metre out of reach, the palm comes as near as its weight has it: the weighted sum is least."""
    left = {}
    for weights in ((1.0, 1.0), (1000.0, 1.0), (1.0, 1000.0)):
        asked = problem(scene, 5, *weights, away=1.2)
        tracker, q = wb.methods.QP().tracker(asked, DT), asked.start
        for _ in range(120):
            q = tracker.frame(q).q
        left[weights] = errors(asked, q)
    for weights, own in left.items():
        cost = {other: float(np.array(weights) @ found**2) for other, found in left.items()}
        assert cost[weights] <= 1.001 * min(cost.values()), (weights, own, cost)


def test_a_descent_that_has_spent_its_programs_goes_on() -> None:
    """Soft goals that contradict each other are nearly as well met by descents of few programs as by long ones."""
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    places = {"right_palm": (0.9, -0.6, 1.9), "left_palm": (0.5, 0.5, 0.2)}
    soft = [wb.Soft(wb.Point(palm, place, weight=30.0)) for palm, place in places.items()]
    soft.append(wb.Soft(wb.Relative("left_palm", "right_palm", (0.0, 0.0, 0.3), weight=30.0)))
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    problem = wb.Problem(scene, "standing", constraints=feet, measures=[wb.Effort(), *soft])
    few, many = (wb.solve(problem, wb.methods.QP(iterations=most)).assessment for most in (10, 150))
    assert few.measure < 1.01 * many.measure
    assert few.holds(1e-5)
