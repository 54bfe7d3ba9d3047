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
    """At most one case a set, where a method is farthest from an answer; another method each time, if there is one."""
    shown: list[Shown] = []
    for family in results.sets:
        found = _candidates(results, family)
        if found and len(shown) < most:
            seen = [one.bad for one in shown]
            shown.append(min(found, key=lambda pair: (seen.count(pair[1].bad), -pair[0]))[1])
    return shown


def _candidates(results: Results, family: str) -> list[tuple[float, Shown]]:
    """For every method that fails, how far it is from an answer where it is farthest, and that case."""
    if results.moving(family):
        return []
    good = _by_number(results, family, OURS) or _by_number(results, family, _most_successful(results, family))
    found = []
    for other in results.adapters:
        failing = [
            (_size(bad), Shown(family, number, good[number].method, other, _about(good[number], bad)))
            for number, bad in _by_number(results, family, other).items()
            if bad.answered and not bad.success(COARSE) and number in good and good[number].success(COARSE)
        ]
        found += [max(failing, key=lambda pair: pair[0])] if failing else []
    return found


def _size(record: Record) -> float:
    return min(max(record.penetration, record.missed), 1.0) + (1.0 if record.status == "solved" else 0.0)


def _about(good: Record, bad: Record) -> str:
    claim = f"says {bad.status!r}" if bad.status else "answers"
    faults = []
    if bad.missed > COARSE:
        faults.append(f"misses the goals by {1e3 * bad.missed:.0f} mm or mrad")
    if bad.penetration > COARSE:
        faults.append(f"is {1e3 * bad.penetration:.0f} mm inside of something")
    elif bad.broken > COARSE:
        faults.append(f"breaks what must hold by {1e3 * bad.broken:.1f} mm or mrad")
    return f"{good.method} solves it in {1e3 * good.seconds:.0f} ms; {bad.method} {claim} and {' and '.join(faults)}."


def _by_number(results: Results, family: str, adapter: str) -> dict[int, Record]:
    return {record.number: record for record in results.taken(family, adapter)}


def _most_successful(results: Results, family: str) -> str:
    def solved(adapter: str) -> int:
        return sum(record.success(COARSE) for record in results.default(family, adapter))

    return max(results.adapters, key=solved)
