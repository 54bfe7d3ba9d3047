"""`wholebody bench stability` and `attack`: named hard cases by every method, and random ones of every kind."""

from __future__ import annotations

import argparse
import shutil
from itertools import count as numbers
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.base.errors import InputError, UnknownNameError
from wholebody.bench.machine import machine
from wholebody.bench.tables import read_rows, replace_section, write_rows, write_text
from wholebody.cli.arguments import folders
from wholebody.cli.bench.command import listed, measuring, seed
from wholebody.cli.command import command, count, option

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from wholebody.bench.attack.case import Case
    from wholebody.bench.attack.report import Row
    from wholebody.bench.suite.adapters.base import Adapter
    from wholebody.bench.suite.stability.asking import Cell
    from wholebody.bench.suite.stability.case import HardCase
    from wholebody.bench.suite.stability.pictures import Drawn
    from wholebody.bench.suite.stability.verdict import Result

PAGE = "where-methods-fail.md"
ASSETS = "assets/stability"
ATTACKED = "reliability.md"


@measuring(
    "stability",
    "hard cases by methods: where each fails, and how",
    "Ask every method every hard case, each in a process of its own, and judge the answers: solved, an "
    "honest best effort, a clear refusal, or WRONG. With --from an earlier run is told again: its table, its "
    "chart, and with --update-docs the page, for whose pictures a few answers are asked for anew.",
    listed(
        "--methods",
        "methods, such as qp, newton or qp/daqp; all for every one (default: those of the page; with --from those of "
        "the file)",
    ),
    listed("--cases", "cases (default: all, with --from those of the file; with --quick a few)"),
    option(
        "--from", dest="earlier", type=Path, metavar="CSV", help="stability.csv of an earlier run, instead of asking"
    ),
    count("--jobs", 1, "processes at a time"),
)
def stability(arguments: argparse.Namespace) -> None:
    """Ask, judge, and write it down; 0 whatever the verdicts are."""
    from wholebody.bench.suite.adapters.registry import adapters, installed
    from wholebody.bench.suite.stability import catalogue, page
    from wholebody.bench.suite.stability.verdict import read_result, result

    _check_page(arguments)
    whole = arguments.update_docs is not None
    cases = arguments.cases or (catalogue.QUICK if arguments.quick else None)
    asked: Sequence[Adapter] = ()
    if arguments.earlier is not None:
        every = (catalogue.names(), page.METHODS) if whole else (None, None)
        found, facts = read_result(arguments.earlier, cases or every[0], arguments.methods or every[1])
        if whole:
            asked = adapters(found.methods)
    else:
        asked = adapters(arguments.methods or [name for name in page.METHODS if whole or installed(name)])
        chosen = catalogue.cases(cases)
        facts = machine()
        found = result(
            chosen,
            [adapter.name for adapter in asked],
            _asked([(case, adapter) for case in chosen for adapter in asked], arguments.jobs),
        )
        write_rows(arguments.out / "stability.csv", facts, list(found.rows.values()))
    report = page.report(found, facts)
    write_text(arguments.out / "stability.md", report + "\n")
    svg, _ = page.matrix(found, arguments.out / "stability.svg")
    _print(found)
    print(f"wrote {arguments.out}")
    if arguments.update_docs is not None:
        pictures = _drawn(found, asked, arguments.update_docs, arguments.jobs)
        shutil.copyfile(svg, arguments.update_docs / ASSETS / page.CHART)
        text = page.page(found, asked, facts, pictures, ASSETS)
        replace_section(arguments.update_docs / PAGE, "stability", text)
        print(f"wrote {arguments.update_docs / PAGE}")


def _check_page(arguments: argparse.Namespace) -> None:
    """Raise InputError, before anything is asked, where the page could not be written or would lose cases."""
    docs = arguments.update_docs
    if docs is None:
        return
    if arguments.cases or arguments.quick:
        raise InputError("the page has all cases; leave --cases and --quick out, or leave --update-docs out")
    if not (docs / PAGE).is_file():
        raise InputError(f"{docs / PAGE}: there is no such page; give the folder of the documentation")


def _asked(pairs: Sequence[tuple[HardCase, Adapter]], jobs: int) -> list[Cell]:
    from wholebody.bench.suite.stability.asking import run
    from wholebody.cli.tables import progress_bar

    cells = []
    with progress_bar(thread=False) as bar:
        work = bar.add_task("asking", total=len(pairs))
        for cell in run(pairs, jobs):
            cells.append(cell)
            bar.update(work, advance=1, description=f"{cell.case.name}, {cell.method}", refresh=True)
    return cells


