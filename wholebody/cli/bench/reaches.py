"""`wholebody bench reaches`: random reaches whose answer is known to exist."""

from __future__ import annotations

import argparse
from functools import partial

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import Chart, check_count, measuring, publish


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "reaches",
        help="random reaches whose answer is known to exist",
        description="Solve random reaches from standing; list everything that was not solved.",
    )
    parser.add_argument("--count", type=int, default=200, metavar="N", help="how many (default: 200)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="seed of the first one (default: 0)")
    parser.add_argument(
        "--methods", nargs="+", default=["qp"], metavar="NAME", help="such as qp, qp/osqp, newton (default: qp)"
    )
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes (default: 1, for steady times)")


def run(arguments: argparse.Namespace) -> int:
    """Measure random reaches."""
    from wholebody.bench.adapters import adapters
    from wholebody.bench.machine import machine
    from wholebody.bench.reaches import reach_times, reaches_report, run

    count = 10 if arguments.quick else arguments.count
    check_count(count, "--count")
    check_count(arguments.jobs, "--jobs")
    methods = [adapter.name for adapter in adapters(arguments.methods)]
    facts = machine() | {"processes": str(arguments.jobs)}
    rows = []
    for method in methods:
        for row in run(range(arguments.first, arguments.first + count), method, arguments.jobs):
            rows.append(row)
            if row.status != "solved":
                print(f"seed {row.seed}, {method}: {row.status}; {row.how}")
    report = reaches_report(rows, facts, arguments.jobs)
    charts = {"reaches": Chart(partial(reach_times, rows), "Share of the reaches solved within a time")}
    publish("reaches", report, arguments, facts=facts, tables={"reaches": rows}, charts=charts)
    return 0
