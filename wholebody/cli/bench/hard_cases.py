"""`wholebody bench stability`: named hard cases by every method."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING

from wholebody.bench.tables import machine
from wholebody.cli.bench.command import Chart, listed, measuring, publish
from wholebody.cli.command import count

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wholebody.bench.suite.adapters.base import Adapter
    from wholebody.bench.suite.stability.asking import Cell
    from wholebody.bench.suite.stability.catalogue import HardCase


@measuring(
    "stability",
    "hard cases by methods: where each fails, and how",
    "Ask every method every hard case, each in a process of its own, and judge the answers: solved, an "
    "honest best effort, a clear refusal, or WRONG.",
    listed("--methods", "methods, such as qp, newton or qp/daqp; all for every one (default: one of each algorithm)"),
    listed("--cases", "cases (default: all; with --quick a few)"),
    count("--jobs", 1, "processes at a time"),
)
def stability(arguments: argparse.Namespace) -> None:
    """Ask, judge, and write it down; 0 whatever the verdicts are."""
    from wholebody.bench.suite.adapters.registry import adapters, installed
    from wholebody.bench.suite.stability import catalogue
    from wholebody.bench.suite.stability.verdict import matrix, report, result

    # One or two of each algorithm, for a chart that can be read; others are asked by name.
    usual = ("qp", "qp/osqp", "newton/slack", "newton/barrier", "ccd", "dls", "placo", "pink", "mink")
    asked = adapters(arguments.methods or [name for name in usual if installed(name)])
    chosen = catalogue.cases(arguments.cases or (catalogue.quick() if arguments.quick else None))
    facts, cells = machine(), _asked([(case, adapter) for case in chosen for adapter in asked], arguments.jobs)
    found = result(chosen, [adapter.name for adapter in asked], cells)
    text = report(found, facts)
    charts = {"stability": Chart(partial(matrix, found), "Cases by methods: a colour and a sign a cell")}
    tables = {"stability": found.rows}
    publish("stability", text, arguments, facts=facts, tables=tables, charts=charts, page="where-methods-fail.md")


def _asked(pairs: Sequence[tuple[HardCase, Adapter]], jobs: int) -> list[Cell]:
    from wholebody.bench.suite.stability.asking import run
    from wholebody.cli.tables import bar

    cells = []
    with bar("asking", len(pairs), thread=False) as tell:
        for cell in run(pairs, jobs):
            cells.append(cell)
            tell(len(cells), f"{cell.case.name}, {cell.method}")
    return cells
