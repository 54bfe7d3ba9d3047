"""What all measuring commands share: their options, and where their tables and charts go."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from wholebody.cli.arguments import Commands, add_folders
from wholebody.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence


class Chart(NamedTuple):
    """A chart that is still to be drawn.

    Attributes:
        draw: draws it into a file, whose suffix it replaces, and returns its SVG and its PNG.
        caption: for the documentation.
    """

    draw: Callable[[Path], tuple[Path, Path]]
    caption: str


def measuring(
    commands: Commands, run: Callable[[argparse.Namespace], int], name: str, *, help: str, description: str
) -> argparse.ArgumentParser:
    """Add a command that measures, with `--quick`, `--out` and `--update-docs`; its own options are added to it."""
    parser = commands.add_parser(name, help=help, description=description)
    parser.set_defaults(run=run)
    parser.add_argument("--quick", action="store_true", help="a short run that shows whether all works")
    add_folders(parser, "out/bench")
    return parser


def publish(
    name: str,
    report: str,
    arguments: argparse.Namespace,
    *,
    facts: Mapping[str, str] | None = None,
    tables: Mapping[str, Sequence[Any]] | None = None,
    charts: Mapping[str, Chart] | None = None,
) -> None:
    """Write tables and report, draw charts, and write both into the documentation where that is asked for.

    What was measured is written before anything is drawn, so that a chart that fails loses no measurement.

    Args:
        name: of the report's file, and of its section of results.md.
        report: Markdown.
        arguments: of the command.
        facts: of the machine, for the tables.
        tables: rows by the name of their CSV file.
        charts: by the names of their files.
    """
    from wholebody.bench.tables import replace_section, write_rows, write_text

    for table, rows in (tables or {}).items():
        write_rows(arguments.out / f"{table}.csv", facts or {}, rows)
    write_text(arguments.out / f"{name}.md", report + "\n")
    print(report)
    drawn = [(chart.draw(arguments.out / file), chart.caption) for file, chart in (charts or {}).items()]
    print(f"wrote {arguments.out}")
    if arguments.update_docs is None:
        return
    pictures = [f"![{caption}](assets/bench/{svg.name})" for (svg, _), caption in drawn]
    replace_section(arguments.update_docs / "results.md", name, "\n\n".join([*pictures, report]))
    folder = arguments.update_docs / "assets" / "bench"
    folder.mkdir(parents=True, exist_ok=True)
    for (svg, _), _ in drawn:
        shutil.copyfile(svg, folder / svg.name)
    print(f"wrote {arguments.update_docs / 'results.md'}")


def check_count(number: int, option: str) -> None:
    """Raise InputError unless a number of things to do is at least one."""
    if number < 1:
        raise InputError(f"{option} is {number}; give 1 or more")
