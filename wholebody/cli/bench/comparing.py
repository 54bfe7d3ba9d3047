"""`wholebody bench compare`, `reproduce`, `held-out`: every method on every problem set, speed against accuracy."""

from __future__ import annotations

import argparse
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wholebody.base.errors import InputError
from wholebody.bench.machine import machine
from wholebody.bench.tables import write_rows, write_text
from wholebody.cli.bench.command import command, count, folders, listed, measuring, option, publish, quick, seed

if TYPE_CHECKING:
    from wholebody.bench.compare.settings import Settings


@command(
    "compare",
    "every method on every problem set",
    """\
Solve problems with known answers by every method at many budgets, and chart speed against accuracy. Writes a report
(report.html) that says which method to choose when, charts as SVG and PNG, and every solve as CSV. A run that was
ended goes on where it was when it is called again with the same settings and folder; a finished one writes its report
anew. --jobs works on cases beside each other through joblib; --cluster does so on a dask cluster.""",
    quick("20 problems a set, within three minutes on two cores"),
    option(
        "--task", type=Path, metavar="TASK.toml", help="compare on the problem of a task file, in place of the sets"
    ),
    listed("--sets", "problem sets (default: all)"),
    listed(
        "--methods",
        "methods, such as qp, newton or qp/daqp; all for every method (default: one of each algorithm, from one "
        "start and from several; with --quick as they come)",
    ),
    count("--cases", None, "problems of each set (default: 200)"),
    option("--minutes", type=float, metavar="N", help="of solving in all (default: 25; with --quick 2)"),
    seed("of all problems"),
    count("--jobs", None, "cases beside each other (default: 1, or all of the cluster)"),
    option("--cluster", metavar="ADDRESS", help="of a dask scheduler, such as tcp://10.0.0.1:8786"),
    folders("out/compare"),
)
def compare(arguments: argparse.Namespace) -> None:
    """Compare methods."""
    if arguments.task is not None:
        return _compare_on_task(arguments)
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    from wholebody.base.batches import threads
    from wholebody.bench.adapters.registry import missing
    from wholebody.bench.compare import run as comparison
    from wholebody.bench.compare.advice import advice
    from wholebody.bench.compare.report import PAGE, publish

    jobs = arguments.jobs or (threads(arguments.cluster) if arguments.cluster else 1)
    settings = _settings(arguments)
    console = Console()
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TextColumn("left"))
    with Progress(*columns, TimeRemainingColumn(), console=console) as bar:
        task = bar.add_task("starting", total=60.0 * settings.minutes * jobs)

        def tell(progress: comparison.Progress) -> None:
            bar.update(task, completed=progress.done, total=progress.total, description=f"solved {progress.said}")

        store = comparison.run(settings, arguments.out, jobs, arguments.cluster, tell)
        where = f"the dask cluster {arguments.cluster}" if arguments.cluster else "this machine"
        given = publish(
            settings,
            store,
            arguments.out,
            _facts(f"{jobs} on {where}"),
            missing(),
            arguments.update_docs,
            lambda what: bar.update(task, description=f"making {what}"),
        )
        bar.update(task, completed=1.0, total=1.0, description="done")
    for sentence in advice(given.results, given.rows):
        console.print("- " + sentence.replace("**", "").replace("`", ""), highlight=False, markup=False)
    console.print(f"wrote {arguments.out / PAGE}", highlight=False, soft_wrap=True)
    return None


def _facts(beside: str) -> dict[str, str]:
    return machine() | {"date": date.today().isoformat(), "cases beside each other": beside}


def _settings(arguments: argparse.Namespace) -> Settings:
    from wholebody.bench.adapters.registry import adapters
    from wholebody.bench.compare.settings import QUICK, Settings
    from wholebody.bench.problem_sets.registry import CASES, SETS, problem_set

    sets = tuple(problem_set(name) for name in dict.fromkeys(arguments.sets or SETS))
    chosen = None if arguments.methods is None else tuple(dict.fromkeys(arguments.methods))
    amounts: dict[str, Any] = dict(QUICK) if arguments.quick else {"cases": CASES}
    asked = {"cases": arguments.cases, "minutes": arguments.minutes}
    amounts |= {name: amount for name, amount in asked.items() if amount is not None}
    return Settings(sets, adapters(chosen, starts=not arguments.quick), seed=arguments.seed, **amounts)


OF_SETS = ("quick", "sets", "cases", "minutes", "jobs", "cluster", "update_docs")
"""Options that say how much of the sets is compared, or where; a task has one problem and takes none of them."""


