"""What all measuring commands share: their options, and where their tables and charts go."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence


def add_common(parser: argparse.ArgumentParser) -> None:
    """Add `--quick`, `--out` and `--update-docs`."""
    parser.add_argument("--quick", action="store_true", help="a short run that shows whether all works")
    add_folders(parser, "out/bench")


def add_folders(parser: argparse.ArgumentParser, out: str) -> None:
    """Add `--out`, with a folder where it is left out, and `--update-docs`."""
    parser.add_argument("--out", type=Path, default=Path(out), metavar="DIR", help=f"folder (default: {out})")
    parser.add_argument(
        "--update-docs", type=Path, nargs="?", const=Path("docs"), metavar="DOCS",
        help="write tables and charts into the documentation too (default folder: docs)",
    )  # fmt: skip


def publish(
    name: str,
    report: str,
    charts: dict[str, tuple[Path, Path]],
    captions: dict[str, str],
    arguments: argparse.Namespace,
) -> None:
    """Write the tables beside the numbers, and with the charts into the documentation where that is asked for."""
    from wholebody.bench.tables import replace_section, write_text

    write_text(arguments.out / f"{name}.md", report + "\n")
    print(report)
    print(f"wrote {arguments.out}")
    if arguments.update_docs is None:
        return
    pictures: Sequence[str] = [f"![{captions[chart]}](assets/bench/{chart}.svg)" for chart in charts]
    replace_section(arguments.update_docs / "results.md", name, "\n\n".join([*pictures, report]))
    folder = arguments.update_docs / "assets" / "bench"
    folder.mkdir(parents=True, exist_ok=True)
    for svg, _ in charts.values():
        shutil.copyfile(svg, folder / svg.name)
    print(f"wrote {arguments.update_docs / 'results.md'}")


def check_count(number: int, option: str) -> None:
    """Raise InputError unless a number of things to do is at least one."""
    if number < 1:
        raise InputError(f"{option} is {number}; give 1 or more")
