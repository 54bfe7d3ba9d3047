"""`wholebody bench export`, `answer` and `judge`: problems as files, answers to them, and what answers are worth."""

from __future__ import annotations

import argparse
from itertools import count as count_from
from pathlib import Path

from rich.table import Table

from wholebody.base.errors import InputError
from wholebody.base.files import checked_target
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.problem_sets.registry import CASES, SETS, problem_set
from wholebody.bench.suite.published.answers import read_answers
from wholebody.bench.suite.published.export import export
from wholebody.bench.suite.published.judging import COLUMNS, as_json, cells, judge, left_out
from wholebody.bench.suite.published.leaderboard import PAGE, judge_folder, publish
from wholebody.bench.suite.published.problems import Answering, chosen_problems
from wholebody.bench.suite.published.rebuilt import dumped, files_of
from wholebody.bench.tables import write_text
from wholebody.cli.tables import bar, console


def write_problems(arguments: argparse.Namespace) -> None:
    """Export."""
    sets = [problem_set(name) for name in dict.fromkeys(arguments.sets or SETS)]
    per_set = arguments.per_set or CASES
    written = count_from(1)
    with bar("writing", per_set * len(sets)) as tell:
        index = export(sets, per_set, arguments.seed, arguments.folder, lambda name: tell(next(written), name))
    print(f"wrote {per_set * len(sets)} problems, listed in {index}")


def answer(arguments: argparse.Namespace) -> None:
    """Answer."""
    found = adapters([arguments.method], starts=True)
    if len(found) > 1:
        raise InputError(f"--method {arguments.method} is {', '.join(one.name for one in found)}; name one of them")
    out = arguments.out or Path(f"{found[0].name.replace('/', '-').replace(':', '-')}.answers.json")
    checked_target(out, "--out", "a file of answers", (".json",), files_of(arguments.folder))
    problems, answering = chosen_problems(arguments.folder, arguments.sets), Answering(arguments.folder, found[0])
    with bar("solving", len(problems)) as tell:
        for done, (family, number) in enumerate(problems, 1):
            answering.answer(family, number)
            tell(done, f"{family} {number}")
    write_text(out, dumped(answering.content()))
    print(f"wrote {out}; score it with: wholebody bench judge {out} --problems {arguments.folder}")


def judge_answers(arguments: argparse.Namespace) -> None:
    """Judge."""
    if arguments.answers.is_dir():
        return _leaderboard(arguments)
    out = arguments.out or arguments.answers.with_suffix(".verdict.json")
    checked_target(out, "--out", "a verdict", (".json",), [arguments.answers, *files_of(arguments.problems)])
    verdict = judge(read_answers(arguments.answers, arguments.problems), arguments.problems)
    write_text(out, dumped(as_json(verdict)))
    table = Table(title=verdict.answers.method)
    for name in COLUMNS:
        table.add_column(name, justify="left" if name in COLUMNS[:2] else "right")
    for row in verdict.sets:
        table.add_row(*cells(row))
    console(230).print(table)  # letters of a line, also where the terminal has fewer
    print(*left_out(verdict), f"wrote {out}", sep="\n")
    return None


def _leaderboard(arguments: argparse.Namespace) -> None:
    """Judge every file of answers in a folder, and compare them."""
    out = arguments.out or Path("out/leaderboard")
    for sentence in publish(judge_folder(arguments.answers, arguments.problems), arguments.problems, out):
        print(f"- {sentence.replace('**', '').replace('`', '')}")
    print(f"wrote {out / PAGE}")
