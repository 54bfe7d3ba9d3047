"""The counts of an attack, as rows and as text, and its failures as folders with scripts that repeat them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wholebody.bench.attack.case import KINDS, Case, Verdict
from wholebody.bench.report import render
from wholebody.bench.rows import Row, texts, times
from wholebody.bench.rows import report as tables_of
from wholebody.bench.statistics import wilson
from wholebody.bench.tables import write_text


def row(case: Case, verdict: Verdict) -> Row:
    """Return the row of a case; "seconds" are of the processor, of the call under attack."""
    words = " ".join(verdict.words.split()).encode("ascii", errors="backslashreplace").decode()
    figures = {"seed": case.seed, "number": case.number, "outcome": verdict.outcome, "status": verdict.status or "none"}
    return Row(case.name, case.kind, {**figures, "seconds": verdict.seconds, "words": words or "nothing"})


def is_slow(row: Row) -> bool:
    """Whether it is a solve that took longer than 5 s."""
    return row.tool == "solve" and bool(row["seconds"] > 5.0)


def report(rows: Sequence[Row], facts: dict[str, str]) -> str:
    """Return the counts as Markdown."""
    counts = []
    for kind in (name for name in KINDS if any(one.tool == name for one in rows)):
        found = Counter(one["outcome"] for one in rows if one.tool == kind)
        outcomes = {name: found[name] for name in ("right", "refused", "gave up", "wrong")}
        most = 100.0 * wilson(found["wrong"], found.total())[1]
        counts.append(
            Row(texts()["attacked"][kind], kind, {"cases": found.total(), **outcomes, "wrong at most %": most})
        )
    spans = []
    for status in ("solved", "unreachable", "infeasible", "stalled"):
        spent = np.array([1e3 * one["seconds"] for one in rows if one.tool == "solve" and one["status"] == status])
        if len(spent):
            figures = {"count": len(spent), **times(spent), "longest ms": float(spent.max())}
            spans.append(Row("solves that end", status, figures))
    seeds = ", ".join(map(str, sorted({one["seed"] for one in rows})))
    notes = [f"Solves that took more than 5 s: {sum(map(is_slow, rows))}.", f"Seed {seeds}."]
    return tables_of("What was attacked:", {"Cases": counts, "Times of solves": spans}, facts, notes)


def keep(case: Case, verdict: Verdict, folder: Path) -> None:
    """Write a failure: the script that repeats it, and what was found."""
    place = folder / case.name
    write_text(place / "repeat.py", render("repeat.py", case=case) + "\n")
    write_text(place / "found.txt", verdict.words + "\n")
