"""The counts of an attack as text, and its failures as folders with scripts that repeat them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from wholebody.bench.attack.case import KINDS, SCRIPT, Case
from wholebody.bench.attack.counting import SLOW, Row, counted, is_slow, percentiles
from wholebody.bench.attack.running import Ended, put
from wholebody.bench.intervals import wilson
from wholebody.bench.machine import sentence
from wholebody.bench.tables import markdown, write_text

ATTACKED = {
    "solve": "solves, judged by coal over all pairs and by Pinocchio",
    "stream": "streams of moving goals and things, every step and the way between two",
    "sweep": "sweeps against a fine subdivision",
    "file": "mutated tasks, tracks, results, robots and meshes",
    "argument": "calls with odd arguments",
}
INDEX = "README.md"
UNWRITTEN = '''"""A case that cannot be written."""

from wholebody.bench.attack.case import Case, write

write(Case({seed}, {number}, {kind!r}))
'''
_NUMBER = re.compile(r"-?\d+\.?\d*(?:e[-+]?\d+)?")
_QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"|\([^)]*\)")


def report(rows: Sequence[Row], facts: Mapping[str, str]) -> str:
    """Return the counts as Markdown."""
    lines = []
    for kind in KINDS:
        found = counted(rows, kind)
        total = sum(found.values())
        if total:
            most = 100.0 * wilson(found["wrong"], total)[1]
            counts = [str(found[name]) for name in ("right", "refused", "gave up")]
            lines.append([ATTACKED[kind], str(total), *counts, _strong(found["wrong"]), f"{most:.2g} %"])
    head = ["attacked", "cases", "right", "refused", "gave up", "wrong", "wrong at most"]
    parts = [markdown(head, lines)]
    if any(one.kind == "solve" for one in rows):
        parts += [_times(rows), f"Solves that took more than {SLOW:g} s: {_strong(sum(map(is_slow, rows)))}."]
    seeds = ", ".join(str(seed) for seed in sorted({one.seed for one in rows}))
    return "\n\n".join([*parts, f"Seed {seeds}. {sentence(facts)}"])


def _times(rows: Sequence[Row]) -> str:
    statuses: list[str | None] = ["solved", "unreachable", "infeasible", "stalled", None]
    lines = []
    for status in statuses:
        count, middle, high, most = percentiles(rows, status)
        if count:
            times = [f"{1e3 * value:.3g}" for value in (middle, high, most)]
            lines.append([f"`{status}`" if status else "all", str(count), *times])
    return markdown(["solves that end", "count", "p50 [ms]", "p95 [ms]", "longest [ms]"], lines)


def _strong(count: int) -> str:
    return f"**{count}**" if count else "0"


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
    lines = ["# Failures", "", f"Each folder has a {SCRIPT} that repeats its failure: `python FOLDER/{SCRIPT}`.", ""]
    order = sorted(alike.items(), key=lambda item: (list(KINDS).index(item[0][0]), -len(item[1])))
    for (kind, _), found in order:
        lines.append(f"- **{kind}**, {len(found)} times: {found[0].words} ({found[0].seconds:.2f} s)")
        lines += [f"    - {Case(one.seed, one.number, one.kind).name}" for one in found[:5]]
    write_text(folder / INDEX, "\n".join(lines) + "\n")


def signature(words: str) -> str:
    """Return words without their numbers and names, by which alike failures are found."""
    return _NUMBER.sub("#", _QUOTED.sub("...", words.partition(";")[0]))[:120]
