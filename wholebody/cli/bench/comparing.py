"""`wholebody bench compare`: every method on every problem set, speed against accuracy."""

from __future__ import annotations

import argparse
from typing import Any

from rich.console import Console

from wholebody.base.errors import InputError
from wholebody.bench.rows import chart
from wholebody.bench.suite.adapters.registry import adapters, missing
from wholebody.bench.suite.compare import own_task
from wholebody.bench.suite.compare import run as comparison
from wholebody.bench.suite.compare.lock import differences, in_words, locked, read_lock, shares
from wholebody.bench.suite.compare.report import PAGE, publish
from wholebody.bench.suite.compare.run import QUICK, Settings
from wholebody.bench.suite.compare.summary import advice
from wholebody.bench.suite.problem_sets.registry import CASES, SETS, problem_set
from wholebody.bench.tables import machine, write_rows, write_text
from wholebody.cli.tables import bar, print_rows
from wholebody.taskfile import read_task


def compare(arguments: argparse.Namespace) -> int:
    """Compare methods; 1 where a comparison that is repeated solves other problems."""
    if arguments.task is not None:
        return _compare_on_task(arguments)
    if arguments.again is not None:
        return _again(arguments)
    jobs = arguments.at_once
    settings = _settings(arguments)
    with bar("starting") as tell:
        store = comparison.run(
            settings, arguments.out, jobs, arguments.cluster,
            lambda now: tell(now.done / now.total, f"solved {now.said}"),
        )  # fmt: skip
        where = f"the dask cluster {arguments.cluster}" if arguments.cluster else "this machine"
        given = publish(
            settings, store, arguments.out, _facts(f"{jobs} on {where}"), missing(),
            lambda what: tell(1.0, f"making {what}"),
        )  # fmt: skip
    for sentence in advice(given.results, given.rows):
        print("- " + sentence.replace("**", "").replace("`", ""))
    print(f"wrote {arguments.out / PAGE}")
    return 0


def _facts(beside: str) -> dict[str, str]:
    return machine() | {"cases beside each other": beside}


def _settings(arguments: argparse.Namespace) -> Settings:
    sets = tuple(problem_set(name) for name in dict.fromkeys(arguments.sets or SETS))
    chosen = None if arguments.methods is None else tuple(dict.fromkeys(arguments.methods))
    amounts: dict[str, Any] = dict(QUICK) if arguments.quick else {"cases": CASES}
    asked = {"cases": arguments.cases, "minutes": arguments.minutes}
    amounts |= {name: amount for name, amount in asked.items() if amount is not None}
    return Settings(sets, adapters(chosen, starts=not arguments.quick), seed=arguments.seed, **amounts)


def _alone(arguments: argparse.Namespace, flag: str, others: tuple[str, ...]) -> None:
    """Raise InputError where an option stands beside another that it excludes."""
    for name in others:
        if getattr(arguments, name):
            raise InputError(f"--{name.replace('_', '-')} does not go with --{flag.replace('_', '-')}; leave one out")


OF_A_LOCK = ("quick", "sets", "methods", "cases", "minutes", "seed", "cluster")
"""Options that a repeated comparison reads from its lock file, or does not have."""

OF_SETS = ("quick", "sets", "cases", "minutes", "jobs", "cluster", "again")
"""Options that say how much of the sets is compared, or where; a task has one problem and takes none of them."""


def _compare_on_task(arguments: argparse.Namespace) -> int:
    _alone(arguments, "task", OF_SETS)
    title = read_task(arguments.task).title
    chosen = adapters(arguments.methods, starts=True)
    with Console().status("solving") as status:
        rows = own_task.compared(arguments.task, chosen, tell=lambda name: status.update(f"solving by {name}"))
    facts, out = machine(), arguments.out
    write_rows(out / "task.csv", facts, rows)
    write_text(out / "task.md", own_task.report(rows, title, facts) + "\n")
    _, png = chart(own_task.panels(rows, title), out / "task")
    print_rows(rows)
    for path in (out / "task.md", out / "task.csv", png):
        print(f"wrote {path}")
    return 0


def _again(arguments: argparse.Namespace) -> int:
    _alone(arguments, "again", OF_A_LOCK)
    published = read_lock(arguments.again)
    settings = published.settings()
    jobs = arguments.at_once
    store = comparison.run(settings, arguments.out, jobs, None, lambda progress: print(progress.said))
    facts = _facts(f"{jobs} on this machine")
    found = locked(publish(settings, store, arguments.out, facts, missing()))
    for line in in_words(published, found):
        print(line)
    print(f"wrote {arguments.out / PAGE}")
    return 1 if shares(differences(published, found)) else 0
