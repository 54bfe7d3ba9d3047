"""What came of one method on one problem at one budget, and such records by set, method, budget and case."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.records import RecordFile
from wholebody.bench.suite.adapters.base import Budget

DEFAULT: Budget = (1e-4, None)
"""The budget at which all cases are solved: a tenth of a millimetre and of a milliradian, iterations as they come."""

COARSE = 1e-3  # m, rad: to which an answer is called a success
FLOOR = 1e-9  # m, rad: errors below this are not told apart

ANSWERED, REFUSED, FAILED, OVERTIME = "answered", "refused", "failed", "overtime"
"""Outcomes: a posture; the method said that it cannot take the problem; an exception or a posture that is none; the
process was ended because it took too long."""


@dataclass(frozen=True)
class Record:
    """One solve. Errors are infinite where there is no answer.

    `budget`: 0 iterations are the method's own, -1 is until all is met. `status`: what the method claims; `said`: its
    message, its refusal or the exception. `seconds`, `cpu_seconds`: of the call without the judgement, of a frame
    (median) where goals move; `tool_seconds`: within calls of the tool behind an adapter; `setup_seconds`: to build a
    model of its own. `programs`: what closed its quadratic programs. Errors are as judged [m, rad]: of goals 95 % of
    the frames where they move, of what must hold the worst frame; `best`: measure of the witness. Of moving goals:
    `frames`, `frame_p95` [s], `jerk` (root mean square of third differences), `turns` (sign changes of the velocity of
    the least gap, a second).
    """

    set: str
    number: int
    method: str
    tolerance: float
    budget: int
    outcome: str
    status: str = ""
    said: str = ""
    seconds: float = inf
    cpu_seconds: float = inf
    setup_seconds: float = 0.0
    tool_seconds: float = 0.0
    iterations: float = 0.0
    programs: str = ""
    goal_error: float = inf
    goal_angle: float = inf
    penetration: float = inf
    clearance_violation: float = inf
    limit_violation: float = inf
    constraint_violation: float = inf
    measure: float = inf
    optimality: float = inf
    best: float = inf
    frames: int = 0
    frame_p95: float = 0.0
    jerk: float = 0.0
    turns: float = 0.0

    @property
    def level(self) -> Budget:
        """Tolerance, and iterations or None, as adapters take them."""
        return self.tolerance, self.budget or None

    @property
    def answered(self) -> bool:
        """Whether there is a posture."""
        return self.outcome == ANSWERED

    @property
    def missed(self) -> float:
        """Largest goal error [m or rad]."""
        return max(self.goal_error, self.goal_angle)

    @property
    def broken(self) -> float:
        """Worst of all that must hold [m or rad]: contacts, clearances, limits, constraints."""
        return max(self.penetration, self.clearance_violation, self.limit_violation, self.constraint_violation)

    @property
    def worst(self) -> float:
        """The one figure of accuracy: the worst of goals and of all that must hold [m or rad]; infinite without one."""
        return max(self.missed, self.broken, FLOOR)

    def success(self, tolerance: float) -> bool:
        """Whether goals are met and everything held to a tolerance."""
        return self.answered and self.worst <= tolerance

    @property
    def false_claim(self) -> bool:
        """Whether the method calls solved what is judged to be off by more than it was asked for, and than 1 mm."""
        return self.status == "solved" and self.worst > max(COARSE, 1.05 * self.tolerance)


def frame_cap(cap: float, frames: float) -> float:
    """Seconds that a frame may take on the average, at least 0.1, where a solve may take `cap` and there are many."""
    return max(cap / frames, 0.1)


@dataclass(frozen=True)
class Quantity:
    """What is charted against time: its value is of a record and the best known measure; infinite for a failure."""

    title: str
    label: str
    of: Callable[[Record, float], float]


def effort_excess(record: Record, best: float) -> float:
    """Effort above the best known, as a share of it; infinite for an answer that does not solve the problem."""
    if not record.success(COARSE) or best < 1e-9 or best == inf:  # nothing is a share of no effort
        return inf
    return max(record.measure / best - 1.0, 1e-5)  # smaller ones are not told apart


WORST = Quantity("worst of all", "worst error [m, rad]", lambda record, best: record.worst)
EFFORT = Quantity("effort", "effort above the best known [share]", effort_excess)


class Results:
    """All records of a comparison; names of sets and adapters in the order of reports."""

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


NAME = "chunks.jsonl"


@dataclass(frozen=True)
class Chunk:
    """One case by some methods.

    Seconds by method: `spent` at the default budget, `swept` at all others, `cold` of the first solve in a process;
    `building` the case; `kernel`: of the reference kernel before the case was solved. `fault`: why the case could not
    be built.
    """

    set: str
    number: int
    records: tuple[Record, ...]
    spent: Mapping[str, float] = field(default_factory=dict)
    swept: Mapping[str, float] = field(default_factory=dict)
    building: float = 0.0
    cold: Mapping[str, float] = field(default_factory=dict)
    kernel: float = 0.0
    fault: str = ""

    @property
    def key(self) -> str:
        """Which case it is."""
        return f"{self.set} {self.number}"


class Store(RecordFile[Chunk]):
    """The file of a run; InputError for a run with other settings, FileFormatError for another file."""

    def __init__(self, folder: Path, settings: Mapping[str, Any]) -> None:
        super().__init__(folder / NAME, "records of wholebody bench compare", _chunk, settings)

    @property
    def chunks(self) -> list[Chunk]:
        """All chunks, in the order in which they came."""
        return list(self.kept.values())

    @property
    def records(self) -> list[Record]:
        """All records, in the order of cases, methods and budgets as they were run."""
        chunks = sorted(self.chunks, key=lambda chunk: (chunk.set, chunk.number))
        return [record for chunk in chunks for record in chunk.records]


def _chunk(plain: dict[str, Any]) -> Chunk:
    return Chunk(records=tuple(Record(**each) for each in plain.pop("records")), **plain)
