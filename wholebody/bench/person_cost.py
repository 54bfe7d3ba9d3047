"""What a person's defaults cost: the same steps and the same solve with them and without, in pairs.

The defaults are ranges of motion, reach cones, balance where the person stands, and the measure `Rhythm`. The other
tools cannot be told of them, so that steps are compared with those tools without.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import wholebody as wb
from wholebody.bench.adapters.own import reach_problem
from wholebody.bench.statistics import Interval, median
from wholebody.bench.step import quiet
from wholebody.bench.track import DT, Track
from wholebody.tasks.base import Measure

ASKED = 1.15  # times of what it costs without
PARTS = (wb.RangeOfMotion, wb.ReachCones, wb.Balance)


@dataclass(frozen=True)
class PersonCostRow:
    """What a step or a solve costs with a person's defaults; all times are the processor's.

    Attributes:
        what: "free step", say, or "shelf solve".
        pairs: of pieces, that could touch.
        repeats: runs of both kinds, after each other in turning order.
        without_us, with_us: mean of a step, or time of a solve; median of the repeats [us].
        ratio: of with to without in the same repeat: the median, and its 95 % interval by the bootstrap.
    """

    what: str
    pairs: int
    repeats: int
    without_us: float
    with_us: float
    ratio: Interval


def person_costs(courses: Sequence[Track], task: Path, repeats: int) -> list[PersonCostRow]:
    """Measure steps of each reach, and solves of a task that a person does.

    Args:
        courses: reaches of the human.
        task: a task file; what it states of the defaults itself is in both problems, but for ranges and reach cones.
        repeats: counted runs of both kinds; a first one is not counted.
    """
    rows = []
    for course in courses:
        both = [_follower(course, person) for person in (False, True)]
        rows.append(_row(f"{course.name} step", course.pairs, both, repeats))
    posed = wb.read_task(task).problem
    solves = [_solver(problem) for problem in (without_defaults(posed), posed)]
    rows.append(_row(f"{task.stem} solve", len(posed.scene.geometry.collisionPairs), solves, repeats))
    return rows


def without_defaults(problem: wb.Problem) -> wb.Problem:
    """The same problem without ranges of motion, reach cones and rhythm, and without balance if it is not stated."""
    measures: list[Measure] = [term for term in problem.measures if not isinstance(term, wb.Rhythm)]
    return wb.Problem(
        problem.scene,
        problem.start,
        goals=problem.goals,
        constraints=[*(term for term in problem.stated if not isinstance(term, PARTS[:2])), *problem.bounds],
        measures=measures,
        clearance=problem.clearance,
        touching=problem.touching,
        range_of_motion=False,
        balance=False,
    )


def _follower(course: Track, person: bool) -> Callable[[], Iterator[float]]:
    """Follows a whole reach from standing; time of each step [us]."""
    problem, goal = reach_problem(course, range_of_motion=person, balance=None if person else False)
    tracker = wb.QP().tracker(problem, DT)

    def follow() -> Iterator[float]:
        q = np.array(course.start)
        for target in course.targets:
            goal.target[:] = target
            began = time.thread_time_ns()
            q = tracker.step(q).q
            yield (time.thread_time_ns() - began) / 1e3

    return follow


def _solver(problem: wb.Problem) -> Callable[[], Iterator[float]]:
    """Solves a problem; time of it [us]."""
    method = wb.QP(tolerance=1e-5)

    def solve() -> Iterator[float]:
        began = time.thread_time_ns()
        method.solve(problem)
        yield (time.thread_time_ns() - began) / 1e3

    return solve


def _row(what: str, pairs: int, both: Sequence[Callable[[], Iterator[float]]], repeats: int) -> PersonCostRow:
    """Run without and with the defaults step by step after each other, so that what slows one slows the other."""
    spent = np.empty((repeats + 1, 2))
    with quiet():
        for repeat in range(repeats + 1):
            order = (0, 1) if repeat % 2 else (1, 0)
            times = list(zip(both[order[0]](), both[order[1]](), strict=True))
            spent[repeat, list(order)] = np.mean(times, axis=0)
    counted = spent[1:]
    ratio = median([float(value) for value in counted[:, 1] / counted[:, 0]])
    without, own = np.median(counted, axis=0).tolist()
    return PersonCostRow(what, pairs, repeats, without, own, ratio)
