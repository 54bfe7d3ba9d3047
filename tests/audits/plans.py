"""Planned motions of problem sets: how many are found, how soon and how long, beside RRT-Connect of OMPL."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

import wholebody as wb
from wholebody.base.runner import processor_time
from wholebody.bench.rows import Row
from wholebody.bench.suite.problem_sets.registry import problem_set
from wholebody.planning.local_planner import Geodesics
from wholebody.planning.smoothing import length

RESOLUTION = 0.02  # rad: between the postures of an edge that OMPL tests; ours proves edges free


class Attempt(NamedTuple):
    """One plan of a problem: whether it was found, processor's seconds, and length over the shortest of the problem."""

    solved: bool
    seconds: float
    length: float


def gap() -> tuple[wb.Scene, Any, Any]:
    """A person before two walls with a gap of 0.42 m between them, and the same person behind it."""
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor", at=(0.0, 0.0, -0.01))
    for name, side in (("left wall", 1.0), ("right wall", -1.0)):
        scene.add(wb.Box((0.1, 1.5, 2.2)), name=name, at=(0.9, 0.96 * side, 1.1))
    start = scene.figure.posture("standing")
    end = start.copy()
    end[0] += 1.8
    return scene, start, end


def gap_row(seeds: int) -> Row:
    """The row of the person at the gap."""
    scene, start, end = gap()
    plans = [wb.plan(scene, start, end, seed=seed) for seed in range(seeds)]
    least = min((plan.length for plan in plans if plan.solved), default=np.nan)
    return _row("person at a gap", "wholebody", [Attempt(one.solved, one.seconds, one.length / least) for one in plans])


def rows(sets: Sequence[str], cases: int, seeds: int) -> list[Row]:
    """A row for each set and planner."""
    found = []
    for name in sets:
        tried: dict[str, list[Attempt]] = {}
        for number in range(cases):
            for planner, attempts in _attempts(name, number, seeds).items():
                least = min((one.length for one in attempts if one.solved), default=np.nan)
                tried.setdefault(planner, []).extend(one._replace(length=one.length / least) for one in attempts)
        found += [_row(name, planner, attempts) for planner, attempts in tried.items()]
    return found


def _attempts(name: str, number: int, seeds: int) -> dict[str, list[Attempt]]:
    problem = problem_set(name).make(number, 0).problem
    scene, given = problem.scene, problem.stated
    ours = []
    for seed in range(seeds):
        plan = wb.plan(scene, problem.start, list(problem.goals), constraints=given, seed=seed)
        ours.append(Attempt(plan.solved, plan.seconds, plan.length))
    free = wb.Problem(scene, problem.start, goals=problem.goals, constraints=given)
    if free.constraints or not find_spec("ompl"):
        return {"wholebody": ours}
    return {"wholebody": ours, "ompl": _by_ompl(free, wb.solve(free).q, seeds)}


def _by_ompl(problem: wb.Problem, end: Any, seeds: int) -> list[Attempt]:
    """RRT-Connect and path simplification of OMPL for a posture, whose states our compiled query tests."""
    from ompl import base, geometric

    limits, size = problem.scene.figure.limits, len(end)
    space, bounds = base.RealVectorStateSpace(size), base.RealVectorBounds(size)
    for joint, (low, high) in enumerate(zip(limits.lower, limits.upper, strict=True)):
        bounds.setLow(joint, float(low))
        bounds.setHigh(joint, float(high))
    space.setBounds(bounds)
    found = []
    with problem.borrow() as workspace:
        local = Geodesics(problem, workspace)
        local.admit(problem.start)
        local.admit(end)
        for _ in range(seeds):
            setup = geometric.SimpleSetup(space)
            setup.setStateValidityChecker(lambda at: local.free(np.array([at[joint] for joint in range(size)])))
            information = setup.getSpaceInformation()
            information.setStateValidityCheckingResolution(RESOLUTION / space.getMaximumExtent())
            first, last = space.allocState(), space.allocState()
            for joint in range(size):
                first[joint], last[joint] = float(problem.start[joint]), float(end[joint])
            setup.setStartAndGoalStates(first, last)
            setup.setPlanner(geometric.RRTConnect(information))
            began = processor_time()
            setup.solve(10.0)
            solved = bool(setup.haveExactSolutionPath())
            if solved:
                setup.simplifySolution(1.0)
            spent = processor_time() - began
            path = setup.getSolutionPath() if solved else None
            states = [] if path is None else [path.getState(k) for k in range(path.getStateCount())]
            places = [np.array([at[joint] for joint in range(size)]) for at in states]
            found.append(Attempt(solved, spent, length(problem.scene.model, places) if solved else np.nan))
    return found


def _row(name: str, planner: str, attempts: list[Attempt]) -> Row:
    seconds = np.array([one.seconds for one in attempts])
    ratios = np.array([one.length for one in attempts if one.solved])
    figures = {
        "solved": f"{sum(one.solved for one in attempts)} of {len(attempts)}",
        "median s": float(np.median(seconds)),
        "p95 s": float(np.quantile(seconds, 0.95)),
        "solved within 2 s %": 100.0 * float(np.mean([one.solved and one.seconds <= 2.0 for one in attempts])),
        "length ÷ shortest, median": float(np.median(ratios)) if len(ratios) else np.nan,
        "p90": float(np.quantile(ratios, 0.9)) if len(ratios) else np.nan,
    }
    return Row(name.replace("_", " "), planner, figures)
