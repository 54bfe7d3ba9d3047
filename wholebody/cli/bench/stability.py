"""`wholebody bench stability`: hard cases by methods, and where methods fail."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import check_count, measuring
from wholebody.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wholebody.bench.adapters import Adapter
    from wholebody.bench.stability.case import HardCase
    from wholebody.bench.stability.pictures import Drawn
    from wholebody.bench.stability.verdict import Result

PAGE = "where-methods-fail.md"
ASSETS = "assets/stability"


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "stability",
        help="hard cases by methods: where each fails, and how",
        description="Ask every method every hard case, each in a process of its own, and judge the answers: solved, an "
        "honest best effort, a clear refusal, or WRONG.",
    )
    parser.add_argument(
        "--methods", nargs="+", metavar="NAME", help="methods, such as qp, newton or qp/daqp (default: all)"
    )
    parser.add_argument("--cases", nargs="+", metavar="NAME", help="cases (default: all; with --quick a few)")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes at a time (default: 1)")


def run(arguments: argparse.Namespace) -> int:
    """Ask, judge, and write it down; 0 whatever the verdicts are."""
    from wholebody.bench.adapters import ALL, adapters
    from wholebody.bench.machine import machine
    from wholebody.bench.stability import catalogue, page
    from wholebody.bench.tables import write_rows, write_text

    check_count(arguments.jobs, "--jobs")
    _check_page(arguments)
    asked = adapters(arguments.methods or [ALL])
    chosen = catalogue.cases(arguments.cases or (catalogue.QUICK if arguments.quick else None))
    facts = machine()
    result = _asked(chosen, asked, arguments.jobs)
    write_rows(arguments.out / "stability.csv", facts, result.rows())
    report = page.report(result, facts)
    write_text(arguments.out / "stability.md", report + "\n")
    svg, _ = page.matrix(result, arguments.out / "stability.svg")
    _print(result)
    print(f"wrote {arguments.out}")
    if arguments.update_docs is not None:
        pictures = _drawn(result, arguments.update_docs)
        shutil.copyfile(svg, arguments.update_docs / ASSETS / page.CHART)
        _write_page(arguments.update_docs, page.page(result, asked, facts, pictures, ASSETS))
    return 0


def _check_page(arguments: argparse.Namespace) -> None:
    """Raise InputError, before anything is asked, where the page could not be written or would lose cases."""
    docs = arguments.update_docs
    if docs is None:
        return
    if arguments.cases or arguments.quick:
        raise InputError("the page has all cases; leave --cases and --quick out, or leave --update-docs out")
    if not (docs / PAGE).is_file():
        raise InputError(f"{docs / PAGE}: there is no such page; give the folder of the documentation")


def _asked(cases: Sequence[HardCase], adapters: Sequence[Adapter], jobs: int) -> Result:
    from wholebody.bench.stability.asking import run as ask_all
    from wholebody.bench.stability.verdict import result
    from wholebody.cli.tables import progress_bar

    cells = []
    with progress_bar(thread=False) as bar:
        work = bar.add_task("asking", total=len(cases) * len(adapters))
        for cell in ask_all(cases, adapters, jobs):
            cells.append(cell)
            bar.update(work, advance=1, description=f"{cell.case.name}, {cell.method}", refresh=True)
    return result(cases, [adapter.name for adapter in adapters], cells)


def _drawn(result: Result, docs: Path) -> Drawn:
    from wholebody.bench.stability.pictures import draw
    from wholebody.cli.tables import progress_bar

    with progress_bar(thread=False) as bar:
        work = bar.add_task("drawing", total=len(result.cases))
        return draw(result, docs / ASSETS, lambda: bar.update(work, advance=1, refresh=True))


def _print(result: Result) -> None:
    """The matrix in signs, as narrow as it can be, and every wrong answer in words."""
    from rich.console import Console

    from wholebody.bench.stability.verdict import SYMBOLS, WORDS
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
    for method in result.methods:
        for case in result.cases:
            verdict = result.verdicts[case.name, method]
            if verdict.kind == "wrong":
                console.print(f"WRONG: {method}, {case.name}: {verdict.figure}", highlight=False, markup=False)


def _write_page(docs: Path, text: str) -> None:
    from wholebody.bench.tables import replace_section

    replace_section(docs / PAGE, "stability", text)
    print(f"wrote {docs / PAGE}")
