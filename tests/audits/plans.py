"""Planned motions of problem sets: how many are found, how soon and how long, beside RRT-Connect of OMPL."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

import wholebody as wb
from tests.audits.plan_scenes import Question, questions
from wholebody.assessment.motion import frames_passed_through
from wholebody.base.runner import processor_time
from wholebody.bench.rows import Row
from wholebody.planning.local_planner import Geodesics
from wholebody.planning.planner import PASSED
from wholebody.planning.smoothing import length

LIMIT = 2.0  # s of the processor, of each plan
LONG = 1.3  # of the shortest motion of a problem

ONE_END = ", one end"  # planners to the same posture: their lengths count against the shortest of all of them


class Attempt(NamedTuple):
    """One plan of a problem: whether it was found, processor's seconds, and length over the shortest of the problem."""

    solved: bool
    seconds: float
    length: float


def rows(names: Sequence[str], cases: int, seeds: int) -> Iterator[Row]:
    """A row for each scene and planner; scenes whose files are missing say so."""
    for name in names:
        tried: dict[str, list[Attempt]] = {}
        try:
            for question in questions(name, cases):
                made = _attempts(question, seeds)
                for planner, attempts in made.items():
                    ends = (
                        [mine for name, mine in made.items() if ONE_END in name] if ONE_END in planner else [attempts]
                    )
                    least = min((one.length for mine in ends for one in mine if one.solved), default=np.nan)
                    tried.setdefault(planner, []).extend(one._replace(length=one.length / least) for one in attempts)
        except LookupError as missing:
            print(missing)
        yield from (_row(name, planner, attempts) for planner, attempts in tried.items())


def _attempts(asked: Question, seeds: int) -> dict[str, list[Attempt]]:
    scene, start, goal, given = asked
    plans = [wb.plan(scene, start, goal, constraints=given, seed=seed, time_limit=LIMIT) for seed in range(seeds)]
    ours = [Attempt(plan.solved, plan.seconds, plan.length) for plan in plans]
    free = wb.Problem(scene, start, goals=goal if isinstance(goal, list) else (), constraints=given)
    if free.constraints or scene.figure.roots or not find_spec("ompl"):
        return {"wholebody": ours}
    # OMPL looks for a way to one posture; ours to any of several that meet the goals, and beside it to the same one.
    end = wb.solve(free).q
    same = [wb.plan(scene, start, end, seed=seed, time_limit=LIMIT) for seed in range(seeds)]
    alike = [Attempt(plan.solved, plan.seconds, plan.length) for plan in same]
    return {"wholebody": ours, f"wholebody{ONE_END}": alike, f"ompl{ONE_END}": _by_ompl(free, end, seeds)}


def _edges(information: Any, local: Geodesics, size: int) -> Any:
    """What tests an edge of OMPL as ours are tested: by bisection that proves it free."""
    from ompl import base

    def proven(_: Any, first: Any, last: Any, *__: Any) -> bool:
        q, there = (np.array([at[joint] for joint in range(size)]) for at in (first, last))
        return local.towards(q, there)[1]

    return type("Edges", (base.MotionValidator,), {"checkMotion": proven})(information)


def _free(problem: wb.Problem, path: list[Any]) -> bool:
    """Whether the sweep that judges our plans finds nothing that straight motions between postures pass through."""
    return bool(path) and not frames_passed_through(problem.scene, np.array(path), PASSED)


def _by_ompl(problem: wb.Problem, end: Any, seeds: int) -> list[Attempt]:
    """RRT-Connect and path simplification of OMPL for a posture, with our tests of states and edges."""
    from ompl import base, geometric, util

    util.setLogLevel(util.LOG_NONE)
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
            information.setMotionValidator(_edges(information, local, size))
            first, last = space.allocState(), space.allocState()
            for joint in range(size):
                first[joint], last[joint] = float(problem.start[joint]), float(end[joint])
            setup.setStartAndGoalStates(first, last)
            setup.setPlanner(geometric.RRTConnect(information))
            began = processor_time()
            setup.solve(base.PlannerTerminationCondition(lambda until=began + LIMIT: processor_time() > until))
            solved = bool(setup.haveExactSolutionPath())
            if solved:
                setup.simplifySolution(max(LIMIT - (processor_time() - began), 0.1))
            spent = processor_time() - began
            path = setup.getSolutionPath() if solved else None
            states = [] if path is None else [path.getState(k) for k in range(path.getStateCount())]
            places = [np.array([at[joint] for joint in range(size)]) for at in states]
            free = _free(problem, places)
            found.append(Attempt(free, spent, length(problem.scene.model, places) if free else np.nan))
    return found


def _row(name: str, planner: str, attempts: list[Attempt]) -> Row:
    seconds = np.array([one.seconds for one in attempts])
    ratios = np.array([one.length for one in attempts if one.solved])
    figures: dict[str, Any] = {
        "solved": f"{sum(one.solved for one in attempts)} of {len(attempts)}",
        "median s": float(np.median(seconds)),
        "p95 s": float(np.quantile(seconds, 0.95)),
        "solved within 2 s %": 100.0 * float(np.mean([one.solved and one.seconds <= LIMIT for one in attempts])),
        "longest s": float(seconds.max()),
        "length ÷ shortest, median": float(np.median(ratios)) if len(ratios) else np.nan,
        f"at most {LONG} %": 100.0 * float(np.mean(ratios <= LONG)) if len(ratios) else np.nan,
    }
    return Row(name.replace("_", " "), planner, figures)
