"""What closed the programs of a method, as a table says it: "osqp 1, active set 7"."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping


def said(programs: Mapping[str, int]) -> str:
    """How many programs each closed, most first; empty where there were none."""
    return ", ".join(f"{by} {count}" for by, count in sorted(programs.items(), key=lambda entry: (-entry[1], entry[0])))


def summed(texts: Iterable[str]) -> str:
    """Several of those texts as one."""
    total: Counter[str] = Counter()
    for text in filter(None, texts):
        for part in text.split(", "):
            by, _, count = part.rpartition(" ")
            total[by] += int(count)
    return said(total)
