"""`wholebody bench stability` and `attack`: named hard cases by every method, and random ones of every kind."""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from functools import partial

from wholebody.base.checks import number
from wholebody.base.errors import InputError
from wholebody.bench.attack import running
from wholebody.bench.attack.judging import KINDS, Case, kind_of
from wholebody.bench.rows import Row
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.adapters.registry import adapters, installed
from wholebody.bench.suite.stability import catalogue
from wholebody.bench.suite.stability.asking import Cell, run
from wholebody.bench.suite.stability.catalogue import HardCase
from wholebody.bench.suite.stability.verdict import matrix, report, result
from wholebody.bench.tables import machine
from wholebody.cli.bench.command import Chart, publish
from wholebody.cli.bench.measurements import chosen
from wholebody.cli.tables import bar


def stability(arguments: argparse.Namespace) -> None:
    """Ask, judge, and write it down; 0 whatever the verdicts are."""
    # One or two of each algorithm, for a chart that can be read; others are asked by name.
    usual = ("qp", "qp/osqp", "newton/slack", "newton/barrier", "ccd", "dls", "placo", "pink", "mink")
    asked = adapters(arguments.methods or [name for name in usual if installed(name)])
    picked = catalogue.cases(arguments.cases or (catalogue.quick() if arguments.quick else None))
    facts, cells = machine(), _asked([(case, adapter) for case in picked for adapter in asked], arguments.jobs)
    found = result(picked, [adapter.name for adapter in asked], cells)
    text = report(found, facts)
    charts = {"stability": Chart(partial(matrix, found), "Cases by methods: a colour and a sign a cell")}
    tables = {"stability": found.rows}
    publish("stability", text, arguments, facts=facts, tables=tables, charts=charts)


def _asked(pairs: Sequence[tuple[HardCase, Adapter]], jobs: int) -> list[Cell]:
    cells = []
    with bar("asking", len(pairs)) as tell:
        for cell in run(pairs, jobs):
            cells.append(cell)
            tell(len(cells), f"{cell.case.name}, {cell.method}")
    return cells


def attack(arguments: argparse.Namespace) -> int:
    """Attack; 1 where something was wrong."""
    seconds = number(arguments.seconds, "--seconds", 1e-3, 1e9, "s")
    kinds = chosen(arguments.kinds, KINDS, "--kinds")
    cases = (Case(arguments.seed, k, kind) for k in itertools.count(arguments.first) if (kind := kind_of(k)) in kinds)
    asked = itertools.islice(cases, arguments.cases)
    rows: list[Row] = []
    interrupted = False
    try:
        for case, verdict in running.attack(asked, arguments.jobs, running.for_seconds(seconds)):
            rows.append(running.row(case, verdict))
            if rows[-1]["outcome"] == "wrong":
                print(f"WRONG: {case.kind} {case.number}: {rows[-1]['words']}", flush=True)
            elif len(rows) % 200 == 0:
                print(f"{len(rows)} cases, {sum(one['outcome'] == 'wrong' for one in rows)} wrong", flush=True)
            if rows[-1]["outcome"] == "wrong" or running.is_slow(rows[-1]):
                running.keep(case, verdict, arguments.out)
    except KeyboardInterrupt:
        interrupted = True
    if not rows:
        raise InputError("no case ended; give more --seconds")
    rows.sort(key=lambda one: one["number"])
    facts = machine()
    publish("attack", running.report(rows, facts), arguments, facts=facts, tables={"attack": rows})
    return 130 if interrupted else int(any(one["outcome"] == "wrong" for one in rows))  # exit code after Ctrl-C
