"""Methods ranked set by set, with what cannot be told apart said to be so; and whether the seeds of a set matter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

from wholebody.bench.statistics import LEAST, LEVEL, Ranking, ranking, same_share
from wholebody.bench.suite.compare.record import COARSE
from wholebody.bench.suite.compare.results import Results
from wholebody.bench.suite.compare.settings import SEEDS


class SetRanking(NamedTuple):
    """The ranking of one set by time; a problem that is not solved takes infinitely long.

    Attributes:
        set: name.
        ranking: None where fewer than three methods share five problems.
        left_out: methods that took too few of the problems that the others took.
    """

    set: str
    ranking: Ranking | None
    left_out: tuple[str, ...]


def rankings(results: Results) -> list[SetRanking]:
    """One ranking a set, over the problems that all ranked methods took."""
    return [_ranked(results, family) for family in results.sets]


def _ranked(results: Results, family: str) -> SetRanking:
    costs = {
        adapter: {
            record.number: getattr(record, results.clock) if record.success(COARSE) else inf
            for record in results.taken(family, adapter)
        }
        for adapter in results.adapters
    }
    most = max((len(cost) for cost in costs.values()), default=0)
    ranked = {name: cost for name, cost in costs.items() if len(cost) >= max(LEAST, 0.5 * most)}
    left_out = tuple(name for name, cost in costs.items() if cost and name not in ranked)
    common = sorted(set.intersection(*(set(cost) for cost in ranked.values()))) if ranked else []
    found = ranking({name: [cost[number] for number in common] for name, cost in ranked.items()})
    return SetRanking(family, found, left_out)


@dataclass(frozen=True)
class SeedShares:
    """A method in a set, by the seed that problems were made from.

    Attributes:
        shares: solved and taken, for each seed.
        p_value: that the shares are one and the same.
        differs: whether they are not, by Holm's correction (1979) for all rows together.
    """

    set: str
    method: str
    shares: tuple[tuple[int, int], ...]
    p_value: float
    differs: bool

    @property
    def spread(self) -> float:
        """Greatest difference between the shares of two seeds; 0 where a seed has too few problems to tell."""
        known = [won / of for won, of in self.shares if of >= LEAST]
        return max(known) - min(known) if len(known) == len(self.shares) else 0.0

    def in_words(self, title: str) -> str:
        """The shares of each seed."""
        return f"`{self.method}` in {title} ({', '.join(f'{won} of {of}' for won, of in self.shares)})"


def sensitivity(results: Results) -> list[SeedShares]:
    """Whether what a method solves depends on the seed, for every method in every set of which it took something."""
    found = []
    for family in results.sets:
        for adapter in results.adapters:
            taken = results.taken(family, adapter)
            if not taken:
                continue
            groups = [[record for record in taken if record.number % SEEDS == place] for place in range(SEEDS)]
            shares = tuple((sum(record.success(COARSE) for record in group), len(group)) for group in groups)
            found.append(SeedShares(family, adapter, shares, same_share(shares), False))
    differing = _holm([row.p_value for row in found])
    return [replace(row, differs=differs) for row, differs in zip(found, differing, strict=True)]


def _holm(p_values: Sequence[float]) -> list[bool]:
    """Which of several hypotheses are rejected at 5 % together."""
    order = sorted(range(len(p_values)), key=lambda place: p_values[place])
    rejected = [False] * len(p_values)
    for rank, place in enumerate(order):
        if p_values[place] > (1.0 - LEVEL) / (len(p_values) - rank):
            break
        rejected[place] = True
    return rejected


def in_words(found: Ranking) -> str:
    """A ranking in one sentence: methods from the best to the worst, with their mean ranks, and who is not apart."""
    listed = ", ".join(f"`{name}` {rank:.1f}" for name, rank in zip(found.methods, found.ranks, strict=True))
    groups = ["`" + "`, `".join(found.methods[first : last + 1]) + "`" for first, last in found.alike]
    if len(groups) == 1 and found.alike[0] == (0, len(found.methods) - 1):
        return f"{listed}. None of them can be told apart."
    apart = f" Not told apart: {'; '.join(groups)}." if groups else " All are told apart."
    return f"{listed}.{apart}"


def seeds_in_words(rows: Sequence[SeedShares], titles: Mapping[str, str]) -> str:
    """Whether the seeds matter, in one or two sentences."""
    said = [f"Every set is made from {SEEDS} seeds in turn."]
    differing = [row.in_words(titles.get(row.set, row.set)) for row in rows if row.differs]
    if differing:
        said.append(f"What is solved depends on the seed for {'; '.join(differing)}.")
    else:
        said.append("No method's share of solved problems differs between the seeds by more than chance.")
    widest = max(rows, key=lambda row: row.spread, default=None)
    if widest and widest.spread > 0.0:
        said.append(f"The widest spread is that of {widest.in_words(titles.get(widest.set, widest.set))}.")
    return " ".join(said)
