"""Counts beside those that were locked: how far each may be off, and a sentence for each that is farther."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from tests.audits.regress.selection import Run
from wholebody.base.errors import FileFormatError, one_line
from wholebody.base.files import read_text
from wholebody.base.files import write as write_whole

LOCKED = Path(__file__).with_name("locked.json")
STATUSES = ("solved", "unreachable", "infeasible", "stalled")
"""From the best to the worst."""

Locked = Mapping[str, Mapping[str, int | str]]


class Margin(NamedTuple):
    """How far a count may be above the locked one: the larger of a share of it and a number.

    Attributes:
        what: what is counted, in words.
        share: of the locked count.
        least: that it may be off in any case.
    """

    what: str
    share: float
    least: int


MARGINS = {
    "iterations": Margin("iterations", 0.1, 3),
    "systems": Margin("linear systems", 0.1, 3),
    "structures": Margin("patterns that were laid out", 0.0, 0),
    "passes": Margin("kinematic passes", 0.1, 5),
    "pairs": Margin("pairs that coal was asked for", 0.1, 30),
    "rows": Margin("contact rows", 0.1, 20),
    "inexact": Margin("programs that were not solved exactly", 0.0, 0),
    "asked": Margin("programs that the solver was asked for", 0.1, 3),
    "bytes": Margin("bytes that a step takes for itself", 0.25, 4096),
}
"""Every count but the status. Shares are what the last digits of numbers can change, and some more."""


class Difference(NamedTuple):
    """A count that is not what was locked.

    Attributes:
        sentence: that says so.
        worse: whether it is worse than the locked one.
    """

    sentence: str
    worse: bool


def compared(locked: Locked, runs: Iterable[Run]) -> Iterator[Difference]:
    """What differs by more than its margin, in the order of the runs."""
    seen = set()
    for run in runs:
        seen.add(run.name)
        if run.name not in locked:
            yield Difference(f"{run.name}: is not locked yet; lock it with --update", False)
            continue
        before = locked[run.name]
        for name, count in run.counts.items():
            found = _difference(name, before.get(name), count)
            if found is not None:
                yield Difference(f"{run.name}: {found.sentence}", found.worse)
    for name in locked:
        if name not in seen:
            yield Difference(f"{name}: is locked but was not counted; take it out with --update", True)


def _difference(name: str, before: int | str | None, now: int | str) -> Difference | None:
    if before is None:
        return Difference(f"{name} is {now} and not locked yet; lock it with --update", False)
    if isinstance(before, str) or isinstance(now, str):
        if before == now:
            return None
        ranks = [STATUSES.index(one) if one in STATUSES else len(STATUSES) for one in (str(before), str(now))]
        return Difference(f"its status is {now!r}, which was {before!r}", ranks[1] > ranks[0])
    margin = MARGINS[name]
    allowed = max(margin.share * before, margin.least)
    if abs(now - before) <= allowed:
        return None
    words = f"{margin.what}: {now} in place of {before}, {'more' if now > before else 'fewer'} by {abs(now - before)}"
    return Difference(f"{words} where {allowed:.0f} is allowed", now > before)


def read(path: Path = LOCKED) -> Locked:
    """Read locked counts.

    Raises:
        FileFormatError: the file is not one of locked counts.
    """
    correction = "write it anew with --update"
    try:
        data = json.loads(read_text(path, "locked counts"))
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path}: is not JSON ({one_line(str(error))}); {correction}") from None
    if not isinstance(data, dict) or not all(_is_counts(counts) for counts in data.values()):
        raise FileFormatError(f"{path}: does not hold counts by name; {correction}")
    return data


def _is_counts(counts: object) -> bool:
    return isinstance(counts, dict) and all(isinstance(value, (int, str)) for value in counts.values())


def write(runs: Iterable[Run], path: Path = LOCKED) -> None:
    """Lock the counts of these runs."""
    lines = [f"  {json.dumps(run.name)}: {json.dumps(dict(run.counts))}" for run in runs]
    write_whole(path, "{\n" + ",\n".join(lines) + "\n}\n")
