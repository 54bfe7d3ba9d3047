"""Decides what answers are worth, by rules, in order: solved, an honest best effort, a clear refusal, or WRONG.

All verdicts together are a result, of which everything is drawn and written.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, cast

from wholebody.base.errors import FileFormatError, InputError, UnknownNameError
from wholebody.base.records import with_values
from wholebody.bench.suite.adapters import registry
from wholebody.bench.suite.stability import catalogue
from wholebody.bench.suite.stability.asking import Cell
from wholebody.bench.suite.stability.case import Answer, HardCase, Kind
from wholebody.bench.suite.stability.judging import INSIDE, Judged
from wholebody.bench.tables import filled, read_rows

BEYOND = 1e-6  # rad, m: farther than this is out of limits
BROKEN = 1e-4  # m, rad: farther than this a constraint does not hold
FAST = 0.01  # share by which a joint may be faster than its bound: rounding, and steps along curves
NOT_HELD = ("infeasible", "stalled")  # statuses that say that something may be violated
SAME = 2e-5  # m: nearer to the best known answer than this is as good
LEAST_SENTENCE = 15  # letters of a refusal that says anything

SYMBOLS: dict[Kind, str] = {"solved": "✓", "honest": "○", "refusal": "–", "adapter": "△", "wrong": "✗"}
WORDS: dict[Kind, str] = {
    "solved": "solved",
    "honest": "honest best effort",
    "refusal": "clear refusal",
    "adapter": "our adapter",
    "wrong": "WRONG",
}


_NUMBER = r"[\d.]+(?:e[+-]\d+)?"
_AMOUNT = rf"({_NUMBER} (?:rad|m|mm|µm))"
BRIEF = {
    r"(hangs|crashes): .*": r"\1",
    r"takes .*": "takes it",
    r"refuses with .* only": "unclear",
    r"answers|NaN": r"\g<0>",
    rf"{_AMOUNT} out of limits": r"\1",
    rf"{_AMOUNT} inside on the way: .*": r"\1 way",
    rf"{_AMOUNT} inside, not deeper": r"\1 in",
    rf"{_AMOUNT} inside(, says \w+)?": r"\1",
    rf"a constraint missed by {_AMOUNT} \(or mrad\)(, says \w+)?": r"\1",
    rf"({_NUMBER}) times too fast": r"\1 × speed",
    rf"claims solved, {_AMOUNT} left": r"claims \1",
    rf"misreports what is left by {_AMOUNT}": "misreports",
}
"""How figures are shortened for the cell of a table; any other wrong answer is an error, whatever words it has."""


class Verdict(NamedTuple):
    """What one method's answer to one case is worth.

    Attributes:
        kind: of the five; "adapter" is given by the audit alone, to what would be wrong.
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

    @property
    def brief(self) -> str:
        """The figure for the cell of a table."""
        words = self.figure.partition("; alone")[0]
        for pattern, short in BRIEF.items():
            if found := re.fullmatch(pattern, words, re.DOTALL):
                return found.expand(short)
        return "error" if self.kind in ("wrong", "adapter") else words


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


ALONE: dict[tuple[str, str], str] = {
    ("inside-obstacle", "mink"): "alone, mink stays outside (0 mm inside)",
    ("edge-on-edge", "mink"): "alone, mink stays outside (0 mm inside)",
    ("narrow-passage", "mink"): "alone, mink solves it with a minimum distance of 0.3 mm",
    ("100-m-scale", "mink"): "alone, mink solves it with its distances scaled by 100",
    ("dt-10-ms", "mink"): "alone, mink solves it",
    ("dt-1-s", "mink"): "alone, mink solves it",
    ("100-m-scale", "pink"): "alone, pink solves it",
    (
        "narrow-passage",
        "pink",
    ): "alone, pink solves it with d_min 0.5 mm; our margin of 1 mm is all the room of the slot",
    ("moving-obstacle", "pink"): "alone, pink solves it with its default d_min of 2 cm and 10 steps a frame",
}
"""What a tool does by itself, by case and method: a wrong answer there is its adapter's fault, were there one again."""


