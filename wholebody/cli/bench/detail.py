"""`wholebody bench detail`: what each level of modelling costs, and what it gets wrong."""

from __future__ import annotations

import argparse
from functools import partial

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import Chart, check_count, measuring, publish

CAPTION = "Time of a solve against what each level gets wrong, judged in the finest model"


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "detail",
        help="spheres, capsules, hulls; all joints and pairs or those that matter: time against error",
        description="The same tasks with every detail of geometry, with all joints and pairs and with those that a "
        "task needs; answers judged in the model of hulls with everything in it.",
    )
    parser.add_argument("--cases", type=int, default=8, metavar="N", help="cases of each task (default: 8)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the cases (default: 0)")


def run(arguments: argparse.Namespace) -> int:
    """Measure, judge, draw."""
    from wholebody.bench import detail
    from wholebody.bench.machine import machine

    check_count(arguments.cases, "--cases")
    cases = 2 if arguments.quick else arguments.cases
    facts = machine()
    rows, refused = [], []
    for row in detail.rows(cases, arguments.seed):
        if isinstance(row, str):
            refused.append(row)
            print(row, flush=True)
        else:
            rows.append(row)
    charts = {"detail": Chart(partial(detail.chart, rows), CAPTION)}
    report = detail.report(rows, refused, facts)
    publish("detail", report, arguments, facts=facts, tables={"detail": rows}, charts=charts)
    return 0
