"""The command group `wholebody bench`: a file for the commands of each kind."""

from __future__ import annotations

from typing import Any

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.comparing import compare
from wholebody.cli.bench.counts import ablation
from wholebody.cli.bench.hard_cases import attack, stability
from wholebody.cli.bench.measuring import motion, robots, scaling, solve, step, world
from wholebody.cli.bench.published import export, judge

HELP = "measure steps, solves and random reaches, beside other tools where installed"
DESCRIPTION = """\
Measure what the package does, and write the numbers as CSV, the charts as SVG and PNG, and tables to read. Times depend
on the machine and on what else runs on it: compare ratios of one run. Set OMP_NUM_THREADS=1 for steady ones."""
COMMANDS = (
    compare, export, judge, stability, ablation, step, solve, scaling, motion, world, robots, attack,
)  # fmt: skip


def add_to(commands: Commands) -> None:
    """Add the command `bench` with its own commands."""
    parser = commands.add_parser("bench", help=HELP, description=DESCRIPTION)
    kinds: Any = parser.add_subparsers(title="what to measure", metavar="WHAT", required=True)
    for command in COMMANDS:
        command.add_to(kinds)
