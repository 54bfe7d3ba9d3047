"""The options that commands of `wholebody bench` share, and where their results go."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from wholebody.bench.tables import write_rows, write_text
from wholebody.cli.command import Command, Measure, Option, command, count, flag, option, path


def measuring(name: str, help: str, description: str, *options: Option) -> Callable[[Measure], Command]:
    """The same with `--quick` and `--out`."""
    return command(
        name, help, description, quick("a short run that shows whether all works"), out("out/bench"), *options
    )


def quick(help: str) -> Option:
    """The option `--quick`."""
    return flag("--quick", help)


def out(folder: str) -> Option:
    """`--out`, with a folder where it is left out."""
    return path("--out", "DIR", f"folder (default: {folder})", default=Path(folder))


def listed(name: str, help: str, metavar: str | None = "NAME", **settings: Any) -> Option:
    """An option that takes one word or several."""
    return option(name, nargs="+", metavar=metavar, help=help, **settings)


def seed(of: str) -> Option:
    """The option `--seed`."""
    return count("--seed", 0, of, least=0)


CLIPS = (
    path("--clips", "DIR", "folder of recordings (BVH), beside the built-in clips"),
    listed("--only", "names of clips (default: all)", "CLIP"),
)


class Chart(NamedTuple):
    """A chart that is still to be drawn: `draw` draws it into a file of another suffix, and returns SVG and PNG."""

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
) -> None:
    """Write tables and report, then charts, which the report shows at its end."""
    # Measurements come first.
    for table, rows in (tables or {}).items():
        write_rows(arguments.out / f"{table}.csv", facts or {}, rows)
    file = arguments.out / f"{name}.md"
    write_text(file, report + "\n")
    print(report)
    drawn = [(chart.draw(arguments.out / chart_name), chart.caption) for chart_name, chart in (charts or {}).items()]
    if drawn:
        write_text(file, "\n\n".join([report, *(f"![{caption}]({svg.name})" for (svg, _), caption in drawn)]) + "\n")
    print(f"wrote {arguments.out}")
