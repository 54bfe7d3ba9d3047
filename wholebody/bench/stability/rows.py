"""A line of the result, for the CSV file and for everything that is drawn and written from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from wholebody.bench.stability.case import HardCase, Kind
from wholebody.bench.stability.judging import INSIDE
from wholebody.bench.stability.running import Cell
from wholebody.bench.stability.verdict import WORDS, Verdict, audited, decide


@dataclass(frozen=True)
class StabilityRow:
    """One method's answer to one case.

    Attributes:
        case, method: who was asked what.
        verdict: "solved", "honest", "refusal", "adapter" or "wrong".
        acceptable: whether the case accepts it.
        figure: the worst figure, in a few words.
        status: what the method says.
        goal_error: largest goal error left [m, rad].
        best: that of the best answer known [m, rad].
        penetration: deepest overlap [m].
        limit_violation: [rad, m].
        constraint_violation: [m, rad].
        frames: postures that were judged.
        seconds: wall time of the method.
        sentence: what the method says in words, or its refusal.
    """

    case: str
    method: str
    verdict: str
    acceptable: bool
    figure: str
    status: str
    goal_error: float
    best: float
    penetration: float
    limit_violation: float
    constraint_violation: float
    frames: int
    seconds: float
    sentence: str


@dataclass(frozen=True)
class Result:
    """All cells with their verdicts.

    Attributes:
        cases: in the order of reports.
        methods: in the order in which they were asked.
        cells: by case's name and method.
        verdicts: the same.
        best: least goal error known, by case's name [m, rad].
    """

    cases: tuple[HardCase, ...]
    methods: tuple[str, ...]
    cells: dict[tuple[str, str], Cell]
    verdicts: dict[tuple[str, str], Verdict]
    best: dict[str, float]

    def count(self, method: str, kind: Kind) -> int:
        """How many of a method's verdicts are of one kind."""
        return sum(self.verdicts[case.name, method].kind == kind for case in self.cases)

    def acceptable(self, method: str) -> int:
        """How many of a method's answers are acceptable."""
        return sum(self.verdicts[case.name, method].acceptable for case in self.cases)

    def of_kind(self, kind: Kind) -> list[tuple[str, HardCase, Verdict]]:
        """All verdicts of a kind: method, case and verdict, method by method."""
        found = [(method, case, self.verdicts[case.name, method]) for method in self.methods for case in self.cases]
        return [one for one in found if one[2].kind == kind]

    def alike(self, case: HardCase) -> list[tuple[str, list[str]]]:
        """The verdicts on a case in words, and the methods that have each, in the order in which they were asked."""
        found: dict[str, list[str]] = {}
        for method in self.methods:
            verdict = self.verdicts[case.name, method]
            words = f"{verdict.symbol} {WORDS[verdict.kind]}" + (f": {verdict.figure}" if verdict.figure else "")
            found.setdefault(words, []).append(method)
        return list(found.items())

    def rows(self) -> list[StabilityRow]:
        """One a cell, case by case."""
        return [self._row(case, method) for case in self.cases for method in self.methods]

    def _row(self, case: HardCase, method: str) -> StabilityRow:
        cell, verdict = self.cells[case.name, method], self.verdicts[case.name, method]
        answer, judged = cell.answer, cell.judged
        return StabilityRow(
            case.name, method, verdict.kind, verdict.acceptable, verdict.figure, answer.status, judged.goal_error,
            self.best.get(case.name, float("nan")), judged.penetration, judged.limit_violation,
            judged.constraint_violation, len(answer.postures), answer.seconds, answer.refusal or answer.message,
        )  # fmt: skip


def result(cases: Sequence[HardCase], methods: Sequence[str], cells: Sequence[Cell]) -> Result:
    """Decide all cells: each is compared with the best answer of all."""
    best = _known(cells)
    best |= {case.name: case.best for case in cases if case.best is not None}
    placed = {(cell.case.name, cell.method): cell for cell in cells}
    verdicts = {
        key: audited(*key, decide(cell.case, cell.answer, cell.judged, best.get(cell.case.name)))
        for key, cell in placed.items()
    }
    return Result(tuple(cases), tuple(methods), placed, verdicts, best)


def _known(cells: Sequence[Cell]) -> dict[str, float]:
    """Least goal error of each case's answers with which nothing is wrong, by the case's name [m, rad]."""
    found: dict[str, float] = {}
    for cell in cells:
        kind = decide(cell.case, cell.answer, cell.judged).kind
        if kind in ("solved", "honest") and cell.judged.penetration <= INSIDE:
            name = cell.case.name
            found[name] = min(found.get(name, math.inf), cell.judged.goal_error)
    return found
