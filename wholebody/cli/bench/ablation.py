"""`wholebody bench ablation`: what each constant and mechanism of a method is worth."""

from __future__ import annotations

import argparse

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import check_count, measuring, publish


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "ablation",
        help="what each constant and mechanism of a method is worth, in counts",
        description="Change one constant or switch one mechanism off at a time, and count answers that differ.",
    )
    parser.add_argument("--method", default="qp", choices=("qp", "newton", "ccd"), help="(default: qp)")
    parser.add_argument("--count", type=int, default=6, metavar="N", help="problems of every set (default: 6)")


def run(arguments: argparse.Namespace) -> int:
    """Measure and report."""
    from wholebody.bench import ablation
    from wholebody.bench.machine import machine

    count = 1 if arguments.quick else arguments.count
    check_count(count, "--count")
    given = ablation.problems(count, arguments.method)
    named = ablation.mechanisms(arguments.method)
    whole, rows = ablation.ablation(arguments.method, given, named, print)
    compiled = ablation.constants(arguments.method)[1]
    text = ablation.report(arguments.method, len(given), whole, rows, compiled)
    name = f"ablation-{arguments.method}"
    publish(name, text, arguments, facts=machine(), tables={name: rows})
    return 0
