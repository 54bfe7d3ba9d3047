"""One solve of one case, or goals that move followed frame by frame, timed, and judged by `assess` alone."""

from __future__ import annotations

import copy
import gc
import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from wholebody.assessment.motion import third_differences
from wholebody.assessment.posture import Assessment, assess
from wholebody.base.arrays import Array
from wholebody.base.batches import own_child
from wholebody.base.compiled import compile_all
from wholebody.base.errors import WholebodyError
from wholebody.base.runner import Child, EndedError, allow, allow_processor, processor_time
from wholebody.bench.suite.adapters.base import FEASIBILITY_ONLY, Adapter, Budget
from wholebody.bench.suite.compare.results import (
    ANSWERED,
    DEFAULT,
    FAILED,
    OVERTIME,
    REFUSED,
    Chunk,
    Record,
    frame_cap,
)
from wholebody.bench.suite.problem_sets.case import Case, ProblemSet
from wholebody.bench.tables import programs_text
from wholebody.methods.base import FrameStep, Tracker
from wholebody.methods.differential import TOOL
from wholebody.problem import Problem

BUILDING = 300.0  # s: to build a case and what belongs to its scene; compiling once included
LEAST = 1e-6  # s: no call of a solver is faster; differences of two clock readings may be
JUDGED = (
    "goal_error", "goal_angle", "penetration", "clearance_violation", "limit_violation", "constraint_violation",
    "measure", "optimality",
)  # fmt: skip
"""Figures of a judgement that records have too: of the goals, of what must hold, and of the measures."""

USUAL = 0.95  # share of the frames whose tracking error counts: in the first ones the goal is far away


class Which(NamedTuple):
    """A case of a set."""

    family: ProblemSet
    number: int
    seed: int


@dataclass(frozen=True)
class Ready:
    """A case with everything that belongs to its scene built, and the measure of its witness."""

    case: Case
    best: float


_kept: dict[tuple[str, int, int], Ready] = {}  # the last case of this process
_warm: set[tuple[str, bool]] = set()  # methods that have run in this process, on cases that stand still or move


def built(which: Which) -> str | None:
    """Build a case; return what went wrong, if anything."""
    try:
        case_of(which)
    except Exception as error:
        return f"{type(error).__name__}: {sentence(error)}"
    return None


def warmed(which: Which, adapter: Adapter, cap: float) -> float:
    """Seconds of a method's first solve in this process, building included; 0 where it has run before."""
    made = case_of(which)
    key = (adapter.name, bool(made.case.frames))
    if key in _warm:
        return 0.0
    _warm.add(key)
    allow_processor(cap)
    began = time.perf_counter()
    # Of a moving case a method sees three frames before it is timed.
    solve(adapter, DEFAULT, replace(made, case=replace(made.case, frames=made.case.frames[:3])))
    return time.perf_counter() - began


def solved(which: Which, adapter: Adapter, level: Budget, cap: float) -> Record:
    """Solve a case; the process ends where that takes longer than it may."""
    warmed(which, adapter, cap)
    made = case_of(which)
    frames = len(made.case.frames)
    allow_processor(frame_cap(cap, frames) * frames if frames else cap)
    return solve(adapter, level, made)[0]


def case_of(which: Which) -> Ready:
    """The case, built where it is not the last one of this process."""
    key = (which.family.name, which.number, which.seed)
    if key not in _kept:
        _kept.clear()
        gc.collect()
        allow(BUILDING)
        _kept[key] = ready(*which)
    return _kept[key]


def ready(family: ProblemSet, number: int, seed: int) -> Ready:
    """Build a case; what is built at first use by whoever asks first is built here, in nobody's time."""
    compile_all()  # seconds at the first time on a machine, more than the quick comparison gives a solve
    case = family.make(number, seed)
    with case.problem.borrow():  # room that the solves below use again
        pass
    assess(case.problem, case.problem.start)
    return Ready(case, assess(case.problem, case.witness).measure)


def solve(adapter: Adapter, level: Budget, made: Ready) -> tuple[Record, list[Array]]:
    """Solve a case with a fresh method: what came of it, whatever the method does, and a posture (nq,) a frame."""
    empty = blank(adapter, level, made.case.set, made.case.number)
    try:
        method = adapter.make(*level)
        moving = bool(made.case.frames)
        problem = copy.copy(made.case.problem) if moving else made.case.problem  # each moves the goals of its own copy
        began = time.perf_counter()
        adapter.prepare(method, problem)
        empty = replace(empty, setup_seconds=time.perf_counter() - began, best=made.best)
        gc.disable()
        if moving:
            return _followed(method, problem, made.case, empty)
        return _once(method, problem, empty)
    except WholebodyError as error:
        return replace(empty, outcome=REFUSED, said=sentence(error)), []
    except Exception as error:  # a peer may raise anything; what it was is the result
        return replace(empty, outcome=FAILED, said=f"{type(error).__name__}: {sentence(error)}"), []
    finally:
        gc.enable()


