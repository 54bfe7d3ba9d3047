"""`wholebody bench leaderboard`: a page from a folder of answers."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import Commands

DESCRIPTION = """\
Judge every file of answers in a folder, and write a page that compares them: tables, charts and sentences that say who
solves most, and who cannot be told apart."""


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = commands.add_parser("leaderboard", help="a page from a folder of answers", description=DESCRIPTION)
    parser.add_argument("folder", type=Path, metavar="DIR", help="with a file of answers for each method")
    parser.add_argument("--problems", type=Path, required=True, metavar="DIR", help="folder of the exported problems")
    parser.add_argument("--out", type=Path, default=Path("out/leaderboard"), metavar="DIR", help="for the page")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Judge and compare."""
    from wholebody.bench.published.leaderboard import PAGE, judge_folder, publish, summary

    found = publish(judge_folder(arguments.folder, arguments.problems), arguments.problems, arguments.out)
    for name, leading in summary(found).items():
        print(f"{name}: {leading}")
    print(f"wrote {arguments.out / PAGE}")
    return 0
