"""`wholebody bench newton`: sparse Newton by size, shape and factorisation."""

from __future__ import annotations

import argparse

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import add_common, check_count, publish


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "newton",
        help="sparse Newton by size, shape and factorisation",
        description="Chains, trees, rings and stars by every factorisation, whole solves, loops beside open chains, "
        "the same problems by qp, and drags of the human. Set OMP_NUM_THREADS=1: small products are slower on more.",
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
    many = 10 * repeats
    paper = [newton.paper_row(many), newton.drag_of_assembly_row(many)]
    solves = [*paper, newton.nearest_row(many), *newton.loop_rows(many)]
    agreements = newton.agreement_rows(many)
    drags = [newton.drag_row(frames, contacts) for contacts in (False, True)]
    linear = list(newton.linear_rows(sizes, repeats))
    write_rows(arguments.out / "newton-linear.csv", facts, linear)
    write_rows(arguments.out / "newton-solves.csv", facts, solves)
    write_rows(arguments.out / "newton-agreements.csv", facts, agreements)
    write_rows(arguments.out / "newton-drags.csv", facts, drags)
    publish("newton", newton.report(linear, solves, agreements, drags, facts), {}, {}, arguments)
    return 0