def blank(adapter: Adapter, level: Budget, family: str, number: int) -> Record:
    """A record without an answer."""
    tolerance, iterations = level
    return Record(family, number, adapter.name, tolerance, iterations or 0, FAILED)


def sentence(error: BaseException) -> str:
    """What an error says, in one line."""
    return " ".join(str(error).split())[:300]


def _once(method: Any, problem: Problem, empty: Record) -> tuple[Record, list[Array]]:
    of_tool, worked, began = TOOL.seconds, processor_time(), time.perf_counter()
    solution = method.solve(problem)
    spent = time.perf_counter() - began - solution.assessment.seconds
    worked = processor_time() - worked
    q = np.asarray(solution.q, dtype=float)
    if not np.isfinite(q).all():
        return replace(empty, said="the answer is not finite", seconds=spent, status=solution.status), []
    judging = processor_time()
    judgement = assess(problem, q)
    worked -= min(processor_time() - judging, solution.assessment.seconds)  # the one within the call took as much
    filled = replace(
        empty,
        outcome=ANSWERED,
        status=solution.status,
        said=" ".join(solution.message.split())[:300],
        seconds=max(spent, LEAST),
        cpu_seconds=max(worked, LEAST),
        tool_seconds=TOOL.seconds - of_tool,
        iterations=float(solution.iterations),
        programs=programs_text(solution.programs),
    )
    return judged(filled, judgement), [q]


def judged(record: Record, judgement: Assessment) -> Record:
    """The record with the figures of a judgement."""
    return replace(record, **{name: getattr(judgement, name) for name in JUDGED})


class _Frame(NamedTuple):
    q: Array
    seconds: float
    cpu_seconds: float
    iterations: int
    judgement: Assessment


def _followed(method: Any, problem: Problem, case: Case, empty: Record) -> tuple[Record, list[Array]]:
    """Follow the goals of a case frame by frame; `problem` is a copy of its problem, that may be changed."""
    q = problem.scene.figure.clamp(problem.start)
    frames: list[_Frame] = []
    tracker: Tracker = method.tracker(problem, case.dt)
    for goals in case.frames:
        problem.retarget(goals)
        worked, began = processor_time(), time.perf_counter()
        step = tracker.frame(q, method.tolerance)
        q, iterations = step.q, step.iterations
        judging = step.judging if isinstance(step, FrameStep) else 0.0
        seconds = time.perf_counter() - began - judging
        worked = processor_time() - worked
        if not np.isfinite(q).all():
            return replace(empty, said=f"frame {len(frames)}: the posture is not finite"), []
        again = processor_time()
        judgement = assess(problem, q)
        worked -= min(processor_time() - again, judging)  # the judgement within the call, if any, took as much
        frames.append(_Frame(q, max(seconds, LEAST), max(worked, LEAST), iterations, judgement))
    return _summary(frames, case, empty), [frame.q for frame in frames]


