"""What a case of the attack is: it follows from a seed and a number alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

Outcome = Literal["right", "refused", "gave up", "wrong"]

CORPUS = Path(__file__).parent / "corpus"
"""Small files of every kind that people give to the package, each right as it stands, and calls that are right."""

PATTERN = (
    ("file", "solve", "file", "argument") * 4
    + ("file", "sweep", "file", "solve") * 3
    + ("file", "solve", "file", "stream") * 2
    + ("file", "solve", "file", "contact")
    + ("file", "own-term", "file", "pairs")
    + ("file", "sleeper", "file", "weights")
    + ("file", "put")
)
"""Kinds of cases in turn: two mutated files for each solve."""
KINDS = tuple(dict.fromkeys(PATTERN))


class Verdict(NamedTuple):
    """What came of a case.

    `outcome`: "refused" where an input was refused by one sentence, "gave up" where an answer says that it is none
    although there is one; `words` in one line; `seconds` of the processor; `status` that the answer gives itself.
    """

    outcome: Outcome
    words: str
    seconds: float = 0.0
    status: str = ""


class Case(NamedTuple):
    """One case, by the seed of the attack, its number and its kind."""

    seed: int
    number: int
    kind: str

    def rng(self) -> np.random.Generator:
        """Return a generator that depends on the case alone."""
        return np.random.default_rng([self.seed, self.number, KINDS.index(self.kind)])

    @property
    def name(self) -> str:
        """Name of the folder in which a failure is written."""
        return f"{self.kind}-{self.seed}-{self.number:06d}"


def chosen(rng: np.random.Generator, choices: Sequence[Any]) -> Any:
    """Return one of some choices."""
    return choices[int(rng.integers(len(choices)))]


def kind_of(number: int) -> str:
    """Return the kind of a case of an attack on everything."""
    return PATTERN[number % len(PATTERN)]