def _drawn(found: Result, asked: Sequence[Adapter], docs: Path, jobs: int) -> Drawn:
    """Draw answers; those of an earlier run are asked for again, and drawn where the verdict is of the same kind."""
    from wholebody.bench.suite.stability.pictures import draw, shown
    from wholebody.bench.suite.stability.verdict import judged_verdict
    from wholebody.cli.tables import progress_bar

    cells, known = dict(found.cells), {adapter.name: adapter for adapter in asked}
    if not cells:
        for cell in _asked([(case, known[method]) for case, method in shown(found)], jobs):
            key = cell.case.name, cell.method
            if judged_verdict(cell, None).kind == found.rows[key].verdict:
                cells[key] = cell
    with progress_bar(thread=False) as bar:
        work = bar.add_task("drawing", total=len(found.cases))
        return draw(found, cells, docs / ASSETS, lambda: bar.update(work, advance=1, refresh=True))


def _print(result: Result) -> None:
    """The matrix in signs, as narrow as it can be, and every wrong answer in words."""
    from rich.console import Console

    from wholebody.bench.suite.stability.verdict import SYMBOLS, WORDS
    from wholebody.cli.tables import table

    console = Console()
    letters = [chr(ord("a") + number) for number in range(len(result.methods))]
    signs = table("case", *letters)
    for case in result.cases:
        signs.add_row(case.name, *(result.verdicts[case.name, method].symbol for method in result.methods))
    console.print(signs)
    counts = table("", "method", *WORDS.values(), "acceptable")
    for letter, method in zip(letters, result.methods, strict=True):
        found = (str(result.count(method, kind)) for kind in WORDS)
        counts.add_row(letter, method, *found, f"{result.acceptable(method)} of {len(result.cases)}")
    console.print(counts)
    legend = ", ".join(f"{symbol} {WORDS[kind]}" for kind, symbol in SYMBOLS.items())
    console.print(f"{legend}; ● honest and as good as can be", highlight=False)
    for method, case, verdict in result.of_kind("wrong"):
        console.print(f"WRONG: {method}, {case.name}: {verdict.figure}", highlight=False, markup=False)


@command(
    "attack",
    "random hard cases of every kind, judged",
    """\
Attack the package with random hard cases: solves that begin inside things, with goals that contradict or are out of
reach; streams; sweeps; contacts beside points at the place found; mutated files; odd arguments. Answers are judged by
coal over all pairs and by Pinocchio alone. Every failure is written as a script that repeats it. Case K of a seed is
always the same. The exit code is 1 where something was wrong: a false claim, an error other than one sentence, a crash,
or no end within a minute. What ended before Ctrl-C is written.""",
    option("--seconds", type=float, default=60.0, metavar="S", help="how long (default: 60)"),
    seed("of all cases"),
    option("--first", type=int, default=0, metavar="K", help="number of the first case (default: 0)"),
    count("--cases", None, "end after as many cases, if the time suffices"),
    listed("--kinds", "of cases: solve, stream, sweep, contact, file, argument", "KIND"),
    count("--jobs", 1, "processes at a time"),
    listed("--also", "attack.csv of other runs, counted too", "CSV", type=Path, default=[]),
    *folders("out/attack"),
)
def attack(arguments: argparse.Namespace) -> int:
    """Attack; 1 where something was wrong."""
    from wholebody.bench.attack import report, running
    from wholebody.bench.attack.report import Row, is_slow

    _check(arguments)
    earlier = [one for path in arguments.also for one in read_rows(path, Row)[1]]
    rows: list[Row] = []
    tell, interrupted = _teller(rows), False
    try:
        for ended in running.attack(_cases(arguments), arguments.jobs, running.for_seconds(arguments.seconds)):
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
        replace_section(arguments.update_docs / ATTACKED, "attack", text)
        print(f"wrote {arguments.update_docs / ATTACKED}")
    return 130 if interrupted else int(any(one.outcome == "wrong" for one in rows))  # exit code after Ctrl-C


def _check(arguments: argparse.Namespace) -> None:
    from wholebody.bench.attack.case import KINDS

    if not 0.0 < arguments.seconds < 1e9:
        raise InputError(f"--seconds is {arguments.seconds:g}; give a positive number of seconds")
    if arguments.seed < 0 or arguments.first < 0:
        raise InputError("--seed and --first are 0 or more")
    for kind in arguments.kinds or ():
        if kind not in KINDS:
            raise UnknownNameError("kind of case", kind, KINDS, "--kinds")


def _cases(arguments: argparse.Namespace) -> Iterator[Case]:
    from wholebody.bench.attack.case import Case, kind_of

    kept = (k for k in numbers(arguments.first) if arguments.kinds is None or kind_of(k) in arguments.kinds)
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