def _compare_on_task(arguments: argparse.Namespace) -> None:
    """Compare methods on one's own task."""
    from rich.console import Console
    from rich.markup import escape

    from wholebody.bench.adapters.registry import adapters
    from wholebody.bench.compare import own_task
    from wholebody.cli.tables import table
    from wholebody.taskfile import read_task

    for name in OF_SETS:
        if getattr(arguments, name):
            raise InputError(f"--{name.replace('_', '-')} is of the problem sets; leave it out beside --task")
    console, title = Console(), read_task(arguments.task).title
    chosen = adapters(arguments.methods, starts=True)
    with console.status("solving") as status:
        rows = own_task.compared(arguments.task, chosen, tell=lambda name: status.update(f"solving by {name}"))
    facts, out = machine(), arguments.out
    write_rows(out / "task.csv", facts, rows)
    write_text(out / "task.md", own_task.report(rows, title, facts) + "\n")
    _, png = own_task.chart(rows, title, out / "task")
    made = table("method", "outcome", "warm ms", "cold ms", "goals mm", "overlap mm", "effort", title=title)
    for row in rows:
        figures = (row.warm_ms, row.cold_ms, row.goal_mm, row.overlap_mm, row.effort)
        made.add_row(row.method, row.outcome, *("" if value != value else f"{value:.3g}" for value in figures))
    console.print(made)
    for row in rows:
        if row.outcome in ("refused", "failed", "overtime"):
            console.print(f"{row.method}: {escape(row.said)}", highlight=False)
    for path in (out / "task.md", out / "task.csv", png):
        console.print(f"wrote {path}", highlight=False, soft_wrap=True)


@command(
    "reproduce",
    "a published comparison once more",
    """\
Run a published comparison again, from the lock file that it left: the same sets, seeds, methods and amounts. Says which
figures differ by more than their intervals, and what of the machine and the versions is not the same. Times are
compared in units of a reference kernel. Ends with 1 where what is solved differs.""",
    option("lock", type=Path, metavar="LOCK.json", help="which `wholebody bench compare` left"),
    option("--out", type=Path, default=Path("out/reproduce"), metavar="DIR", help="for the new run"),
    count("--jobs", 1, "cases beside each other"),
)
def reproduce(arguments: argparse.Namespace) -> int:
    """Run and compare."""
    from wholebody.bench.adapters.registry import missing
    from wholebody.bench.compare import run as comparison
    from wholebody.bench.compare.lock import differences, in_words, locked, read_lock, shares
    from wholebody.bench.compare.report import PAGE, publish

    published = read_lock(arguments.lock)
    settings = published.settings()
    store = comparison.run(settings, arguments.out, arguments.jobs, None, lambda progress: print(progress.said))
    facts = _facts(f"{arguments.jobs} on this machine")
    found = locked(publish(settings, store, arguments.out, facts, missing()))
    for line in in_words(published, found):
        print(line)
    print(f"wrote {arguments.out / PAGE}")
    return 1 if shares(differences(published, found)) else 0


@measuring(
    "held-out",
    "distributions that nothing was tuned on, beside the sets",
    """\
Solve problems of distributions that no constant was tuned on: uniform witnesses, other people, other clutter, robots as
they come. The shares stand beside those of the sets that were tuned on, with intervals. A run that was ended goes on
where it was when it is called again with the same settings and folder.""",
    listed("--methods", "methods (default: qp and three peers)"),
    count("--cases", None, "problems of each set (default: 40; with --quick 4)"),
    seed("of all problems"),
    option("--minutes", type=float, metavar="N", help="of solving in all (default: 20)"),
    count("--jobs", 1, "cases beside each other"),
)
def held_out(arguments: argparse.Namespace) -> None:
    """Measure, judge, publish."""
    from wholebody.bench.adapters.registry import adapters, installed
    from wholebody.bench.compare import held_out

    cases = arguments.cases or (4 if arguments.quick else held_out.CASES)
    minutes = held_out.MINUTES if arguments.minutes is None else arguments.minutes
    names = arguments.methods or [name for name in held_out.METHODS if installed(name)]
    asked, left_out = held_out.settings(adapters(names), cases, arguments.seed, minutes)
    if left_out:
        print(left_out)
    folder = arguments.out / "held-out"
    rows = held_out.measured(asked, folder, arguments.jobs, lambda progress: print(progress.said, flush=True))
    facts = _facts(f"{arguments.jobs}")
    report = held_out.report(rows, asked, left_out, facts)
    publish("held-out", report, arguments, facts=facts, tables={"held-out/held_out": rows})
