"""Records in the order in which they are asked for: by set, method, budget and case."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from wholebody.base.arrays import Array
from wholebody.bench.suite.adapters.base import Budget
from wholebody.bench.suite.compare.record import COARSE, DEFAULT, FLOOR, REFUSED, Record

EFFORT_FLOOR = 1e-5  # share of the best effort below which efforts are not told apart


@dataclass(frozen=True)
class Quantity:
    """What is charted against time.

    Attributes:
        title: over a chart.
        label: of its axis.
        floor: below which values are not told apart.
        of: its value from a record and the best known measure of the case; infinite for a failure.
    """

    title: str
    label: str
    floor: float
    of: Callable[[Record, float], float]


def effort_excess(record: Record, best: float) -> float:
    """Effort above the best known, as a share of it; infinite for an answer that does not solve the problem."""
    if not record.success(COARSE) or best < 1e-9 or best == inf:  # nothing is a share of no effort
        return inf
    return max(record.measure / best - 1.0, EFFORT_FLOOR)


WORST = Quantity("worst of all", "worst error [m, rad]", FLOOR, lambda record, best: record.worst)
EFFORT = Quantity("effort", "effort above the best known [share]", EFFORT_FLOOR, effort_excess)


class Results:
    """All records of a comparison.

    Attributes:
        sets, adapters: names, in the order of reports.
    """

    def __init__(self, records: Iterable[Record], sets: Sequence[str], adapters: Sequence[str]) -> None:
        self.sets, self.adapters = tuple(sets), tuple(adapters)
        self._cells: dict[tuple[str, str], dict[Budget, dict[int, Record]]] = {}
        self._best: dict[tuple[str, int], float] = {}
        for record in records:
            cell = self._cells.setdefault((record.set, record.method), {})
            cell.setdefault(record.level, {})[record.number] = record
            case = (record.set, record.number)
            exact = record.measure if record.success(1e-6) else inf  # a less exact answer is cheaper by what it lacks
            self._best[case] = min(self._best.get(case, inf), record.best, exact)

    def best(self, record: Record) -> float:
        """Least measure known for the case of a record: of the witness, and of all answers exact to 1e-6."""
        return self._best[record.set, record.number]

    def default(self, family: str, adapter: str) -> list[Record]:
        """Records at the default budget, refusals too, in the order of cases."""
        return [record for _, record in sorted(self._cell(family, adapter).get(DEFAULT, {}).items())]

    def taken(self, family: str, adapter: str) -> list[Record]:
        """Records at the default budget of the cases that a method did not refuse."""
        return [record for record in self.default(family, adapter) if record.outcome != REFUSED]

    def levels(self, family: str, adapter: str) -> list[Budget]:
        """Budgets with which a set was swept, from cheap to exact: by their median time."""
        cell = self._cell(family, adapter)
        cases = self.swept(family, adapter)
        listed = [level for level, row in cell.items() if cases and cases <= row.keys()]
        return sorted(listed, key=lambda level: middle([cell[level][number].seconds for number in cases]))

    def swept(self, family: str, adapter: str) -> frozenset[int]:
        """Cases that a method solved at all its budgets; at the default one where it was not swept at all."""
        cell = self._cell(family, adapter)
        others = [frozenset(row) for level, row in cell.items() if level != DEFAULT]
        first = frozenset(record.number for record in self.taken(family, adapter))
        return first.intersection(*others) if others else first

    def values(
        self, family: str, adapter: str, level: Budget, quantity: Quantity, cases: Iterable[int]
    ) -> tuple[Array, Array]:
        """Seconds (n,) and values (n,) of some cases at one budget."""
        row = self._cell(family, adapter)[level]
        records = [row[number] for number in sorted(cases)]
        seconds = np.array([record.seconds for record in records])
        return seconds, np.array([quantity.of(record, self.best(record)) for record in records])

    def moving(self, family: str) -> bool:
        """Whether the goals of a set move."""
        return self.frames(family) > 0.0

    def frames(self, family: str) -> float:
        """Median count of the frames of a set's cases, as they were answered; 0 where goals do not move."""
        counts = {record.number: record.frames for adapter in self.adapters for record in self.default(family, adapter)
                  if record.frames}  # fmt: skip
        return middle(list(counts.values())) if counts else 0.0

    def quantities(self, family: str) -> tuple[Quantity, ...]:
        """What is charted of a set; efforts are not compared while goals move."""
        return (WORST,) if self.moving(family) else (WORST, EFFORT)

    def _cell(self, family: str, adapter: str) -> Mapping[Budget, Mapping[int, Record]]:
        return self._cells.get((family, adapter), {})


def middle(values: Sequence[float] | Array, share: float = 0.5) -> float:
    """A quantile that is one of the values: infinite ones are not averaged with others. NaN without values."""
    return float(np.quantile(values, share, method="inverted_cdf")) if len(values) else float("nan")
