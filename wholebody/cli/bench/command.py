"""The options that commands of `wholebody bench` share, and where their results go."""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from wholebody.bench.tables import publish_text, write_rows, write_text
from wholebody.cli.command import Command, Measure, Option, command, count, flag, option, path


def measuring(name: str, help: str, description: str, *options: Option) -> Callable[[Measure], Command]:
    """The same with `--quick`, `--out` and `--update-docs`."""
    return command(
        name, help, description, quick("a short run that shows whether all works"), *folders("out/bench"), *options
    )


def quick(help: str) -> Option:
    """The option `--quick`."""
    return flag("--quick", help)


def folders(out: str) -> tuple[Option, Option]:
    """`--out`, with a folder where it is left out, and `--update-docs`."""
    told = "write tables and charts into the documentation too (default folder: docs)"
    return (
        path("--out", "DIR", f"folder (default: {out})", default=Path(out)),
        path("--update-docs", "DOCS", told, nargs="?", const=Path("docs")),
    )


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
    page: str | None = "results.md",
) -> None:
    """Write tables and report, then charts, and both into the documentation where that is asked for."""
    # Measurements come first. `page` gets charts and the first table; None: only the report's file.
    for table, rows in (tables or {}).items():
        write_rows(arguments.out / f"{table}.csv", facts or {}, rows)
    write_text(arguments.out / f"{name}.md", report + "\n")
    print(report)
    drawn = [(chart.draw(arguments.out / file), chart.caption) for file, chart in (charts or {}).items()]
    print(f"wrote {arguments.out}")
    if arguments.update_docs is None:
        return
    pictures = [f"![{caption}](assets/bench/{svg.name})" for (svg, _), caption in drawn]
    print(f"wrote {publish_text(arguments.update_docs, name, report, page, pictures)}")
    for (svg, _), _ in drawn:
        shutil.copyfile(svg, arguments.update_docs / "assets" / "bench" / svg.name)
