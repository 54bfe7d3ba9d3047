"""What a case of the attack is: a script with its files, which follow from a seed and a number alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

Outcome = Literal["right", "refused", "gave up", "wrong"]

SCRIPT = "repeat.py"
CORPUS = Path(__file__).parent / "corpus"
"""Small files of every kind that people give to the package, each right as it stands, and calls that are right."""

PATTERN = (
    ("file", "solve", "file", "argument") * 4
    + ("file", "sweep", "file", "solve") * 3
    + ("file", "solve", "file", "stream") * 2
    + ("file", "solve", "file", "argument")
    + ("file", "own term", "file", "solve")
    + ("file", "pairs", "file", "sleeper")
    + ("file", "weights", "file", "put")
    + ("file", "contact")
)
"""Kinds of cases in turn: two mutated files for each solve, as the targets of a long run have it."""
KINDS = tuple(dict.fromkeys(PATTERN))


@dataclass(frozen=True)
class Verdict:
    """What came of a case.

    Attributes:
        outcome: "right"; "refused", where an input was refused by one sentence; "gave up", where an answer says that it
            is none although there is one; "wrong".
        words: what was asked and found, in one line.
        seconds: CPU time of the call under attack.
        status: what the answer says of itself; "" where it says nothing.
    """

    outcome: Outcome
    words: str
    seconds: float = 0.0
    status: str = ""


@dataclass(frozen=True)
class Written:
    """A case as files that repeat it.

    Attributes:
        script: Python; it leaves a `Verdict` in the name `verdict` and prints it.
        files: what the script reads, by names beside it.
    """

    script: str
    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """One case.

    Attributes:
        seed: of the attack.
        number: of the case.
        kind: of what is attacked.
    """

    seed: int
    number: int
    kind: str

    def rng(self) -> np.random.Generator:
        """Return a generator that depends on the case alone."""
        return np.random.default_rng([self.seed, self.number, KINDS.index(self.kind)])

    @property
    def name(self) -> str:
        """Name of the folder in which a failure is written."""
        return f"{'-'.join(self.kind.split())}-{self.seed}-{self.number:06d}"


def kind_of(number: int) -> str:
    """Return the kind of a case of an attack on everything."""
    return PATTERN[number % len(PATTERN)]
