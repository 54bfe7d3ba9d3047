"""How a command of `wholebody bench` is declared, with its words and options in one place, and where its results go."""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from wholebody.base.errors import InputError
from wholebody.bench.tables import replace_section, write_rows, write_text
from wholebody.cli.arguments import Commands

Option = Callable[[argparse.ArgumentParser], object]
"""Adds itself to a parser."""


@dataclass(frozen=True)
class Command:
    """A command.

    Attributes:
        name: as typed.
        help, description: as `argparse` shows them.
        options: in the order of the help.
        measure: what it does; None is the exit code 0.
    """

    name: str
    help: str
    description: str
    options: tuple[Option, ...]
    measure: Callable[[argparse.Namespace], int | None]

    def add_to(self, commands: Commands) -> None:
        """Add it to a group of commands."""
        parser = commands.add_parser(self.name, help=self.help, description=self.description)
        parser.set_defaults(run=self.run, counted=())
        for add in self.options:
            add(parser)

    def run(self, arguments: argparse.Namespace) -> int:
        """Run it, and return the exit code.

        Raises:
            InputError: an option that counts things is below one.
        """
        for flag in arguments.counted:
            number = getattr(arguments, flag.removeprefix("--").replace("-", "_"))
            if number is not None and number < 1:
                raise InputError(f"{flag} is {number}; give 1 or more")
        return self.measure(arguments) or 0


def command(
    name: str, help: str, description: str, *options: Option
) -> Callable[[Callable[[argparse.Namespace], int | None]], Command]:
    """Make the decorated function a command."""
    return partial(Command, name, help, description, options)


def measuring(
    name: str, help: str, description: str, *options: Option
) -> Callable[[Callable[[argparse.Namespace], int | None]], Command]:
    """The same with `--quick`, `--out` and `--update-docs`."""
    return command(name, help, description, quick("a short run that shows whether all works"), folders(), *options)


def option(*names: str, **settings: Any) -> Option:
    """An option or an argument, as `ArgumentParser.add_argument` takes it."""
    return lambda parser: parser.add_argument(*names, **settings)


def quick(help: str) -> Option:
    """The option `--quick`."""
    return option("--quick", action="store_true", help=help)


def folders(out: str = "out/bench") -> Option:
    """`--out`, with a folder where it is left out, and `--update-docs`."""

    def add(parser: argparse.ArgumentParser) -> None:
        parser.add_argument("--out", type=Path, default=Path(out), metavar="DIR", help=f"folder (default: {out})")
        parser.add_argument(
            "--update-docs", type=Path, nargs="?", const=Path("docs"), metavar="DOCS",
            help="write tables and charts into the documentation too (default folder: docs)",
        )  # fmt: skip

    return add


def count(name: str, default: int | None, help: str) -> Option:
    """An option that counts things to do: one or more; the help says the default."""

    def add(parser: argparse.ArgumentParser) -> None:
        said = help if default is None or "(default" in help else f"{help} (default: {default})"
        parser.add_argument(name, type=int, default=default, metavar="N", help=said)
        parser.set_defaults(counted=(*parser.get_default("counted"), name))

    return add


def listed(name: str, help: str, metavar: str | None = "NAME", **settings: Any) -> Option:
    """An option that takes one word or several."""
    return option(name, nargs="+", metavar=metavar, help=help, **settings)


def seed(of: str) -> Option:
    """The option `--seed`."""
    return option("--seed", type=int, default=0, metavar="N", help=f"{of} (default: 0)")


class Chart(NamedTuple):
    """A chart that is still to be drawn.

    Attributes:
        draw: draws it into a file, whose suffix it replaces, and returns its SVG and its PNG.
        caption: for the documentation.
    """

    draw: Callable[[Path], tuple[Path, Path]]
    caption: str


def publish(
    name: str,
    report: str,
    arguments: argparse.Namespace,
    *,
    facts: Mapping[str, str] | None = None,
    tables: Mapping[str, Sequence[Any]] | None = None,
    charts: Mapping[str, Chart] | None = None,
    page: str = "results.md",
) -> None:
    """Write tables and report, draw charts, and write both into the documentation where that is asked for.

    What was measured is written before anything is drawn, so that a chart that fails loses no measurement.

    Args:
        name: of the report's file, and of its section of the page.
        report: Markdown.
        arguments: of the command.
        facts: of the machine, for the tables.
        tables: rows by the name of their CSV file.
        charts: by the names of their files.
        page: of the documentation.
    """
    for table, rows in (tables or {}).items():
        write_rows(arguments.out / f"{table}.csv", facts or {}, rows)
    write_text(arguments.out / f"{name}.md", report + "\n")
    print(report)
    drawn = [(chart.draw(arguments.out / file), chart.caption) for file, chart in (charts or {}).items()]
    print(f"wrote {arguments.out}")
    if arguments.update_docs is None:
        return
    pictures = [f"![{caption}](assets/bench/{svg.name})" for (svg, _), caption in drawn]
    replace_section(arguments.update_docs / page, name, "\n\n".join([*pictures, report]))
    folder = arguments.update_docs / "assets" / "bench"
    folder.mkdir(parents=True, exist_ok=True)
    for (svg, _), _ in drawn:
        shutil.copyfile(svg, folder / svg.name)
    print(f"wrote {arguments.update_docs / page}")


def publish_page(name: str, text: str, arguments: argparse.Namespace) -> None:
    """Write a page that a command makes whole, and into the documentation where that is asked for."""
    for folder in filter(None, (arguments.out, arguments.update_docs)):
        write_text(folder / name, text)
        print(f"wrote {folder / name}")
