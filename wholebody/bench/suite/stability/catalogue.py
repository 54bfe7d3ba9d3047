"""All hard cases by name, in the order of reports; the modules imported for it have their questions."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from wholebody.base.checks import known
from wholebody.base.files import parsed_toml
from wholebody.bench.suite.stability import posed, streams  # noqa: F401
from wholebody.bench.suite.stability.case import QUESTIONS, HardCase

QUICK = (
    "collinear-start", "goal-at-shoulder", "out-by-1-mm", "inside-obstacle", "start-5-cm-inside", "cancelling-normals",
    "redundant-loop", "not-a-number", "thin-plate", "goal-jumps-1-m",
)  # fmt: skip
"""A few of every kind, for a short run."""


def _read() -> dict[str, HardCase]:
    file, found = Path(__file__).with_name("cases.toml"), {}
    for name, given in parsed_toml(file.read_text("utf-8"), file.name).items():
        best = given.pop("best", 0.0)
        also = tuple(given.pop("also", ()))
        best = None if best == "open" else best
        found[name] = HardCase(name=name, question=QUESTIONS[name], best=best, also=also, **given)
    return found


_CASES = _read()


def names() -> tuple[str, ...]:
    """Names of all cases."""
    return tuple(_CASES)


def cases(chosen: Iterable[str] | None = None, where: str = "") -> tuple[HardCase, ...]:
    """The cases of these names, in the order of reports; all of them where None. `where` is for the message.

    Raises:
        UnknownNameError: there is no such case.
    """
    wanted = _CASES if chosen is None else [known(name, _CASES, "case", where) for name in chosen]
    return tuple(case for name, case in _CASES.items() if name in wanted)
