"""Which cases are worth looking at, and their scenes: what the dependable method found, and where another failed."""

from __future__ import annotations

from typing import NamedTuple

from wholebody.bench.compare.front import OURS
from wholebody.bench.compare.record import COARSE, Record
from wholebody.bench.compare.results import Results

SCENES = 6  # in a report; each is a hundred kilobytes or two


class Shown(NamedTuple):
    """A case to show.

    Attributes:
        set, number: which case.
        good, bad: methods whose answers are shown: the first solves it; the second does not, or is only slower.
        about: why it was chosen, in a sentence.
    """

    set: str
    number: int
    good: str
    bad: str
    about: str


def chosen(results: Results, most: int = SCENES) -> list[Shown]:
    """At most one case a set, those first in which a method is farthest from an answer."""
    found = [shown for family in results.sets if (shown := _of(results, family)) is not None]
    return [shown for _, shown in sorted(found, key=lambda pair: -pair[0])[:most]]


def _of(results: Results, family: str) -> tuple[float, Shown] | None:
    if results.moving(family):
        return None
    good = _by_number(results, family, OURS) or _by_number(results, family, _most_successful(results, family))
    best: tuple[float, Shown] | None = None
    for other in results.entrants:
        for number, bad in _by_number(results, family, other).items():
            if number not in good or not good[number].success(COARSE) or not bad.answered or bad.success(COARSE):
                continue
            size = min(max(bad.penetration, bad.missed), 1.0) + (1.0 if bad.status == "solved" else 0.0)
            if best is None or size > best[0]:
                best = (size, Shown(family, number, good[number].entrant, other, _about(good[number], bad)))
    return best


def _about(good: Record, bad: Record) -> str:
    claim = f"claims {bad.status!r}" if bad.status else "answers"
    faults = []
    if bad.missed > COARSE:
        faults.append(f"misses the goals by {1e3 * bad.missed:.0f} mm or mrad")
    if bad.penetration > COARSE:
        faults.append(f"is {1e3 * bad.penetration:.0f} mm inside of something")
    elif bad.broken > COARSE:
        faults.append(f"breaks what must hold by {1e3 * bad.broken:.1f} mm or mrad")
    return f"{good.entrant} solves it in {1e3 * good.seconds:.0f} ms; {bad.entrant} {claim} and {' and '.join(faults)}."


def _by_number(results: Results, family: str, entrant: str) -> dict[int, Record]:
    return {record.number: record for record in results.taken(family, entrant)}


def _most_successful(results: Results, family: str) -> str:
    def solved(entrant: str) -> int:
        return sum(record.success(COARSE) for record in results.default(family, entrant))

    return max(results.entrants, key=solved)
