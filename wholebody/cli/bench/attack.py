"""`wholebody bench attack`: random hard cases of every kind, judged by coal and Pinocchio alone."""

from __future__ import annotations

import argparse
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.cli.arguments import Commands, add_folders
from wholebody.cli.bench.publishing import check_count
from wholebody.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from wholebody.bench.attack.case import Case
    from wholebody.bench.attack.report import Row

PAGE = "reliability.md"
INTERRUPTED = 130  # exit code after Ctrl-C
DESCRIPTION = """\
Attack the package with random hard cases: solves that begin inside things, with goals that contradict or are out of
reach; streams; sweeps; mutated files; odd arguments. Answers are judged by coal over all pairs and by Pinocchio alone.
Every failure is written as a script that repeats it. Case K of a seed is always the same. The exit code is 1 where
something was wrong: a false claim, an error other than one sentence, a crash, or no end within a minute. What ended
before Ctrl-C is written."""


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = commands.add_parser("attack", help="random hard cases of every kind, judged", description=DESCRIPTION)
    parser.add_argument("--seconds", type=float, default=60.0, metavar="S", help="how long (default: 60)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all cases (default: 0)")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="number of the first case (default: 0)")
    parser.add_argument("--cases", type=int, metavar="N", help="end after as many cases, if the time suffices")
    parser.add_argument("--kinds", nargs="+", metavar="KIND", help="of cases: solve, stream, sweep, file, argument")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes at a time (default: 1)")
    parser.add_argument(
        "--also", nargs="+", type=Path, default=[], metavar="CSV", help="attack.csv of other runs, counted too"
    )
    add_folders(parser, "out/attack")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Attack; 1 where something was wrong."""
    from wholebody.bench.attack import report
    from wholebody.bench.attack.report import Row, is_slow
    from wholebody.bench.attack.running import attack, for_seconds
    from wholebody.bench.machine import machine
    from wholebody.bench.tables import read_rows, replace_section, write_rows, write_text

    _check(arguments)
    earlier = [one for path in arguments.also for one in read_rows(path, Row)[1]]
    rows: list[Row] = []
    tell, interrupted = _teller(rows), False
    try:
        for ended in attack(_cases(arguments), arguments.jobs, for_seconds(arguments.seconds)):
            line = tell(ended)
            if line.outcome == "wrong" or is_slow(line):
                report.keep(ended, arguments.out)
    except KeyboardInterrupt:
        interrupted = True
    rows += earlier
    if not rows:
        raise InputError("no case ended; give more --seconds")
    rows.sort(key=lambda one: (one.seed, one.number))
    facts = machine()
    write_rows(arguments.out / "attack.csv", facts, rows)
    report.index(rows, arguments.out)
    text = report.report(rows, facts)
    write_text(arguments.out / "attack.md", text + "\n")
    print(text)
    print(f"wrote {arguments.out}")
    if arguments.update_docs is not None:
        replace_section(arguments.update_docs / PAGE, "attack", text)
        print(f"wrote {arguments.update_docs / PAGE}")
    return INTERRUPTED if interrupted else int(any(one.outcome == "wrong" for one in rows))


def _check(arguments: argparse.Namespace) -> None:
    from wholebody.bench.attack.case import KINDS
    from wholebody.errors import UnknownNameError

    check_count(arguments.jobs, "--jobs")
    if arguments.cases is not None:
        check_count(arguments.cases, "--cases")
    if not 0.0 < arguments.seconds < 1e9:
        raise InputError(f"--seconds is {arguments.seconds:g}; give a positive number of seconds")
    if arguments.seed < 0 or arguments.first < 0:
        raise InputError("--seed and --first are 0 or more")
    for kind in arguments.kinds or ():
        if kind not in KINDS:
            raise UnknownNameError("kind of case", kind, KINDS, "--kinds")


def _cases(arguments: argparse.Namespace) -> Iterator[Case]:
    from wholebody.bench.attack.case import Case, kind_of

    numbers = count(arguments.first)
    kept = (k for k in numbers if arguments.kinds is None or kind_of(k) in arguments.kinds)
    for done, number in enumerate(kept):
        if done == arguments.cases:
            return
        yield Case(arguments.seed, number, kind_of(number))


def _teller(rows: list[Row]) -> Callable[..., Row]:
    """Return what adds a case to the rows, and prints a line where it was wrong, and now and then how far it is."""
    from wholebody.bench.attack.report import row

    def tell(ended: object) -> Row:
        line = row(ended)  # type: ignore[arg-type]
        rows.append(line)
        if line.outcome == "wrong":
            print(f"WRONG: {line.kind} {line.number}: {line.words}", flush=True)
        elif len(rows) % 200 == 0:
            print(f"{len(rows)} cases, {sum(one.outcome == 'wrong' for one in rows)} wrong", flush=True)
        return line

    return tell
