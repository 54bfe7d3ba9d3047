"""All hard cases by name, in the order of reports."""

from __future__ import annotations

from collections.abc import Iterable

from wholebody.base.errors import UnknownNameError
from wholebody.bench.suite.stability import equations, posed, streams
from wholebody.bench.suite.stability.case import HardCase

GROUPS = (
    posed.SINGULAR, posed.OUT_OF_REACH, posed.STARTS, posed.CONTACT, equations.LOOPS, equations.NUMBERS,
    streams.STREAMS,
)  # fmt: skip
_CASES: tuple[HardCase, ...] = tuple(case for group in GROUPS for case in group.cases)

QUICK = (
    "collinear-start", "goal-at-shoulder", "out-by-1-mm", "inside-obstacle", "start-5-cm-inside", "cancelling-normals",
    "redundant-loop", "not-a-number", "thin-plate", "goal-jumps-1-m",
)  # fmt: skip
"""A few of every kind, for a short run."""


def names() -> tuple[str, ...]:
    """Names of all cases."""
    return tuple(case.name for case in _CASES)


def cases(chosen: Iterable[str] | None = None, where: str = "") -> tuple[HardCase, ...]:
    """The cases of these names, in the order of reports; all of them where None. `where` is for the message.

    Raises:
        UnknownNameError: there is no such case.
    """
    if chosen is None:
        return _CASES
    wanted = tuple(chosen)
    for name in wanted:
        if name not in names():
            raise UnknownNameError("case", name, names(), where)
    return tuple(case for case in _CASES if case.name in wanted)
