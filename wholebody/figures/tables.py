"""The tables that bodies are built from; the lines that start with ``#``, and a column, name their sources."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

from wholebody.errors import UnknownNameError

_FOLDER = Path(__file__).parent / "data"

Row = dict[str, str]


@cache
def table(name: str) -> tuple[Row, ...]:
    """Return the rows of one table, each a mapping from column to text.

    Args:
        name: "joints", "segments", "radii_ansur", "percentiles", "design_cases", "spheres39", "sphere_exclusions",
            "reach_cones" or "hand".

    Raises:
        UnknownNameError: there is no such table.
    """
    path = _FOLDER / f"{name}.csv"
    if not path.is_file():
        raise UnknownNameError("table", name, [file.stem for file in _FOLDER.glob("*.csv")])
    with path.open(encoding="utf-8", newline="") as file:
        return tuple(csv.DictReader(line for line in file if not line.startswith("#")))


@cache
def keyed(name: str, column: str) -> dict[str, Row]:
    """Return the rows of a table by the text in one column."""
    return {row[column]: row for row in table(name)}