def _summary(frames: list[_Frame], case: Case, empty: Record) -> Record:
    judgements = [frame.judgement for frame in frames]
    figures = {name: np.array([getattr(judged, name) for judged in judgements]) for name in JUDGED}
    kept: dict[str, Any] = {name: float(np.quantile(figures[name], USUAL)) for name in JUDGED[:2]}
    kept |= {name: float(figures[name].max()) for name in JUDGED[2:6]}
    kept |= {name: float(figures[name][-1]) for name in JUDGED[6:]}
    seconds = np.array([frame.seconds for frame in frames])
    gaps = np.array([judged.least_distance for judged in judgements])
    return replace(
        empty,
        outcome=ANSWERED,
        said=f"{len(frames)} frames",
        seconds=float(np.median(seconds)),
        cpu_seconds=float(np.median([frame.cpu_seconds for frame in frames])),
        iterations=float(np.mean([frame.iterations for frame in frames])),
        **kept,
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
    signs = np.sign(change[np.abs(change) > 1e-6])  # m: a gap that changes less in a frame does not turn
    return int(np.count_nonzero(signs[1:] != signs[:-1]))


def kernel_seconds() -> float:
    """Seconds of the processor that the kernel takes now; about 4 ms on a processor of 2020."""
    work = _made()
    return min(_timed(*work) for _ in range(3))  # of which the fastest counts: others were interrupted


def _timed(matrix: Any, pairs: Any) -> float:
    import coal

    request, result = coal.DistanceRequest(), coal.DistanceResult()
    began = processor_time()
    product = matrix
    for _ in range(60):
        product = product @ matrix
    for first, placed_first, second, placed_second in pairs:
        result.clear()
        coal.distance(first, placed_first, second, placed_second, request, result)
    return processor_time() - began


@lru_cache(maxsize=1)
def _made() -> tuple[Any, Any]:
    """An orthogonal matrix, whose powers neither grow nor vanish, and boxes and capsules beside each other."""
    import coal

    rng = np.random.default_rng(0)
    matrix = np.linalg.qr(rng.normal(size=(64, 64)))[0]  # about the degrees of freedom of a person
    shapes = (coal.Box(0.3, 0.2, 0.1), coal.Capsule(0.05, 0.3))
    pairs = []
    for number in range(1000):  # distances: about the pairs of a person among twenty things
        turns = np.linalg.qr(rng.normal(size=(2, 3, 3)))[0]
        turns *= np.sign(np.linalg.det(turns))[:, None, None]
        places = [coal.Transform3s(turn, rng.uniform(-0.5, 0.5, 3)) for turn in turns]
        pairs.append((shapes[number % 2], places[0], shapes[number // 2 % 2], places[1]))
    return matrix, pairs


_local = threading.local()


@dataclass(frozen=True)
class Task:
    """Methods with further budgets on a case; seconds of a solve, `cap`, and of a sweep, `most`."""

    family: ProblemSet
    number: int
    seed: int
    solves: tuple[tuple[Adapter, tuple[Budget, ...]], ...]
    cap: float
    most: float


def work(task: Task) -> Chunk:
    """Build a case and let every method solve it, one after the other in a process of their own."""
    child, which = own_child(), Which(task.family, task.number, task.seed)
    child.close_if_full()
    began = time.perf_counter()
    try:
        fault = child.call(built, which, seconds=BUILDING)
    except EndedError as error:
        fault = str(error)
    building = time.perf_counter() - began
    if fault:
        return Chunk(task.family.name, task.number, (), building=building, fault=fault)
    records: list[Record] = []
    spent, swept, cold = {}, {}, {}
    kernel = child.call(kernel_seconds, seconds=BUILDING)
    for adapter, ladder in task.solves:
        first_time = _warm_up(child, which, adapter, task.cap)  # compiling, which says nothing of what its solves cost
        if first_time > 0.0:
            cold[adapter.name] = first_time
        began = time.perf_counter()
        first, ended = _solve(child, adapter, DEFAULT, task)
        records.append(first)
        between = time.perf_counter()
        spent[adapter.name] = between - began
        if ladder and spent[adapter.name] * len(ladder) <= task.most:
            records += _sweep(child, adapter, ladder, task, first, ended)
            swept[adapter.name] = time.perf_counter() - between
    return Chunk(task.family.name, task.number, tuple(records), spent, swept, building, cold, kernel)


def _sweep(
    child: Child, adapter: Adapter, ladder: Iterable[Budget], task: Task, first: Record, ended: bool
) -> list[Record]:
    """All further budgets; those after one at which the process ended get the record of that budget."""
    records: list[Record] = []
    if first.outcome == REFUSED:
        return records
    last = {False: (first, ended), True: (first, False)}
    for level in ladder:
        kind = level[1] == FEASIBILITY_ONLY
        record, over = last[kind]
        if not over:
            last[kind] = record, over = _solve(child, adapter, level, task)
            records.append(record)
        else:
            records.append(replace(record, tolerance=level[0], budget=level[1] or 0))
    return records


def _solve(child: Child, adapter: Adapter, level: Budget, task: Task) -> tuple[Record, bool]:
    """What came of a solve, and whether the process has ended over it."""
    try:
        which = Which(task.family, task.number, task.seed)
        record: Record = child.call(solved, which, adapter, level, task.cap, seconds=BUILDING)
    except EndedError as error:
        empty = Record(task.family.name, task.number, adapter.name, level[0], level[1] or 0, FAILED)
        if error.overtime:
            return replace(empty, outcome=OVERTIME, said=f"ended after {task.cap:g} s"), True
        return replace(empty, said=str(error)), True
    return record, False


def _warm_up(child: Child, which: Which, adapter: Adapter, cap: float) -> float:
    """Seconds of a method's first solve in the process; 0 where it has run there before, or never came back."""
    if adapter.name in _hopeless():
        return 0.0
    try:
        return float(child.call(warmed, which, adapter, cap, seconds=BUILDING))
    except EndedError:
        _hopeless().add(adapter.name)
        return 0.0


def _hopeless() -> set[str]:
    """Names of the methods that ended this thread's process over warming up."""
    if not hasattr(_local, "hopeless"):
        _local.hopeless = set[str]()
    found: set[str] = _local.hopeless
    return found
