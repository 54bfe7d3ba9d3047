"""What is counted: a few problems of every set, reaches and drags followed for some frames, and hard cases.

They are chosen so that a change in the last digits of a number changes few counts: with starts displaced by 1e-9 all
of them stayed within a tenth.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import wholebody as wb
from tests.audits.regress.counting import counting, peak_bytes
from wholebody.bench.measure.scaling import assembly_chain
from wholebody.bench.measure.track import track
from wholebody.bench.suite.adapters.own import OwnTool
from wholebody.bench.suite.problem_sets.registry import problem_set
from wholebody.bench.suite.stability.catalogue import Posed, cases
from wholebody.methods.base import Method
from wholebody.methods.qp.solvers.base import ACTIVE_SET
from wholebody.problem import Problem

Counted = dict[str, int | str]

METHODS: dict[str, Callable[[], Method]] = {"qp": wb.methods.QP, "ccd": wb.methods.CCD, "newton": wb.methods.Newton}

PROBLEMS = (
    ("free_reach", 1),
    ("free_reach_several", 0),
    ("clutter", 2),
    ("self_contact", 0),
    ("balance", 1),
    ("closed_loop", 1),
    ("passage", 0),
    ("robot_arm", 0),
    ("robot_arm", 2),
)
"""Sets and numbers of problems that are solved once; their seed is 0."""

REACHES = ("free", "contact", "alone")
STEPS = 60  # of each
MEASURED = 20  # of them, at the end, whose memory is measured

DRAG = 0  # number of the drag that is followed
FRAMES = 40  # of it

HARD = (
    "straight-arm", "collinear-start", "goal-on-axis", "out-by-1-m", "inside-obstacle", "conflict", "behind-the-back",
    "long-way-round", "start-5-cm-inside", "cancelling-normals", "narrow-passage", "redundant-loop",
)  # fmt: skip
"""Cases of `wholebody bench stability`."""

BODIES = 30  # of the assembly that is dragged: 210 variables
MOVES = 20  # of its goal


@dataclass(frozen=True)
class Run:
    """One thing that is counted.

    Attributes:
        name: such as "solve clutter 2 by qp".
        counts: what was counted.
        seconds: of the processor.
    """

    name: str
    counts: Mapping[str, int | str]
    seconds: float


def runs() -> Iterator[Run]:
    """Count all of the selection, one after the other."""
    for name, count in selection():
        began = time.process_time()
        counts = count()
        yield Run(name, counts, time.process_time() - began)


def selection() -> Iterator[tuple[str, Callable[[], Counted]]]:
    """Name of each thing that is counted, and what counts it."""
    for family, number in PROBLEMS:
        problem = problem_set(family).make(number, 0).problem
        yield from _solves(f"{family} {number}", problem)
    for case in cases(HARD):
        question = case.question()
        assert isinstance(question, Posed)
        yield from _solves(case.name, question.problem)
    for name in REACHES:
        yield f"reach {name} by qp", partial(_reach, name)
    for name in METHODS:
        yield f"drag {DRAG} by {name}", partial(_drag, METHODS[name]())
    yield f"assembly of {BODIES} bodies by newton", _assembly


def _solves(what: str, problem: Problem) -> Iterator[tuple[str, Callable[[], Counted]]]:
    for name, make in METHODS.items():
        method = make()
        if method.accepts(problem) is None:
            yield f"solve {what} by {name}", partial(_solve, method, problem)


def _solve(method: Method, problem: Problem) -> Counted:
    wb.assess(problem, problem.start)
    with problem.borrow():
        pass  # the room for a judgement and for a run is there, so that making it is not counted
    with counting() as counts:
        solution = method.solve(problem)
    return {
        "status": solution.status,
        "iterations": solution.iterations,
        "passes": counts.passes,
        "pairs": counts.pairs,
    }


def _reach(name: str) -> Counted:
    """The reach of `wholebody bench step`, its beginning; memory at its end, where all buffers have been made."""
    course = track(name, STEPS)
    tool = OwnTool(course)
    tool.reset(course.start)
    with counting() as counts:
        for target in course.targets[:-MEASURED]:
            tool.step(target)
    taken = [peak_bytes(partial(tool.step, target)) for target in course.targets[-MEASURED:]]
    told = tool.remarks()
    return {
        "rows": round(STEPS * told["rows"]),
        "inexact": round(STEPS * (1.0 - told["exact"])),
        "asked": sum(count for by, count in tool.programs().items() if by != ACTIVE_SET),
        "passes": counts.passes,
        "pairs": counts.pairs,
        "bytes": int(np.median(taken)),
    }


def _drag(method: Method) -> Counted:
    case = problem_set("drag").make(DRAG, 0)
    tracker, q, iterations = method.tracker(case.problem, case.dt), case.problem.start, 0
    with counting() as counts:
        for goals in case.frames[:FRAMES]:
            case.problem.retarget(goals)
            step: Any = tracker.frame(q)
            q, iterations = step.q, iterations + step.iterations
    return {"iterations": iterations, "passes": counts.passes, "pairs": counts.pairs}


def _assembly() -> Counted:
    """The end of a chain dragged in a circle."""
    made, last, tip = assembly_chain(BODIES).drop_goals(), f"b{BODIES - 1}", np.array((0.2, 0.0, 0.0))
    here, systems = made.placement(last).act(tip), 0
    for angle in np.linspace(0.0, 1.0, MOVES):
        target = here + (0.03 * np.cos(angle) - 0.05, 0.03 * np.sin(angle), -0.03)
        systems += made.drop_goals().point_goal(last, target, place=tip).solve().systems
    return {"systems": systems, "structures": made.structures}
