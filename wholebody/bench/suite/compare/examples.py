"""The hardest problem that a method solved and the easiest that it failed, by a difficulty that favours no method."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

from wholebody.bench.suite.compare.record import COARSE, Difficulty, Record
from wholebody.bench.suite.compare.results import Results
from wholebody.bench.suite.compare.store import Chunk


@dataclass(frozen=True)
class Example:
    """A problem that a method solved, or failed.

    Attributes:
        record: what came of it.
        difficulty: how hard it is.
        solving, asked: methods that solve it, of those that were asked it and did not refuse.
    """

    record: Record
    difficulty: Difficulty
    solving: int
    asked: int

    @property
    def solved(self) -> bool:
        """Whether the method solved it."""
        return self.record.success(COARSE)

    @property
    def about(self) -> str:
        """What came of it and how hard it is, in a sentence."""
        mine, hard = self.record, self.difficulty
        came = f"solves problem {mine.number} in {1e3 * mine.seconds:.3g} ms"
        if not self.solved:
            came = f"fails problem {mine.number}: it {fault(mine)}"
        descent = f"{'not' if hard.resists else 'also'} by a plain Gauss-Newton descent"
        return (
            f"{mine.method} {came}; the witness is {hard.distance:.1f} rad from the start, and the problem is solved "
            f"by {self.solving} of {self.asked} methods and {descent}."
        )


class Pair(NamedTuple):
    """Of one method in one set: the hardest problem that it solved and the easiest that it failed; None without one."""

    hardest: Example | None
    easiest: Example | None


def pairs(results: Results, chunks: Sequence[Chunk]) -> dict[tuple[str, str], Pair]:
    """The pair of every method in every set, by the names of set and method."""
    known = {(chunk.set, chunk.number): chunk.difficulty for chunk in chunks if chunk.difficulty is not None}
    found = {}
    for family in results.sets:
        taken = {name: results.taken(family, name) for name in results.adapters}
        asked = Counter(one.number for records in taken.values() for one in records)
        solving = Counter(one.number for records in taken.values() for one in records if one.success(COARSE))
        for name, records in taken.items():
            examples = [
                Example(one, known[family, one.number], solving[one.number], asked[one.number])
                for one in records
                if (family, one.number) in known
            ]
            found[family, name] = Pair(
                max((one for one in examples if one.solved), key=attrgetter("difficulty"), default=None),
                min((one for one in examples if not one.solved), key=attrgetter("difficulty"), default=None),
            )
    return found


def resisting(chunks: Sequence[Chunk]) -> Mapping[str, tuple[int, int]]:
    """Problems that the plain descent does not solve, and all whose difficulty is known, by the name of the set."""
    known = [(chunk.set, chunk.difficulty) for chunk in chunks if chunk.difficulty is not None]
    return {
        family: (sum(hard.resists for name, hard in known if name == family), sum(name == family for name, _ in known))
        for family in dict.fromkeys(name for name, _ in known)
    }


def fault(record: Record) -> str:
    """What is wrong with an answer that solves nothing, in words that follow "it"."""
    if not record.answered:
        return f"gives no answer ({record.said or record.outcome})"
    faults = []
    if record.missed > COARSE:
        faults.append(f"misses the goals by {_amount(record.missed)}")
    if record.penetration > COARSE:
        faults.append(f"is {1e3 * record.penetration:.0f} mm inside of something")
    elif record.broken > COARSE:
        faults.append(f"breaks what must hold by {_amount(record.broken)}")
    claim = f"says {record.status!r}, " if record.status else ""
    return claim + " and ".join(faults)


def _amount(value: float) -> str:
    return f"{1e3 * value:.2g} mm or mrad" if value < 0.1 else f"{value:.2g} m or rad"
