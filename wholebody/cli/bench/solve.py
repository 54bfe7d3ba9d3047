"""`wholebody bench solve`: whole solves of a task, and memory."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import check_count, measuring, publish

METHODS = ("qp", "qp/osqp")


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "solve",
        help="whole solves of the shelf task, and memory",
        description="Solve a task with new and with used workspaces, and measure the memory of `wholebody pose`.",
    )
    parser.add_argument("--task", type=Path, metavar="TASK.toml", help="another task (default: the shelf)")
    parser.add_argument("--count", type=int, default=30, metavar="N", help="solves of each kind (default: 30)")
    parser.add_argument(
        "--methods", nargs="+", default=list(METHODS), metavar="NAME", help="such as qp, qp/osqp (default: these two)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Measure whole solves."""
    from wholebody.bench import solve
    from wholebody.bench.adapters import adapters
    from wholebody.bench.machine import machine
    from wholebody.cli.demo import packaged_tasks

    task = arguments.task or packaged_tasks()["shelf"]
    count = 3 if arguments.quick else arguments.count
    check_count(count, "--count")
    facts = machine()
    rows = solve.measured(task, adapters(arguments.methods), count, print)
    peak = solve.memory(task)
    report = solve.solve_report(rows, peak, facts)
    publish("solve", report, arguments, facts=facts, tables={"solve": rows, "memory": [peak]})
    return 0
