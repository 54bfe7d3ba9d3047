"""What a comparison is asked to do, and its course: which case next, by whom, what is kept, and how long it will take.

Every method has the same share of the time in every set. What a fast one leaves over goes to the others: min(cost,
share) summed over all is the time there is. Of its share a method spends half at the default budget and half on the
sweep of its budgets, and what the one does not need on the other.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.batches import spread
from wholebody.base.errors import InputError, WholebodyError
from wholebody.base.fields import Checked, Range
from wholebody.bench.suite.adapters.base import FEASIBILITY_ONLY, Adapter, Budget
from wholebody.bench.suite.compare.results import DEFAULT, Chunk, Store
from wholebody.bench.suite.compare.solving import Task, work
from wholebody.bench.suite.problem_sets.case import ProblemSet
from wholebody.version import __version__

SEEDS = 3  # from which the cases of a set are made in turn
MOST = 1 << 31


@dataclass(frozen=True)
class Settings(Checked):
    """What is compared, and how much of it.

    `cases` of every set at the default budget, of which the first `sweep` at `levels` others too; problems are made
    from `SEEDS` seeds in turn, from `seed` on; a solve is ended after `cap` seconds of the processor; all solving takes
    `minutes`.
    """

    sets: tuple[ProblemSet, ...]
    adapters: tuple[Adapter, ...]
    cases: Annotated[int, Range(1, MOST, whole=True)] = 200
    sweep: Annotated[int, Range(0, MOST, whole=True)] = 40
    levels: Annotated[int, Range(1, MOST, whole=True)] = 6
    seed: Annotated[int, Range(0, MOST, whole=True)] = 0
    cap: Annotated[float, Range(1e-3, 1e6, "s")] = 20.0
    minutes: Annotated[float, Range(1e-3, 1e6)] = 25.0

    def __post_init__(self) -> None:
        """Check the numbers; InputError for one that makes no sense, and for no set or method."""
        super().__post_init__()
        if not self.sets or not self.adapters:
            raise InputError("a comparison needs a problem set and a method; name at least one of each")

    def described(self) -> dict[str, Any]:
        """What a folder's run must agree in to be gone on with."""
        return {
            "wholebody": __version__,
            "sets": [family.name for family in self.sets],
            "methods": [adapter.name for adapter in self.adapters],
            "cases": self.cases,
            "sweep": self.sweep,
            "levels": {adapter.name: [list(level) for level in self.ladder(adapter)] for adapter in self.adapters},
            "seeds": [seed_of(self.seed, number) for number in range(SEEDS)],
            "cap": self.cap,
            "minutes": self.minutes,
        }

    def asked(self, family: ProblemSet) -> tuple[int, int]:
        """Cases of a set at the default budget, and at all budgets: fewer of these where goals move."""
        # A case whose goals move is hundreds of solves at every budget.
        return self.cases, self.sweep // 4 if family.moving else self.sweep

    def ladder(self, adapter: Adapter, moving: bool = False) -> list[Budget]:
        """Budgets beside the default one, from cheap to exact, evenly chosen where there are more than `levels`."""
        unused = FEASIBILITY_ONLY if moving else 0
        listed = [level for level in adapter.loose if level != DEFAULT and level[1] != unused]
        most = min(self.levels, 3) if moving else self.levels  # a case whose goals move is hundreds of solves
        if len(listed) <= most:
            return listed
        first = [level for level in listed if level[1] == FEASIBILITY_ONLY]
        others = [level for level in listed if level[1] != FEASIBILITY_ONLY]
        share = round(most * len(first) / len(listed))
        return [*_evenly(first, share), *_evenly(others, most - share)]


def _evenly(listed: list[Budget], most: int) -> list[Budget]:
    """So many of them, the first and the last among them; the first where it is one."""
    if len(listed) <= most:
        return listed
    return [listed[round(place * (len(listed) - 1) / max(most - 1, 1))] for place in range(most)]


def seed_of(seed: int, number: int) -> int:
    """Seed of a case: every set is made from `SEEDS` seeds in turn, so that what depends on one of them shows."""
    return seed + number % SEEDS


QUICK: dict[str, Any] = {"cases": 20, "sweep": 6, "levels": 5, "cap": 5.0, "minutes": 2.0}
"""A short comparison, within three minutes on two cores."""


FIRST = 4  # cases after which it is known what building one takes


class Allowed(NamedTuple):
    """Cases of one method in one set: at the default budget, and at all of them."""

    cases: int
    sweep: int


