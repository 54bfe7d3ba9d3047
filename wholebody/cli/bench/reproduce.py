"""`wholebody bench reproduce`: a published comparison once more, and what differs."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import Commands

DESCRIPTION = """\
Run a published comparison again, from the lock file that it left: the same sets, seeds, methods and amounts. Says which
figures differ by more than their intervals, and what of the machine and the versions is not the same. Times are
compared in units of a reference kernel. Ends with 1 where what is solved differs."""


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = commands.add_parser("reproduce", help="a published comparison once more", description=DESCRIPTION)
    parser.add_argument("lock", type=Path, metavar="LOCK.json", help="which `wholebody bench compare` left")
    parser.add_argument("--out", type=Path, default=Path("out/reproduce"), metavar="DIR", help="for the new run")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="cases beside each other (default: 1)")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run and compare."""
    from datetime import date

    from wholebody.bench.adapters import missing
    from wholebody.bench.compare import run as comparison
    from wholebody.bench.compare.lock import differences, in_words, locked, read_lock, shares
    from wholebody.bench.compare.report import PAGE, publish
    from wholebody.bench.machine import machine
    from wholebody.cli.bench.publishing import check_count

    check_count(arguments.jobs, "--jobs")
    published = read_lock(arguments.lock)
    settings = published.settings()
    store = comparison.run(settings, arguments.out, arguments.jobs, None, lambda progress: print(progress.said))
    where = {"date": date.today().isoformat(), "cases beside each other": f"{arguments.jobs} on this machine"}
    found = locked(publish(settings, store, arguments.out, machine() | where, missing()))
    for line in in_words(published, found):
        print(line)
    print(f"wrote {arguments.out / PAGE}")
    return 1 if shares(differences(published, found)) else 0
