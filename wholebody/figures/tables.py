"""The tables of the folder "data", each with the source of every column."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from wholebody.base.files import packaged_table

FOLDER = Path(__file__).parent / "data"
Row = dict[str, str]


@cache
def table(name: str) -> tuple[Row, ...]:
    """Return the rows of a table in `figures/data`, each a mapping from column to text."""
    return packaged_table(FOLDER / f"{name}.csv")


@cache
def named_angles(of: str) -> dict[str, dict[str, float]]:
    """Return the angles of the table "postures", degrees by joint, of each posture of "human", "hand" or "fingers"."""
    found: dict[str, dict[str, float]] = {}
    for row in table("postures"):
        if row["of"] == of:
            found.setdefault(row["name"], {}).update({row["joint"]: float(row["degrees"])} if row["joint"] else {})
    return found


@cache
def keyed(name: str) -> dict[str, Row]:
    """Return the rows of a table by the text in its column "name"."""
    return {row["name"]: row for row in table(name)}
