"""`wholebody bench judge` and `leaderboard`: score anybody's answers to the published problems, and compare them."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import Commands

OF_JUDGE = """\
Score a file of answers to problems that `wholebody bench export` wrote, whatever program wrote the answers: goals,
overlap of all pairs, clearances, joint limits, what is held, and effort above the best known. The scenes are rebuilt
from the files by Pinocchio and coal alone. Prints a table, and writes every figure as JSON. Answers that are malformed
are refused with one sentence that names the entry."""

OF_LEADERBOARD = """\
Judge every file of answers in a folder, and write a page that compares them: tables, charts and sentences that say who
solves most, and who cannot be told apart."""

WIDTH = 230  # columns of the table, also where the terminal has fewer


def add_to(commands: Commands) -> None:
    """Add both commands."""
    parser = commands.add_parser("judge", help="score anybody's answers to published problems", description=OF_JUDGE)
    parser.add_argument("answers", type=Path, metavar="ANSWERS.json", help="as answers.schema.json says")
    parser.add_argument("--problems", type=Path, required=True, metavar="DIR", help="folder of the exported problems")
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="where the verdict is written (default: ANSWERS.verdict.json)"
    )
    parser.set_defaults(run=run_judge)

    parser = commands.add_parser("leaderboard", help="a page from a folder of answers", description=OF_LEADERBOARD)
    parser.add_argument("folder", type=Path, metavar="DIR", help="with a file of answers for each method")
    parser.add_argument("--problems", type=Path, required=True, metavar="DIR", help="folder of the exported problems")
    parser.add_argument("--out", type=Path, default=Path("out/leaderboard"), metavar="DIR", help="for the page")
    parser.set_defaults(run=run_leaderboard)


def run_judge(arguments: argparse.Namespace) -> int:
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


def run_leaderboard(arguments: argparse.Namespace) -> int:
    """Judge and compare."""
    from wholebody.bench.published.leaderboard import PAGE, judge_folder, publish, summary

    found = publish(judge_folder(arguments.folder, arguments.problems), arguments.problems, arguments.out)
    for name, leading in summary(found).items():
        print(f"{name}: {leading}")
    print(f"wrote {arguments.out / PAGE}")
    return 0
