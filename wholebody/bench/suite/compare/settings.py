"""What a comparison is asked to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from wholebody.base.errors import InputError
from wholebody.base.fields import Checked, Range
from wholebody.bench.suite.adapters.base import FEASIBILITY_ONLY, Adapter, Budget
from wholebody.bench.suite.compare.results import DEFAULT
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
        # A case whose goals move is hundreds of solves.
        most = min(self.levels, 3) if moving else self.levels
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
