"""`wholebody bench judge`: score anybody's answers to the published problems."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import Commands

DESCRIPTION = """\
Score a file of answers to problems that `wholebody bench export` wrote, whatever program wrote the answers: goals,
overlap of all pairs, clearances, joint limits, what is held, and effort above the best known. The scenes are rebuilt
from the files by Pinocchio and coal alone. Prints a table, and writes every figure as JSON. Answers that are malformed
are refused with one sentence that names the entry."""

WIDTH = 230  # columns of the table, also where the terminal has fewer


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = commands.add_parser("judge", help="score anybody's answers to published problems", description=DESCRIPTION)
    parser.add_argument("answers", type=Path, metavar="ANSWERS.json", help="as answers.schema.json says")
    parser.add_argument("--problems", type=Path, required=True, metavar="DIR", help="folder of the exported problems")
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="where the verdict is written (default: ANSWERS.verdict.json)"
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Judge."""
    from rich.console import Console
    from rich.table import Table

    from wholebody.bench.published.answers import read_answers
    from wholebody.bench.published.judging import as_json, judge
    from wholebody.bench.published.reading import dumped
    from wholebody.bench.published.words import COLUMNS, cells, left_out
    from wholebody.bench.tables import write_text

    verdict = judge(read_answers(arguments.answers, arguments.problems), arguments.problems)
    out = arguments.out or arguments.answers.with_suffix(".verdict.json")
    write_text(out, dumped(as_json(verdict)))
    console = Console()
    console.width = max(console.width, WIDTH)
    table = Table(title=verdict.answers.method)
    for name in COLUMNS:
        table.add_column(name, justify="left" if name in COLUMNS[:2] else "right")
    for row in verdict.sets:
        table.add_row(*cells(row))
    console.print(table)
    for line in left_out(verdict):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    console.print(f"wrote {out}", highlight=False, soft_wrap=True)
    return 0
