"""Tables for the terminal, and progress bars."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.table import Table

from wholebody.base.batches import Line
from wholebody.bench.rows import Row, shown


def console(least: int = 0) -> Console:
    """The output, whose lines have `least` letters or more, and where it is no terminal enough for all tables."""
    made = Console()
    made.width = max(made.width, least, 0 if made.is_terminal else 140)  # letters of a line in a file or a log
    return made


@contextmanager
def bar(what: str, count: float = 1.0) -> Iterator[Callable[[float, str], Any]]:
    """Show on a terminal how much of `count` is done, and what, by the function that it yields."""
    line, shown = Line(), sys.stderr is not None and sys.stderr.isatty()
    if shown:
        line.write(0, count, what)
    try:
        yield lambda done, said: line.write(done, count, said) if shown else None
    finally:
        if shown:
            sys.stderr.write("\r\x1b[K")


def table(*columns: str) -> Table:
    """An empty table; every column but the first is aligned right."""
    made = Table(box=None, padding=(0, 2, 0, 0))
    for number, column in enumerate(columns):
        made.add_column(column, justify="right" if number else "left", header_style="dim", overflow="fold")
    return made


def print_rows(rows: Sequence[Row]) -> None:
    """Print measurements: a line a figure, a column a row."""
    made = table("", *(f"{row.case}, {row.tool}" for row in rows))
    for name in dict.fromkeys(name for row in rows for name in row.figures):
        made.add_row(name, *(shown(row.figures[name]) if name in row.figures else "" for row in rows))
    console().print(made)
