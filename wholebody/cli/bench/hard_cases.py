"""`wholebody bench stability` and `attack`: named hard cases by every method, and random ones of every kind."""

from __future__ import annotations

import argparse
import itertools
from functools import partial
from typing import TYPE_CHECKING

from wholebody.base.checks import number
from wholebody.base.errors import InputError
from wholebody.bench.tables import machine
from wholebody.cli.bench.command import Chart, folders, listed, measuring, publish, seed
from wholebody.cli.bench.measuring import chosen
from wholebody.cli.command import command, count, option

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wholebody.bench.suite.adapters.base import Adapter
    from wholebody.bench.suite.stability.asking import Cell
    from wholebody.bench.suite.stability.catalogue import HardCase


@measuring(
    "stability",
    "hard cases by methods: where each fails, and how",
    "Ask every method every hard case, in processes that may crash, and judge the answers: solved, an "
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
    picked = catalogue.cases(arguments.cases or (catalogue.quick() if arguments.quick else None))
    facts, cells = machine(), _asked([(case, adapter) for case in picked for adapter in asked], arguments.jobs)
    found = result(picked, [adapter.name for adapter in asked], cells)
    text = report(found, facts)
    charts = {"stability": Chart(partial(matrix, found), "Cases by methods: a colour and a sign a cell")}
    tables = {"stability": found.rows}
    publish("stability", text, arguments, facts=facts, tables=tables, charts=charts, page="where-methods-fail.md")


def _asked(pairs: Sequence[tuple[HardCase, Adapter]], jobs: int) -> list[Cell]:
    from wholebody.bench.suite.stability.asking import run
    from wholebody.cli.tables import bar

    cells = []
    with bar("asking", len(pairs)) as tell:
        for cell in run(pairs, jobs):
            cells.append(cell)
            tell(len(cells), f"{cell.case.name}, {cell.method}")
    return cells


@command(
    "attack",
    "random hard cases of every kind, judged",
    """\
Attack the package with random hard cases: solves that begin inside things, with goals that contradict or are out of
reach; streams; sweeps; contacts beside points at the place found; mutated files. Answers are judged by coal over all
pairs and by Pinocchio alone. Every failure is written as a script that repeats it. Case K of a seed is
always the same. The exit code is 1 where something was wrong: a false claim, an error other than one sentence, a crash,
or no end within a minute. What ended before Ctrl-C is written.""",
    option("--seconds", type=float, default=60.0, metavar="S", help="how long (default: 60)"),
    seed("of all cases"),
    count("--first", 0, "number of the first case", least=0),
    count("--cases", None, "end after as many cases, if the time suffices"),
    listed("--kinds", "of cases, such as solve, stream, own-term, sleeper, file (default: all)", "KIND"),
    count("--jobs", 1, "processes at a time"),
    *folders("out/attack"),
)
def attack(arguments: argparse.Namespace) -> int:
    """Attack; 1 where something was wrong."""
    from wholebody.bench.attack import running
    from wholebody.bench.attack.judging import KINDS, Case, kind_of
    from wholebody.bench.rows import Row

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
    text, page = running.report(rows, facts), "where-methods-fail.md"
    publish("attack", text, arguments, facts=facts, tables={"attack": rows}, page=page)
    return 130 if interrupted else int(any(one["outcome"] == "wrong" for one in rows))  # exit code after Ctrl-C
