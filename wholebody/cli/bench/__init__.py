"""The command group `wholebody bench`, one file a command."""

from __future__ import annotations

from wholebody.cli.arguments import Commands
from wholebody.cli.bench import (
    ablation,
    attack,
    challenge,
    compare,
    daily,
    detail,
    export,
    held_out,
    human,
    judge,
    loads,
    motion,
    newton,
    qp,
    reaches,
    regress,
    reproduce,
    robots,
    scaling,
    solve,
    stability,
    step,
    world,
)

HELP = "measure steps, solves and random reaches, beside other tools where installed"
DESCRIPTION = """\
Measure what the package does, and write the numbers as CSV, the charts as SVG and PNG, and tables to read. Times depend
on the machine and on what else runs on it: compare ratios of one run. Set OMP_NUM_THREADS=1 for steady ones."""


def add_to(commands: Commands) -> None:
    """Add the command `bench` with its own commands."""
    parser = commands.add_parser("bench", help=HELP, description=DESCRIPTION)
    kinds = parser.add_subparsers(title="what to measure", metavar="WHAT", required=True)
    for command in (
        compare,
        export,
        judge,
        reproduce,
        held_out,
        step,
        reaches,
        solve,
        newton,
        qp,
        stability,
        challenge,
        detail,
        motion,
        loads,
        scaling,
        robots,
        attack,
        ablation,
        regress,
        world,
        human,
        daily,
    ):
        command.add_to(kinds)
