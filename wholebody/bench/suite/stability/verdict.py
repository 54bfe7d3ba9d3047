"""Decides what answers are worth, by rules, in order: solved, an honest best effort, a clear refusal, or WRONG."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from wholebody.bench import plot_style
from wholebody.bench.rows import Figure, Row
from wholebody.bench.suite.stability.asking import INSIDE, Cell, Judged
from wholebody.bench.suite.stability.catalogue import Answer, HardCase, Kind
from wholebody.bench.tables import render

BROKEN = 1e-4  # m, rad: farther than this a constraint does not hold

SYMBOLS: dict[Kind, str] = {"solved": "✓", "honest": "○", "refusal": "–", "wrong": "✗"}
WORDS: dict[Kind, str] = {
    "solved": "solved",
    "honest": "honest best effort",
    "refusal": "clear refusal",
    "wrong": "WRONG",
}


class Verdict(NamedTuple):
    """The verdict on one method's answer to one case, and its worst figure."""

    kind: Kind
    figure: str
    acceptable: bool

    @property
    def symbol(self) -> str:
        """One sign: an honest answer that is as good as can be is a full circle."""
        return "●" if self.kind == "honest" and self.acceptable else SYMBOLS[self.kind]


def decide(case: HardCase, answer: Answer, judged: Judged, best: float | None = None) -> Verdict:
    """The verdict on an answer and what it measures; `best`: least goal error of any method [m, rad]."""
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
        # A shorter refusal says nothing.
        return "" if len(answer.refusal) >= 15 else f"refuses with {answer.refusal!r} only"
    if case.expected == "refusal":
        return "answers"
    if not judged.finite:
        return "NaN"
    if judged.limit_violation > 1e-6:  # rad, m: farther than this is out of limits
        return f"{judged.limit_violation:.2g} rad out of limits"
    if judged.passed:
        return f"{length(judged.dip)} inside on the way: {judged.passed}"
    return _missed(case, answer, judged)


def _missed(case: HardCase, answer: Answer, judged: Judged) -> str:
    """What lengths tell: overlap, constraints, speed, and what the method says of them."""
    doubts = answer.status in ("infeasible", "stalled")  # statuses that say that something may be violated
    allowed = judged.start_penetration + INSIDE if doubts else INSIDE
    if judged.penetration > allowed:
        return f"{length(judged.penetration)} inside{_said(answer)}"
    if judged.constraint_violation > BROKEN and (case.can_hold or not doubts):
        return f"a constraint missed by {length(judged.constraint_violation)} (or mrad){_said(answer)}"
    # Rounding, and steps along curves, make a joint faster than its bound by less than 1 %.
    if judged.speed_excess > 0.01:
        return f"{1.0 + judged.speed_excess:.1f} times too fast"
    if answer.status == "solved" and judged.goal_error > case.tolerance:
        return f"claims solved, {length(judged.goal_error)} left"
    if judged.misreported > case.tolerance:
        return f"misreports its residual by {length(judged.misreported)}"
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
    # An answer within 20 µm of the best known one is as good.
    return "best known" if miss <= 2e-5 else f"+{length(miss)}"


def length(metres: float) -> str:
    """A length with the unit that suits it: "1.2 m", "34 mm", "5 µm"."""
    if metres >= 0.995:
        return f"{metres:.3g} m"
    return f"{1e3 * metres:.3g} mm" if metres >= 1e-4 else f"{1e6 * metres:.2g} µm"


@dataclass(frozen=True)
class Result:
    """All cells with their verdicts by case's name and method, and as rows with figures."""

    cases: tuple[HardCase, ...]
    methods: tuple[str, ...]
    verdicts: Mapping[tuple[str, str], Verdict]
    rows: tuple[Row, ...]

    def count(self, method: str, kind: Kind) -> int:
        """How many of a method's verdicts are of one kind."""
        return sum(self.verdicts[case.name, method].kind == kind for case in self.cases)

    @property
    def minutes(self) -> float:
        """How long all answers took together, by the clock."""
        return float(sum(row["seconds"] for row in self.rows)) / 60.0

    def acceptable(self, method: str) -> int:
        """How many of a method's answers are acceptable."""
        return sum(self.verdicts[case.name, method].acceptable for case in self.cases)

    def short_of_best(self, case: HardCase) -> list[tuple[str, list[str]]]:
        """Answers to a case that neither solve it nor are as good as can be: signs with figures, and their methods."""
        found: dict[str, list[str]] = {}
        for method in self.methods:
            verdict = self.verdicts[case.name, method]
            if verdict.symbol not in ("✓", "●"):
                found.setdefault(f"{verdict.symbol} {verdict.figure}".strip(), []).append(method)
        return list(found.items())


