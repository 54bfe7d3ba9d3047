"""`wholebody bench newton`: sparse Newton by size, shape and factorisation."""

from __future__ import annotations

import argparse
from typing import Any

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import check_count, measuring, publish


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "newton",
        help="sparse Newton by size, shape and factorisation",
        description="Chains, trees, rings and stars by every factorisation, whole solves, loops beside open chains, "
        "the same problems by qp, and drags of the human. Set OMP_NUM_THREADS=1: small products are slower on more.",
    )
    parser.add_argument("--repeats", type=int, default=15, metavar="N", help="timed systems each (default: 15)")


def run(arguments: argparse.Namespace) -> int:
    """Measure sparse Newton."""
    from wholebody.bench import newton
    from wholebody.bench.machine import machine

    repeats, sizes, frames = (3, (10, 30), 20) if arguments.quick else (arguments.repeats, newton.SIZES, 1000)
    check_count(repeats, "--repeats")
    facts = machine()
    many = 10 * repeats
    paper = [newton.paper_row(many), newton.drag_of_assembly_row(many)]
    solves = [*paper, newton.nearest_row(many), *newton.loop_rows(many)]
    agreements = newton.agreement_rows(many)
    drags = [newton.drag_row(frames, contacts) for contacts in (False, True)]
    linear = list(newton.linear_rows(sizes, repeats))
    found: dict[str, Any] = {"linear": linear, "solves": solves, "agreements": agreements, "drags": drags}
    tables = {f"newton-{name}": rows for name, rows in found.items()}
    publish("newton", newton.report(**found, facts=facts), arguments, facts=facts, tables=tables)
    return 0
