"""Measures an answer on a question made anew, by the independent assessment and the sweep; decides nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.assessment.motion import depth_between, velocities
from wholebody.assessment.posture import Assessment, assess
from wholebody.bench.suite.stability.case import Answer, HardCase, Nonsense, Posed, Stream
from wholebody.problem import Problem
from wholebody.tasks import Point

INSIDE = 1e-4  # m: deeper than this is inside
DIP = 1e-3  # m: by which the straight way between two postures may go in deeper than its ends


@dataclass(frozen=True)
class Judged:
    """What an answer measures, the worst of all frames where there are several.

    Attributes:
        finite: whether it is made of numbers.
        goal_error: largest goal error at the end [m, rad].
        penetration: deepest overlap [m].
        start_penetration: deepest overlap at the start [m]; 0 for a stream.
        limit_violation: farthest out of a joint's limits [rad, m].
        constraint_violation: farthest from what must hold [m, rad].
        speed_excess: by how much the fastest joint is too fast, as a share of what is allowed.
        passed: what it went into between frames, in words; "" for nothing.
        dip: how deep, at the deepest [m].
        misreported: largest difference between what it says is left and what is [m, rad].
    """

    finite: bool = True
    goal_error: float = 0.0
    penetration: float = 0.0
    start_penetration: float = 0.0
    limit_violation: float = 0.0
    constraint_violation: float = 0.0
    speed_excess: float = 0.0
    passed: str = ""
    dip: float = 0.0
    misreported: float = 0.0


def judge(case: HardCase, answer: Answer) -> Judged:
    """Measure an answer; nothing where there is no posture."""
    question = case.question()
    if isinstance(question, Nonsense) or not len(answer.postures):
        return Judged()
    if not np.isfinite(answer.postures).all():
        return Judged(finite=False, goal_error=float("nan"))
    if isinstance(question, Posed):
        return _posed(question.problem, answer)
    return _stream(question, answer)


def _posed(problem: Problem, answer: Answer) -> Judged:
    found = assess(problem, answer.postures[0])
    left = _left(found)
    return Judged(
        goal_error=left,
        penetration=found.penetration,
        start_penetration=assess(problem, problem.scene.figure.clamp(problem.start)).penetration,
        limit_violation=found.limit_violation,
        constraint_violation=found.constraint_violation,
        misreported=abs(left - answer.left[0]),
    )


def _stream(question: Stream, answer: Answer) -> Judged:
    problem, scene = question.problem, question.problem.scene
    first = problem.goals[0]
    assert isinstance(first, Point)
    found: list[Assessment] = []
    passed, deepest_way, excess, misreported = "", 0.0, 0.0, 0.0
    before = scene.figure.clamp(problem.start)
    for number, (frame, q) in enumerate(zip(question.frames, answer.postures, strict=True)):
        for name, place in frame.moved.items():
            scene.move(name, at=place)
        depth, owners = depth_between(scene, before, q, DIP)
        if depth > deepest_way:
            passed, deepest_way = f"{owners}, frame {number}", depth
        problem.retarget([Point(first.frame, frame.target)])
        found.append(assess(problem, q))
        misreported = max(misreported, abs(_left(found[-1]) - answer.left[number]))
        speed = np.abs(velocities(scene.model, np.array([before, q]), question.dt)).max()
        excess = max(excess, float(speed / question.speed - 1.0))
        before = q
    return Judged(
        goal_error=_left(found[-1]),
        penetration=max(each.penetration for each in found),
        limit_violation=max(each.limit_violation for each in found),
        constraint_violation=max(each.constraint_violation for each in found),
        speed_excess=excess,
        passed=passed,
        dip=deepest_way,
        misreported=misreported,
    )


def _left(found: Assessment) -> float:
    return max(found.goal_error, found.goal_angle)