def result(cases: Sequence[HardCase], methods: Sequence[str], cells: Iterable[Cell]) -> Result:
    """Decide all cells: each is compared with the best answer of all."""
    placed = {(cell.case.name, cell.method): cell for cell in cells}
    best = _known(placed.values()) | {case.name: case.best for case in cases if case.best is not None}
    keys = [(case.name, method) for case in cases for method in methods]
    verdicts, rows = {}, []
    for key in keys:
        cell, known = placed[key], best.get(key[0])
        verdicts[key] = decide(cell.case, cell.answer, cell.judged, known)
        rows.append(_row(cell, verdicts[key], math.nan if known is None else known))
    return Result(tuple(cases), tuple(methods), verdicts, tuple(rows))


def _row(cell: Cell, verdict: Verdict, best: float) -> Row:
    answer, judged = cell.answer, cell.judged
    figures: dict[str, Figure] = {
        "verdict": verdict.kind,
        "acceptable": verdict.acceptable,
        "figure": verdict.figure,
        "status": answer.status,
        "goal error": judged.goal_error,
        "best known": best,
        "penetration": judged.penetration,
        "limit violation": judged.limit_violation,
        "constraint violation": judged.constraint_violation,
        "frames": len(answer.postures),
        "seconds": answer.seconds,
        "sentence": answer.refusal or answer.message,
    }
    return Row(cell.case.name, cell.method, figures)


def _known(cells: Iterable[Cell]) -> dict[str, float]:
    """Least goal error of each case's answers with which nothing is wrong, by the case's name [m, rad]."""
    found: dict[str, float] = {}
    for cell in cells:
        kind = decide(cell.case, cell.answer, cell.judged).kind
        if kind in ("solved", "honest") and cell.judged.penetration <= INSIDE:
            name = cell.case.name
            found[name] = min(found.get(name, math.inf), cell.judged.goal_error)
    return found


COLORS = {
    "✓": ("#8fd0b5", "solved"),
    "●": ("#f6ec9c", "honest, as good as can be"),
    "○": ("#fbf7d9", "honest, a better answer exists"),
    "–": ("#d9d9d9", "clear refusal"),
    "✗": ("#e8794a", "WRONG"),
}
"""Told apart by people with any colour vision, and by their signs in print."""


def report(result: Result, facts: Mapping[str, str]) -> str:
    """The counts, and every case in words with the answers that fall short."""
    return render("stability.md", result=result, kinds=WORDS, facts=facts)


def matrix(result: Result, path: Path) -> tuple[Path, Path]:
    """Draw all verdicts; return the paths of the SVG and the PNG."""
    width = max(8.0, 3.1 + 0.6 * len(result.methods))
    chart, axes = plot_style.figure(1, 1, (width, 1.5 + 0.22 * len(result.cases)))
    axis = axes[0][0]
    for row, case in enumerate(result.cases):
        for column, method in enumerate(result.methods):
            _cell(axis, row, column, result.verdicts[case.name, method].symbol)
    axis.set(xlim=(-0.5, len(result.methods) - 0.5), ylim=(len(result.cases) - 0.5, -0.5))
    axis.set_xticks(range(len(result.methods)), [name.replace("/", "\n") for name in result.methods], fontsize=8.5)
    axis.xaxis.tick_top()
    axis.set_yticks(range(len(result.cases)), [case.title for case in result.cases], fontsize=8.5)
    axis.tick_params(length=0)
    axis.grid(visible=False)
    for side in axis.spines.values():
        side.set_visible(False)
    from matplotlib.patches import Patch

    handles = [Patch(facecolor=color, label=f"{symbol}  {words}") for symbol, (color, words) in COLORS.items()]
    chart.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=8.5)
    return plot_style.save(chart, path)


def _cell(axis: Any, row: int, column: int, symbol: str) -> None:
    from matplotlib.patches import Rectangle

    axis.add_patch(Rectangle((column - 0.48, row - 0.45), 0.96, 0.9, facecolor=COLORS[symbol][0], edgecolor="none"))
    weight = "bold" if symbol == "✗" else "normal"
    axis.text(column, row, symbol, fontsize=8, ha="center", va="center", color="#111111", fontweight=weight)
