"""`wholebody bench scaling`: time against joints, pieces and things."""

from __future__ import annotations

import argparse
from functools import partial

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import Chart, check_count, measuring, publish
from wholebody.errors import UnknownNameError

CAPTION = "Time of a solve, of a step, of the judgement and of the building of the geometry, as one size grows"


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "scaling",
        help="time of a step and a solve against joints, pieces and things, with exponents",
        description="Chains of 5 to 200 joints (500 bodies without a model of joints), 1 to 32 pieces a segment, 10 to "
        "5000 things around, and the exponents with which times grow.",
    )
    parser.add_argument("--repeats", type=int, default=5, metavar="N", help="timed solves each (default: 5)")
    parser.add_argument("--methods", nargs="+", metavar="NAME", help="methods (default: qp newton ccd placo)")


def run(arguments: argparse.Namespace) -> int:
    """Measure, fit, draw."""
    from wholebody.bench import scaling
    from wholebody.bench.machine import machine

    check_count(arguments.repeats, "--repeats")
    methods = tuple(arguments.methods or scaling.METHODS)
    for name in methods:
        if name not in scaling.METHODS:
            raise UnknownNameError("method", name, scaling.METHODS, "--methods")
    repeats = 2 if arguments.quick else arguments.repeats
    sizes = scaling.QUICK if arguments.quick else scaling.SIZES
    lines: list[str] = []

    def say(line: str) -> None:
        lines.append(line)
        print(line, flush=True)

    facts = machine()
    rows = list(scaling.rows(sizes, methods, repeats, say))
    if "newton" in methods:
        bodies = sizes["joints"] if arguments.quick else scaling.ASSEMBLIES
        rows += scaling.assembly_rows(bodies, repeats)
    charts = {"scaling": Chart(partial(scaling.chart, rows), CAPTION)}
    left_out = [line for line in lines if "left out" in line]
    report = scaling.report(rows, left_out, facts)
    publish("scaling", report, arguments, facts=facts, tables={"scaling": rows}, charts=charts)
    return 0
