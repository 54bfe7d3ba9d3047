"""Tables that measurements leave, as they stand in their files."""

from __future__ import annotations

import csv
import io
from pathlib import Path


def csv_rows(path: Path) -> list[dict[str, str]]:
    """Return the rows below the facts of the machine."""
    rest = path.read_bytes().decode("utf-8")
    while rest.startswith("# "):
        rest = rest.partition("\n")[2]
    return list(csv.DictReader(io.StringIO(rest, newline="")))  # cells may have line breaks
