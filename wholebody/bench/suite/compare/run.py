"""The whole comparison: which case next, by whom, what is kept, and how long it will take."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from wholebody.base.batches import spread
from wholebody.base.errors import WholebodyError
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.compare.jobs import Task, work
from wholebody.bench.suite.compare.plan import Plan
from wholebody.bench.suite.compare.settings import Settings, seed_of
from wholebody.bench.suite.compare.store import Chunk, Store

SPARE = 3.0  # times its equal share that a method's sweep of one case may take: others leave something over
TURN = 5  # methods by which the order is turned from case to case: far apart, so that a family does not stay together


class Progress(NamedTuple):
    """How far a run is: seconds of work done, and to do in all, as far as is known; what was done last."""

    done: float
    total: float
    said: str


def run(
    settings: Settings,
    folder: Path,
    jobs: int = 1,
    cluster: str | None = None,
    tell: Callable[[Progress], None] = lambda progress: None,
) -> Store:
    """Compare, or go on with a comparison that was ended.

    Args:
        settings: what is compared.
        folder: where what is found is kept.
        jobs: cases that are worked on at a time.
        cluster: address of a dask scheduler, for a sweep on many machines.
        tell: is told how far it is.

    Raises:
        InputError: the folder holds a run with other settings.
        WholebodyError: a set whose cases cannot be built.
    """
    store, plan = Store(folder, settings.described()), Plan(settings, jobs)
    for chunk in store.chunks:
        plan.note(chunk)
    began = time.perf_counter()
    before = sum(_seconds(chunk) for chunk in store.chunks)
    done = {(chunk.set, chunk.number) for chunk in store.chunks}
    end = began + 60.0 * settings.minutes - before / jobs
    for chunk in spread(work, _tasks(settings, plan, done, end), jobs, cluster):
        store.add(chunk)
        plan.note(chunk)
        worked = before + jobs * (time.perf_counter() - began)
        total = max(plan.seconds(plan.allowed()), worked)
        tell(Progress(worked, total, f"{chunk.set} {chunk.number}"))
    _check_built(store)
    return store


def _tasks(settings: Settings, plan: Plan, done: set[tuple[str, int]], end: float) -> Iterator[Task]:
    """Cases in turn over all sets, each with those methods that there is time for when it is begun.

    After the time `end`, for which the costs were foreseen too low, only sets are begun of which there is no case yet.
    """
    for number in range(settings.cases):
        for family in settings.sets:
            late = number > 0 and time.perf_counter() > end
            if late or (family.name, number) in done or number >= plan.cases(family.name):
                continue
            allowed = plan.allowed()
            solves = tuple(
                (adapter, tuple(settings.ladder(adapter, family.moving)) if number < given.sweep else ())
                for adapter in turned(settings.adapters, number)
                if number < (given := allowed[family.name, adapter.name]).cases
            )
            if solves:
                most = SPARE * plan.share
                yield Task(family, number, seed_of(settings.seed, number), solves, settings.cap, most)


def turned(adapters: tuple[Adapter, ...], number: int) -> tuple[Adapter, ...]:
    """The methods in another order for every case: nobody is always the first to wake a cold cache."""
    first = TURN * number % len(adapters)
    return adapters[first:] + adapters[:first]


def _seconds(chunk: Chunk) -> float:
    return chunk.building + sum(chunk.spent.values()) + sum(chunk.swept.values())


def _check_built(store: Store) -> None:
    """Say at once when nothing of a set could be built; single cases are listed in the report."""
    for family in dict.fromkeys(chunk.set for chunk in store.chunks):
        mine = [chunk for chunk in store.chunks if chunk.set == family]
        if all(chunk.fault for chunk in mine):
            raise WholebodyError(f"no case of the set {family} could be built ({mine[0].fault}); correct the set first")