def audited(case: str, method: str, verdict: Verdict) -> Verdict:
    """The verdict, but "adapter" in place of "wrong" where the tool alone does better."""
    if verdict.kind != "wrong" or (case, method) not in ALONE:
        return verdict
    return with_values(verdict, kind="adapter", figure=f"{verdict.figure}; {ALONE[case, method]}")


@dataclass(frozen=True)
class StabilityRow:
    """One method's answer to one case; errors in m and rad.

    Attributes:
        verdict: "solved", "honest", "refusal", "adapter" or "wrong".
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
        cells: the same; none where the rows were read from a file.
    """

    cases: tuple[HardCase, ...]
    methods: tuple[str, ...]
    rows: Mapping[tuple[str, str], StabilityRow]
    cells: Mapping[tuple[str, str], Cell] = field(default_factory=dict)

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
    return Result(tuple(cases), tuple(methods), {key: _row(placed[key], best.get(key[0])) for key in keys}, placed)


def read_result(
    path: Path, cases: Iterable[str] | None = None, methods: Iterable[str] | None = None
) -> tuple[Result, dict[str, str]]:
    """Cells of an earlier run, from the file of its rows; and the facts of the machine that it ran on.

    Args:
        path: the file.
        cases: names; None for all that the file has.
        methods: names; None for all that the file has. "all", and the name of a method with several adapters, such as
            "newton", mean those that the file has. Their packages need not be installed.

    Raises:
        FileFormatError: the file is none of such rows, or has none.
        InputError: it lacks a cell.
        UnknownNameError: there is no such case or method.
    """
    facts, read = read_rows(path, StabilityRow)
    if not read:
        raise FileFormatError(f"{path}: has no answers; give the stability.csv of a run")
    rows = {(row.case, row.method): row for row in read}
    asked = tuple(dict.fromkeys(row.method for row in read))
    if methods is not None:
        asked = tuple(dict.fromkeys(each for name in methods for each in _meant(name, asked)))
    if cases is None:
        chosen = catalogue.cases(dict.fromkeys(row.case for row in read), str(path))
    else:
        chosen = catalogue.cases(cases)
    keys = [(case.name, method) for case in chosen for method in asked]
    for case, method in keys:
        if (case, method) not in rows:
            raise InputError(f"{path}: has no answer of {method} to {case}; ask for others, or run it")
    return Result(chosen, asked, {key: rows[key] for key in keys}), facts


def _meant(name: str, known: Sequence[str]) -> Sequence[str]:
    """The methods of a file that a name means; the name itself where the file lacks it."""
    if name == registry.ALL:
        return known
    every = registry.names()
    if name in known or name in every:
        return (name,)
    if name not in {each.partition("/")[0] for each in every}:
        raise UnknownNameError("method", name, {*known, *every, registry.ALL})
    return [each for each in known if each.startswith(f"{name}/")] or (name,)


def _row(cell: Cell, best: float | None) -> StabilityRow:
    case, answer = cell.case, cell.answer
    verdict = judged_verdict(cell, best)
    return filled(
        StabilityRow, verdict, answer, cell.judged, case=case.name, method=cell.method, verdict=verdict.kind,
        best=math.nan if best is None else best, frames=len(answer.postures),
        sentence=answer.refusal or answer.message,
    )  # fmt: skip


def judged_verdict(cell: Cell, best: float | None) -> Verdict:
    """The verdict on a cell as the audit leaves it; `best` is as for `decide`."""
    return audited(cell.case.name, cell.method, decide(cell.case, cell.answer, cell.judged, best))


def _known(cells: Iterable[Cell]) -> dict[str, float]:
    """Least goal error of each case's answers with which nothing is wrong, by the case's name [m, rad]."""
    found: dict[str, float] = {}
    for cell in cells:
        kind = decide(cell.case, cell.answer, cell.judged).kind
        if kind in ("solved", "honest") and cell.judged.penetration <= INSIDE:
            name = cell.case.name
            found[name] = min(found.get(name, math.inf), cell.judged.goal_error)
    return found
