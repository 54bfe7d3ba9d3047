"""Goals that move: a method follows them frame by frame from where it is, and every frame is judged."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from wholebody.arrays import Array
from wholebody.assessment import Assessment, assess
from wholebody.bench.compare.record import ANSWERED, Record
from wholebody.bench.problem_sets.case import Case
from wholebody.methods.base import SolvedStep, Tracker
from wholebody.motion_assessment import third_differences
from wholebody.problem import Problem

USUAL = 0.95  # share of the frames whose tracking error counts: in the first ones the goal is far away
STILL = 1e-6  # m: a gap that changes less in a frame does not turn


class _Frame(NamedTuple):
    q: Array
    seconds: float
    cpu_seconds: float
    iterations: int
    judgement: Assessment


def follow(method: Any, problem: Problem, case: Case, empty: Record) -> Record:
    """Follow the goals of a case; `problem` is a copy of its problem, that may be changed.

    Each frame is one of the method's tracker, to the method's tolerance: qp and newton make a few steps, as `wb.Drag`
    does; every other method solves each frame from the posture of the frame before.
    """
    q = problem.scene.figure.clamp(problem.start)
    frames: list[_Frame] = []
    tracker: Tracker = method.tracker(problem, case.dt)
    for goals in case.frames:
        problem.retarget(goals)
        worked, began = time.process_time(), time.perf_counter()
        step = tracker.frame(q, method.tolerance)
        q, iterations = step.q, step.iterations
        judging = step.judging if isinstance(step, SolvedStep) else 0.0
        seconds = time.perf_counter() - began - judging
        worked = time.process_time() - worked
        if not np.isfinite(q).all():
            return replace(empty, said=f"frame {len(frames)}: the posture is not finite")
        again = time.process_time()
        judgement = assess(problem, q)
        if judging:
            worked -= time.process_time() - again  # the same judgement as the one within the call
        frames.append(_Frame(q, max(seconds, 0.0), max(worked, 0.0), iterations, judgement))
    return _summary(frames, case, empty)


def _summary(frames: list[_Frame], case: Case, empty: Record) -> Record:
    judgements = [frame.judgement for frame in frames]
    errors = np.array([(judged.goal_error, judged.goal_angle) for judged in judgements])
    held = np.array(
        [(j.penetration, j.clearance_violation, j.limit_violation, j.constraint_violation) for j in judgements]
    )  # fmt: skip
    seconds = np.array([frame.seconds for frame in frames])
    goal_error, goal_angle = np.quantile(errors, USUAL, axis=0)
    penetration, lack, limits, constraints = held.max(axis=0)
    gaps = np.array([judged.least_distance for judged in judgements])
    return replace(
        empty,
        outcome=ANSWERED,
        said=f"{len(frames)} frames",
        seconds=float(np.median(seconds)),
        cpu_seconds=float(np.median([frame.cpu_seconds for frame in frames])),
        iterations=float(np.mean([frame.iterations for frame in frames])),
        goal_error=float(goal_error),
        goal_angle=float(goal_angle),
        penetration=float(penetration),
        clearance_violation=float(lack),
        limit_violation=float(limits),
        constraint_violation=float(constraints),
        measure=judgements[-1].measure,
        optimality=judgements[-1].optimality,
        frames=len(frames),
        frame_p95=float(np.quantile(seconds, USUAL)),
        jerk=jerk(case.problem.scene.model, [case.problem.start, *(frame.q for frame in frames)], case.dt),
        turns=turns(gaps) / (max(len(frames) - 1, 1) * case.dt),
    )


def jerk(model: Any, postures: list[Array], dt: float) -> float:
    """Root mean square over frames and degrees of freedom of the third difference of postures [rad/s^3, m/s^3]."""
    found = third_differences(model, np.array(postures), dt)
    return float(np.sqrt(np.mean(found**2))) if len(found) else 0.0


def turns(gaps: Array) -> int:
    """How often the velocity of a gap (frames,) changes its sign: what a trembling contact does."""
    change = np.diff(gaps[np.isfinite(gaps)])
    signs = np.sign(change[np.abs(change) > STILL])
    return int(np.count_nonzero(signs[1:] != signs[:-1]))
