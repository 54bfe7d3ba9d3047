"""What is said between a comparison and the process in which methods run: requests, and bytes with their length."""

from __future__ import annotations

import struct
from typing import IO, NamedTuple

from wholebody.bench.entrants.base import Budget, Entrant
from wholebody.bench.problem_sets.case import ProblemSet

HEAD = struct.Struct(">Q")


class Build(NamedTuple):
    """Request to build a case; the answer is None, or what went wrong."""

    family: ProblemSet
    number: int
    seed: int


class Warm(NamedTuple):
    """Request to let a method import and compile what it needs, if it has not yet; the answer is None."""

    entrant: Entrant
    cap: float


class Solve(NamedTuple):
    """Request to solve the case that was built last; the answer is a `Record`."""

    entrant: Entrant
    level: Budget
    cap: float


class Draw(NamedTuple):
    """Request to draw two answers to the case that was built last; the answer is the HTML of a page."""

    good: Entrant
    bad: Entrant
    cap: float


def send(stream: IO[bytes], message: bytes) -> None:
    """Write one message."""
    stream.write(HEAD.pack(len(message)) + message)
    stream.flush()


def receive(stream: IO[bytes]) -> bytes | None:
    """Read one message; None where the other side is gone."""
    head = stream.read(HEAD.size)
    if len(head) < HEAD.size:
        return None
    (size,) = HEAD.unpack(head)
    body = stream.read(size)
    return body if len(body) == size else None
