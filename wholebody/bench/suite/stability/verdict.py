"""Decides what answers are worth, by rules, in order: solved, an honest best effort, a clear refusal, or WRONG.

All verdicts together are a result, of which everything is drawn and written.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, cast

from wholebody.bench.suite.stability.asking import Cell
from wholebody.bench.suite.stability.case import Answer, HardCase, Kind
from wholebody.bench.suite.stability.judging import INSIDE, Judged
from wholebody.bench.tables import filled

BEYOND = 1e-6  # rad, m: farther than this is out of limits
BROKEN = 1e-4  # m, rad: farther than this a constraint does not hold
FAST = 0.01  # share by which a joint may be faster than its bound: rounding, and steps along curves
NOT_HELD = ("infeasible", "stalled")  # statuses that say that something may be violated
SAME = 2e-5  # m: nearer to the best known answer than this is as good
LEAST_SENTENCE = 15  # letters of a refusal that says anything

SYMBOLS: dict[Kind, str] = {"solved": "✓", "honest": "○", "refusal": "–", "wrong": "✗"}
WORDS: dict[Kind, str] = {
    "solved": "solved",
    "honest": "honest best effort",
    "refusal": "clear refusal",
    "wrong": "WRONG",
}


class Verdict(NamedTuple):
    """What one method's answer to one case is worth.

    Attributes:
        kind: of the four.
        figure: the worst figure, in a few words; "" where there is nothing to add.
        acceptable: whether the case accepts it.
    """

    kind: Kind
    figure: str
    acceptable: bool

    @property
    def symbol(self) -> str:
        """One sign: an honest answer that is as good as can be is a full circle."""
        return "●" if self.kind == "honest" and self.acceptable else SYMBOLS[self.kind]


def decide(case: HardCase, answer: Answer, judged: Judged, best: float | None = None) -> Verdict:
    """The verdict on an answer and what it measures.

    `best` is the goal error of the best answer that any method found, for a case that knows none itself [m, rad].
    """
    wrong = _wrong(case, answer, judged)
    if wrong:
        return Verdict("wrong", wrong, False)
    if answer.refusal:
        return Verdict("refusal", "", case.accepts("refusal", math.inf))
    known = case.best if case.best is not None else best
    miss = judged.goal_error - (known or 0.0)
    held = max(judged.penetration - INSIDE, judged.constraint_violation - BROKEN) <= 0.0
    if held and judged.goal_error <= case.tolerance:
        return Verdict("solved", "", case.accepts("solved", miss))
    return Verdict("honest", _short(judged, known, miss), (held or not case.can_hold) and case.accepts("honest", miss))


def _wrong(case: HardCase, answer: Answer, judged: Judged) -> str:
    """What is wrong with an answer, the worst first; empty for nothing."""
    if answer.failure:
        return answer.failure
    if answer.taken:
        return "takes " + ", ".join(answer.taken)
    if answer.refusal:
        return "" if len(answer.refusal) >= LEAST_SENTENCE else f"refuses with {answer.refusal!r} only"
    if case.expected == "refusal":
        return "answers"
    if not judged.finite:
        return "NaN"
    if judged.limit_violation > BEYOND:
        return f"{judged.limit_violation:.2g} rad out of limits"
    if judged.passed:
        return f"{length(judged.dip)} inside on the way: {judged.passed}"
    return _missed(case, answer, judged)


def _missed(case: HardCase, answer: Answer, judged: Judged) -> str:
    """What lengths tell: overlap, constraints, speed, and what the method says of them."""
    doubts = answer.status in NOT_HELD
    allowed = judged.start_penetration + INSIDE if doubts else INSIDE
    if judged.penetration > allowed:
        return f"{length(judged.penetration)} inside{_said(answer)}"
    if judged.constraint_violation > BROKEN and (case.can_hold or not doubts):
        return f"a constraint missed by {length(judged.constraint_violation)} (or mrad){_said(answer)}"
    if judged.speed_excess > FAST:
        return f"{1.0 + judged.speed_excess:.1f} times too fast"
    if answer.status == "solved" and judged.goal_error > case.tolerance:
        return f"claims solved, {length(judged.goal_error)} left"
    if judged.misreported > case.tolerance:
        return f"misreports what is left by {length(judged.misreported)}"
    return ""


def _said(answer: Answer) -> str:
    return f", says {answer.status}" if answer.status else ""


def _short(judged: Judged, known: float | None, miss: float) -> str:
    """How far an honest answer is from the best known one."""
    if judged.constraint_violation > BROKEN:
        return f"{length(judged.constraint_violation)} missed"
    if judged.penetration > INSIDE:
        return f"{length(judged.penetration)} inside, not deeper"
    if not known:
        return f"{length(judged.goal_error)} left"
    return "best known" if miss <= SAME else f"+{length(miss)}"


def length(metres: float) -> str:
    """A length with the unit that suits it: "1.2 m", "34 mm", "5 µm"."""
    if metres >= 0.995:
        return f"{metres:.3g} m"
    return f"{1e3 * metres:.3g} mm" if metres >= 1e-4 else f"{1e6 * metres:.2g} µm"


@dataclass(frozen=True)
class StabilityRow:
    """One method's answer to one case; errors in m and rad.

    Attributes:
        verdict: "solved", "honest", "refusal" or "wrong".
        acceptable: whether the case accepts it.
        figure: the worst figure, in a few words.
        status: what the method says.
        goal_error, best: largest goal error left, and that of the best answer known.
        frames: postures that were judged.
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
        rows: by case's name and method.
    """

    cases: tuple[HardCase, ...]
    methods: tuple[str, ...]
    rows: Mapping[tuple[str, str], StabilityRow]

    @cached_property
    def verdicts(self) -> dict[tuple[str, str], Verdict]:
        """By case's name and method."""
        return {key: Verdict(cast(Kind, row.verdict), row.figure, row.acceptable) for key, row in self.rows.items()}

    def count(self, method: str, kind: Kind) -> int:
        """How many of a method's verdicts are of one kind."""
        return sum(self.verdicts[case.name, method].kind == kind for case in self.cases)

    @property
    def minutes(self) -> float:
        """How long all answers took together, by the clock."""
        return sum(row.seconds for row in self.rows.values()) / 60.0

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


def result(cases: Sequence[HardCase], methods: Sequence[str], cells: Iterable[Cell]) -> Result:
    """Decide all cells: each is compared with the best answer of all."""
    placed = {(cell.case.name, cell.method): cell for cell in cells}
    best = _known(placed.values()) | {case.name: case.best for case in cases if case.best is not None}
    keys = [(case.name, method) for case in cases for method in methods]
    return Result(tuple(cases), tuple(methods), {key: _row(placed[key], best.get(key[0])) for key in keys})


def _row(cell: Cell, best: float | None) -> StabilityRow:
    case, answer = cell.case, cell.answer
    verdict = decide(case, answer, cell.judged, best)
    return filled(
        StabilityRow, verdict, answer, cell.judged, case=case.name, method=cell.method, verdict=verdict.kind,
        best=math.nan if best is None else best, frames=len(answer.postures),
        sentence=answer.refusal or answer.message,
    )  # fmt: skip


def _known(cells: Iterable[Cell]) -> dict[str, float]:
    """Least goal error of each case's answers with which nothing is wrong, by the case's name [m, rad]."""
    found: dict[str, float] = {}
    for cell in cells:
        kind = decide(cell.case, cell.answer, cell.judged).kind
        if kind in ("solved", "honest") and cell.judged.penetration <= INSIDE:
            name = cell.case.name
            found[name] = min(found.get(name, math.inf), cell.judged.goal_error)
    return found
