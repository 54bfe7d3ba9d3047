"""`wholebody bench newton`: sparse Newton by size, shape and factorisation."""

from __future__ import annotations

import argparse

from wholebody.cli.bench.publishing import add_common, check_count, publish


def add_to(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "newton",
        help="sparse Newton by size, shape and factorisation",
        description="Chains, trees, rings and stars by every factorisation, the paper's size, and drags of the human.",
    )
    parser.add_argument("--repeats", type=int, default=15, metavar="N", help="timed systems each (default: 15)")
    parser.set_defaults(run=run)
    add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Measure sparse Newton."""
    from wholebody.bench import newton
    from wholebody.bench.machine import machine
    from wholebody.bench.tables import write_rows

    repeats, sizes, frames = (3, (10, 30), 20) if arguments.quick else (arguments.repeats, newton.SIZES, 1000)
    check_count(repeats, "--repeats")
    facts = machine()
    solves, drift = [newton.paper_row(10 * repeats)], []
    for contacts in (False, True):
        row, worst = newton.drag_row(frames, contacts)
        solves.append(row)
        drift.append(worst)
    linear = list(newton.linear_rows(sizes, repeats))
    write_rows(arguments.out / "newton-linear.csv", facts, linear)
    write_rows(arguments.out / "newton-solves.csv", facts, solves)
    publish("newton", newton.report(linear, solves, drift, facts), {}, {}, arguments)
    return 0
