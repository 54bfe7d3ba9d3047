"""`wholebody bench ablation`: counts of work, which no clock disturbs."""

from __future__ import annotations

import argparse

from wholebody.bench.tables import machine
from wholebody.cli.bench.command import measuring, publish
from wholebody.cli.command import count, option


@measuring(
    "ablation",
    "what each constant and mechanism of a method is worth, in counts",
    "Change one constant or switch one mechanism off at a time, and count answers that differ.",
    option("--method", default="qp", choices=("qp", "newton", "ccd"), help="(default: qp)"),
    count("--count", None, "problems of every set (default: 6, 1 with --quick)"),
)
def ablation(arguments: argparse.Namespace) -> None:
    """Measure and report."""
    from wholebody.bench.suite import ablation

    method, facts = arguments.method, machine()
    given = ablation.problems(arguments.count or (1 if arguments.quick else 6), method)
    whole, rows = ablation.ablation(method, given, ablation.mechanisms(method), print)
    text = ablation.report(method, len(given), whole, rows, ablation.constants(method)[1], facts)
    name = f"ablation-{method}"
    publish(name, text, arguments, facts=facts, tables={name: rows})
