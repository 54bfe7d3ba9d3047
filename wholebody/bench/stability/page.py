"""The page "Where methods fail": case by case, with pictures, what is asked and what came of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from wholebody.bench.adapters.base import Adapter
from wholebody.bench.report import render
from wholebody.bench.stability.pictures import Drawn
from wholebody.bench.stability.rows import Result
from wholebody.bench.stability.verdict import WORDS

CHART = "stability.svg"


def report(result: Result, facts: Mapping[str, str]) -> str:
    """The result in short: the counts, the cases by methods, and every wrong cell."""
    return render("stability.md", page=False, result=result, kinds=WORDS, facts=facts)


def page(result: Result, adapters: Sequence[Adapter], facts: Mapping[str, str], drawn: Drawn, folder: str) -> str:
    """The section of the page that is written by the command.

    Args:
        result: all cells.
        adapters: who was asked.
        facts: of the machine.
        drawn: pictures by case.
        folder: of the pictures, relative to the page.
    """
    return render(
        "stability.md", page=True, result=result, kinds=WORDS, facts=facts, adapters=adapters, drawn=drawn,
        folder=folder, chart=CHART,
    )  # fmt: skip