class Plan:
    """Keeps count of what things cost, and says who may go on."""

    def __init__(self, settings: Settings, jobs: int) -> None:
        self._total = 60.0 * settings.minutes * jobs
        self._levels = {
            (family.name, adapter.name): len(settings.ladder(adapter, family.moving))
            for family in settings.sets
            for adapter in settings.adapters
        }
        self._spent: dict[tuple[str, str], list[float]] = {key: [] for key in self._levels}
        self._swept: dict[tuple[str, str], list[float]] = {key: [] for key in self._levels}
        self._asked = {family.name: settings.asked(family) for family in settings.sets}
        self._building: dict[str, list[float]] = {family.name: [] for family in settings.sets}

    def note(self, chunk: Chunk) -> None:
        """Take a finished chunk into account."""
        self._building[chunk.set].append(chunk.building)
        for known, taken in ((self._spent, chunk.spent), (self._swept, chunk.swept)):
            for adapter, seconds in taken.items():
                known[chunk.set, adapter].append(seconds)

    def cases(self, family: str) -> int:
        """How many cases of a set there is time to build."""
        if len(self._building[family]) < FIRST:
            return self._asked[family][0]
        share = 0.3 * self._total / len(self._building)  # of a set's time, that building its cases may take
        possible = max(FIRST, int(share / max(self._built(family), 1e-6)))
        return min(possible, self._asked[family][0])

    def _built(self, family: str) -> float:
        """Seconds to build a case; the slow ones are those for which a process was started, and a body loaded."""
        known = self._building[family]
        if len(known) < FIRST:  # it may be the one for which everything was compiled: all sets tell more
            known = [seconds for times in self._building.values() for seconds in times]
        return float(np.quantile(known, 0.25)) if len(known) >= FIRST else 0.0

    def allowed(self) -> dict[tuple[str, str], Allowed]:
        """Cases of every method in every set, by what is known of the costs now."""
        one, sweep, built = self._costs()
        most = np.array([self.cases(family) for family, _ in self._levels], dtype=float)
        swept = np.array([self._asked[family][1] for family, _ in self._levels], dtype=float)
        counts = share_out(one, sweep, most, np.minimum(most, swept), self._total - built)
        return {key: Allowed(int(cases), int(sweeps)) for key, cases, sweeps in zip(self._levels, *counts, strict=True)}

    @property
    def share(self) -> float:
        """Seconds of a method in a set, if all had the same."""
        return self._total / len(self._levels)

    def seconds(self, allowed: dict[tuple[str, str], Allowed]) -> float:
        """What all cases that are allowed will have taken."""
        one, sweep, built = self._costs()
        counts = np.array([allowed[key] for key in self._levels], dtype=float)
        return float(one @ counts[:, 0] + sweep @ counts[:, 1]) + built

    def _costs(self) -> tuple[Array, Array, float]:
        """Seconds of a case (n,) and of a sweep (n,) of each method in each set, and to build all cases."""
        one = {key: float(np.mean(self._spent[key] or [0.0])) for key in self._levels}
        # as long at every budget, until it is known
        sweep = [float(np.mean(self._swept[key] or [one[key] * levels])) for key, levels in self._levels.items()]
        built = sum(self.cases(name) * self._built(name) for name in self._building)
        return np.array(list(one.values())), np.array(sweep), built


def share_out(one: Array, sweep: Array, most: Array, most_swept: Array, total: float) -> tuple[Array, Array]:
    """Cases (n,) and sweeps (n,) of every method in a total time; `one` and `sweep` [s]: of a case and a sweep."""

    def parts(share: float) -> tuple[Array, Array]:
        once = np.where((share - one >= sweep) & (most_swept > 0), sweep, 0.0)
        second = np.clip(0.5 * share, once, np.maximum(most_swept * sweep, once))
        first = np.clip(share - second, one, most * one)
        return first, np.clip(share - first, second, np.maximum(most_swept * sweep, second))

    low, high = 0.0, float((one * most + sweep * most_swept).max(initial=0.0))
    for _ in range(50):
        middle = 0.5 * (low + high)
        first, second = parts(middle)
        low, high = (middle, high) if (first + second).sum() <= total else (low, middle)
    first, second = parts(high if (np.add(*parts(high))).sum() <= total else low)
    return _count(first, one, most, 1.0), _count(second, sweep, most_swept, 0.0)


def _count(seconds: Array, each: Array, most: Array, least: float) -> Array:
    free = each <= 0.0
    counts = np.floor(seconds / np.where(free, 1.0, each) + 1e-9)
    return np.where(free, most, np.clip(counts, np.minimum(least, most), most))


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
    """Compare, or go on with a comparison that was ended; `cluster` is the address of a dask scheduler."""
    store, plan = Store(folder, settings.described()), Plan(settings, jobs)
    for chunk in store.chunks:
        plan.note(chunk)
    began = time.perf_counter()
    before = sum(each.building + sum(each.spent.values()) + sum(each.swept.values()) for each in store.chunks)
    done = {(chunk.set, chunk.number) for chunk in store.chunks}
    end = began + 60.0 * settings.minutes - before / jobs
    for chunk in spread(work, _tasks(settings, plan, done, end), jobs, cluster):
        store.add(chunk.key, chunk)
        plan.note(chunk)
        worked = before + jobs * (time.perf_counter() - began)
        total = max(plan.seconds(plan.allowed()), worked)
        tell(Progress(worked, total, chunk.key))
    _check_built(store)
    return store


def _tasks(settings: Settings, plan: Plan, done: set[tuple[str, int]], end: float) -> Iterator[Task]:
    """Cases of all sets in turn, with the methods that time allows; after `end` only the first case of a set."""
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
                # A sweep of one case may take three times its share: others leave something over.
                most = 3.0 * plan.share
                yield Task(family, number, seed_of(settings.seed, number), solves, settings.cap, most)


def turned(adapters: tuple[Adapter, ...], number: int) -> tuple[Adapter, ...]:
    """The methods in another order for every case: nobody is always the first to wake a cold cache."""
    # The order is turned by five methods from case to case, so that a family does not stay together.
    first = 5 * number % len(adapters)
    return adapters[first:] + adapters[:first]


def _check_built(store: Store) -> None:
    """Say at once when nothing of a set could be built; single cases are listed in the report."""
    for family in dict.fromkeys(chunk.set for chunk in store.chunks):
        mine = [chunk for chunk in store.chunks if chunk.set == family]
        if all(chunk.fault for chunk in mine):
            raise WholebodyError(f"no case of the set {family} could be built ({mine[0].fault}); correct the set first")
