"""One chunk of work of a comparison, and the reference kernel, whose time says how fast the machine was just then."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from wholebody.base.batches import own_child
from wholebody.base.runner import Child, EndedError, processor_time
from wholebody.bench.suite.adapters.base import FEASIBILITY_ONLY, Adapter, Budget
from wholebody.bench.suite.compare.results import DEFAULT, FAILED, OVERTIME, REFUSED, Chunk, Record
from wholebody.bench.suite.compare.solving import BUILDING, Which, built, solved, warmed
from wholebody.bench.suite.problem_sets.case import ProblemSet


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
    """What a chunk of work is: methods, each with its further budgets, on one case.

    A solve is ended after `cap` seconds of the processor; a sweep that is expected to take more than `most` seconds is
    left out.
    """

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
