"""`wholebody bench compare`: every method on every problem set, speed against accuracy."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wholebody.cli.arguments import Commands, add_folders
from wholebody.cli.bench.publishing import check_count
from wholebody.errors import InputError

if TYPE_CHECKING:
    from wholebody.bench.compare.settings import Settings

DESCRIPTION = """\
Solve problems with known answers by every method at many budgets, and chart speed against accuracy. Writes a report
(report.html) that says which method to choose when, charts as SVG and PNG, and every solve as CSV. A run that was
ended goes on where it was when it is called again with the same settings and folder; a finished one writes its report
anew. --jobs works on cases beside each other through joblib; --cluster does so on a dask cluster."""


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = commands.add_parser("compare", help="every method on every problem set", description=DESCRIPTION)
    parser.add_argument("--quick", action="store_true", help="20 problems a set, within three minutes on two cores")
    parser.add_argument(
        "--task", type=Path, metavar="TASK.toml", help="compare on the problem of a task file, in place of the sets"
    )
    parser.add_argument("--sets", nargs="+", metavar="NAME", help="problem sets (default: all)")
    parser.add_argument(
        "--methods", nargs="+", metavar="NAME",
        help="methods, such as qp, newton or qp/daqp; all for every entrant (default: one of each algorithm, from one "
        "start and from several; with --quick as they come)",
    )  # fmt: skip
    parser.add_argument("--cases", type=int, metavar="N", help="problems of each set (default: 200)")
    parser.add_argument("--minutes", type=float, metavar="N", help="of solving in all (default: 25; with --quick 2)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all problems (default: 0)")
    parser.add_argument(
        "--jobs", type=int, metavar="N", help="cases beside each other (default: 1, or all of the cluster)"
    )
    parser.add_argument("--cluster", metavar="ADDRESS", help="of a dask scheduler, such as tcp://10.0.0.1:8786")
    add_folders(parser, "out/compare")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Compare methods."""
    if arguments.task is not None:
        return _run_task(arguments)
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    from wholebody.bench.adapters import missing
    from wholebody.bench.compare import run as comparison
    from wholebody.bench.compare.advice import advice
    from wholebody.bench.compare.report import PAGE, publish

    jobs = _jobs(arguments)
    settings = _settings(arguments)
    console = Console()
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TextColumn("left"))
    with Progress(*columns, TimeRemainingColumn(), console=console) as bar:
        task = bar.add_task("starting", total=60.0 * settings.minutes * jobs)

        def tell(progress: comparison.Progress) -> None:
            bar.update(task, completed=progress.done, total=progress.total, description=f"solved {progress.said}")

        store = comparison.run(settings, arguments.out, jobs, arguments.cluster, tell)
        given = publish(
            settings,
            store,
            arguments.out,
            _facts(jobs, arguments.cluster),
            missing(),
            arguments.update_docs,
            lambda what: bar.update(task, description=f"making {what}"),
        )
        bar.update(task, completed=1.0, total=1.0, description="done")
    for sentence in advice(given.results, given.rows):
        console.print("- " + sentence.replace("**", "").replace("`", ""), highlight=False, markup=False)
    console.print(f"wrote {arguments.out / PAGE}", highlight=False, soft_wrap=True)
    return 0


OF_SETS = ("quick", "sets", "cases", "minutes", "jobs", "cluster", "update_docs")
"""Options that say how much of the sets is compared, or where; a task has one problem and takes none of them."""


def _run_task(arguments: argparse.Namespace) -> int:
    """Compare methods on one's own task; 0 whatever solves it."""
    from rich.console import Console
    from rich.markup import escape

    from wholebody.bench.adapters import adapters
    from wholebody.bench.compare import own_task
    from wholebody.bench.machine import machine
    from wholebody.bench.tables import write_rows, write_text
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
    return 0


def _settings(arguments: argparse.Namespace) -> Settings:
    from wholebody.bench.adapters import adapters
    from wholebody.bench.compare.settings import QUICK, Settings
    from wholebody.bench.problem_sets.registry import CASES, SETS, problem_set

    sets = tuple(problem_set(name) for name in dict.fromkeys(arguments.sets or SETS))
    chosen = None if arguments.methods is None else tuple(dict.fromkeys(arguments.methods))
    amounts: dict[str, Any] = dict(QUICK) if arguments.quick else {"cases": CASES}
    if arguments.cases is not None:
        check_count(arguments.cases, "--cases")
        amounts["cases"] = arguments.cases
    if arguments.minutes is not None:
        amounts["minutes"] = arguments.minutes
    return Settings(sets, adapters(chosen, starts=not arguments.quick), seed=arguments.seed, **amounts)


def _jobs(arguments: argparse.Namespace) -> int:
    from wholebody.batches import threads

    if arguments.jobs is None:
        return threads(arguments.cluster) if arguments.cluster else 1
    check_count(arguments.jobs, "--jobs")
    return int(arguments.jobs)


def _facts(jobs: int, cluster: str | None) -> dict[str, str]:
    from datetime import date

    from wholebody.bench.machine import machine

    where = f"the dask cluster {cluster}" if cluster else "this machine"
    return machine() | {"date": date.today().isoformat(), "cases beside each other": f"{jobs} on {where}"}
