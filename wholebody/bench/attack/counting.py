"""Counts of an attack: by kind, with the intervals of what was not seen, and the times of solves."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wholebody.bench.attack.case import Outcome
from wholebody.bench.attack.running import Ended

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
