"""`wholebody bench export`, `answer` and `judge`: problems as files, answers to them, and what answers are worth."""

from __future__ import annotations

import argparse
from itertools import count as count_from
from pathlib import Path

from wholebody.base.errors import InputError
from wholebody.bench.tables import write_text
from wholebody.cli.bench.command import listed, seed
from wholebody.cli.command import command, count, option

PROBLEMS = option("--problems", type=Path, required=True, metavar="DIR", help="folder of the exported problems")


@command(
    "export",
    "the problem sets as files for any program",
    """\
Write the problems of the sets as files that any program reads: JSON with a schema, the body as URDF, meshes as OBJ, two
seeds each (near: the start; far: random), what must hold, and apart from them a posture that solves each, with measures
of how hard it is. The same sets, number and seed give the same files. They are in the public domain (CC0).""",
    option("folder", type=Path, metavar="DIR", help="a folder that does not exist yet"),
    listed("--sets", "problem sets (default: all)"),
    count("--per-set", None, "problems of each set (default: 200)"),
    seed("of all problems"),
)
def export(arguments: argparse.Namespace) -> None:
    """Export."""
    from wholebody.bench.suite.problem_sets.registry import CASES, SETS, problem_set
    from wholebody.bench.suite.published.export import export
    from wholebody.cli.tables import bar

    sets = [problem_set(name) for name in dict.fromkeys(arguments.sets or SETS)]
    per_set = arguments.per_set or CASES
    written = count_from(1)
    with bar("writing", per_set * len(sets)) as tell:
        index = export(sets, per_set, arguments.seed, arguments.folder, lambda name: tell(next(written), name))
    print(f"wrote {per_set * len(sets)} problems, listed in {index}")


@command(
    "answer",
    "answer exported problems by a method",
    """\
Solve the problems that `wholebody bench export` wrote by one method, from both seeds, and write the file of answers
that `wholebody bench judge` scores. What the method refuses is written with its reason.""",
    option("folder", type=Path, metavar="DIR", help="folder of the exported problems"),
    option("--method", default="qp", metavar="NAME", help="such as qp or my_module:MyMethod (default: qp)"),
    listed("--sets", "problem sets (default: all of the export)"),
    option("--out", type=Path, metavar="PATH", help="where the answers are written (default: METHOD.answers.json)"),
)
def answer(arguments: argparse.Namespace) -> None:
    """Answer."""
    from wholebody.base.files import checked_target
    from wholebody.bench.suite.adapters.registry import adapters
    from wholebody.bench.suite.published.problems import Answering, chosen_problems
    from wholebody.bench.suite.published.rebuilt import dumped, files_of
    from wholebody.cli.tables import bar

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


@command(
    "judge",
    "score anybody's answers to published problems",
    """\
Score a file of answers to problems that `wholebody bench export` wrote, whatever program wrote the answers: goals,
overlap of all pairs, clearances, joint limits, what is held, and effort above the best known. The scenes are rebuilt
from the files by Pinocchio and coal alone. Prints a table, and writes every figure as JSON. Answers that are malformed
are refused with one sentence that names the entry. Of a folder with a file of answers for each method it makes a
leaderboard: a page with tables, charts and sentences that say what to choose when, and what cannot be told apart.""",
    option("answers", type=Path, metavar="ANSWERS", help="a file, as answers.schema.json says, or a folder of them"),
    PROBLEMS,
    option(
        "--out",
        type=Path,
        metavar="PATH",
        help="where the verdict is written (default: ANSWERS.verdict.json; of a folder out/leaderboard)",
    ),
)
def judge(arguments: argparse.Namespace) -> None:
    """Judge."""
    if arguments.answers.is_dir():
        return _leaderboard(arguments)
    from rich.table import Table

    from wholebody.base.files import checked_target
    from wholebody.bench.suite.published.answers import read_answers
    from wholebody.bench.suite.published.judging import COLUMNS, as_json, cells, judge, left_out
    from wholebody.bench.suite.published.rebuilt import dumped, files_of
    from wholebody.cli.tables import console

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
    from wholebody.bench.suite.published.leaderboard import PAGE, judge_folder, publish

    out = arguments.out or Path("out/leaderboard")
    for sentence in publish(judge_folder(arguments.answers, arguments.problems), arguments.problems, out):
        print(f"- {sentence.replace('**', '').replace('`', '')}")
    print(f"wrote {out / PAGE}")
