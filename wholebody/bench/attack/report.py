"""The counts of an attack, as rows and as text, and its failures as folders with scripts that repeat them."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wholebody.bench.attack.case import KINDS, SCRIPT, Case, Outcome
from wholebody.bench.attack.running import Ended, put
from wholebody.bench.report import render
from wholebody.bench.statistics import wilson
from wholebody.bench.tables import write_text

ATTACKED = {
    "solve": "solves, judged by coal over all pairs and by Pinocchio",
    "weights": "goals of one frame with weights from 1 to 1e6, met as soon as with equal ones",
    "put": "things that are put into a figure that is shown, every frame free or told",
    "stream": "streams of moving goals and things, every step and the way between two",
    "sweep": "sweeps against a fine subdivision",
    "pairs": "things in each other, against every two pieces",
    "sleeper": "sleeping bodies whose support creeps, turns, jumps or leaves",
    "contact": "contacts, against the effort of a point or frame at the place found",
    "file": "mutated tasks, tracks, results, robots and meshes",
    "argument": "calls with odd arguments",
    "own term": "solves and steps with terms of one's own that are not finite, or answer something odd",
}
INDEX = "README.md"
UNWRITTEN = '''"""A case that cannot be written."""

from wholebody.bench.attack.case import Case
from wholebody.bench.attack.running import write

write(Case({seed}, {number}, {kind!r}))
'''
_NUMBER = re.compile(r"-?\d+\.?\d*(?:e[-+]?\d+)?")
_QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"|\([^)]*\)")


def report(rows: Sequence[Row], facts: Mapping[str, str]) -> str:
    """Return the counts as Markdown."""
    kinds = []
    for kind in KINDS:
        found = counted(rows, kind)
        if found.total():
            kinds.append((ATTACKED[kind], found, wilson(found["wrong"], found.total())[1]))
    statuses: list[str | None] = ["solved", "unreachable", "infeasible", "stalled", None]
    solves = [(status, count, times) for status in statuses for count, *times in [percentiles(rows, status)] if count]
    asked = any(one.kind == "solve" for one in rows)
    return render(
        "attack.md", kinds=kinds, asked=asked, solves=solves, slow=SLOW, late=sum(map(is_slow, rows)),
        seeds=sorted({one.seed for one in rows}), facts=facts,
    )  # fmt: skip


def keep(ended: Ended, folder: Path) -> None:
    """Write a failure: the script that repeats it, what the script reads, and what was found."""
    place = folder / ended.case.name
    if ended.written is None:
        write_text(place / SCRIPT, _unwritten(ended.case))
    else:
        put(ended.written, place)
    write_text(place / "found.txt", ended.verdict.words + "\n")


def _unwritten(case: Case) -> str:
    return UNWRITTEN.format(seed=case.seed, number=case.number, kind=case.kind)


def index(rows: Sequence[Row], folder: Path) -> None:
    """Write the list of failures, alike ones together, the most frequent kind of wrong answers first."""
    alike: dict[tuple[str, str], list[Row]] = {}
    for one in rows:
        late = is_slow(one) and one.outcome != "wrong"
        if one.outcome == "wrong" or late:
            alike.setdefault((one.kind, f"slow: {one.status}" if late else signature(one.words)), []).append(one)
    order = sorted(alike.items(), key=lambda item: (list(KINDS).index(item[0][0]), -len(item[1])))
    listed = [
        (kind, found, [Case(one.seed, one.number, one.kind).name for one in found[:5]]) for (kind, _), found in order
    ]
    write_text(folder / INDEX, render("attack_failures.md", script=SCRIPT, alike=listed) + "\n")


def signature(words: str) -> str:
    """Return words without their numbers and names, by which alike failures are found."""
    return _NUMBER.sub("#", _QUOTED.sub("...", words.partition(";")[0]))[:120]


SLOW = 5.0  # s: of CPU time for a solve


@dataclass(frozen=True)
class Row:
    """One case, as it is written down.

    Attributes:
        kind, seed, number: which case.
        outcome: what came of it.
        status: what the answer says of itself.
        seconds: CPU time of the call under attack.
        words: what was found.
    """

    kind: str
    seed: int
    number: int
    outcome: str
    status: str
    seconds: float
    words: str


def row(ended: Ended) -> Row:
    """Return the line of a case."""
    case, verdict = ended.case, ended.verdict
    words = " ".join(verdict.words.split()).encode("ascii", errors="backslashreplace").decode()
    return Row(case.kind, case.seed, case.number, verdict.outcome, verdict.status, verdict.seconds, words)


def counted(rows: Sequence[Row], kind: str) -> Counter[Outcome]:
    """Return how many cases of a kind came to what."""
    return Counter(one.outcome for one in rows if one.kind == kind)  # type: ignore[misc]


def is_slow(one: Row) -> bool:
    """Whether a solve took longer than `SLOW`."""
    return one.kind == "solve" and one.seconds > SLOW


def percentiles(rows: Sequence[Row], status: str | None = None) -> tuple[int, float, float, float]:
    """Return how many solves there are with a status (None for any), and their p50, p95 and longest, seconds."""
    times = [one.seconds for one in rows if one.kind == "solve" and one.status and status in (None, one.status)]
    if not times:
        return 0, math.nan, math.nan, math.nan
    return len(times), float(np.median(times)), float(np.quantile(times, 0.95)), max(times)
