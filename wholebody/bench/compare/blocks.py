"""What a report is made of, to be written as HTML or as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from wholebody.bench.tables import markdown


class Heading(NamedTuple):
    """A title; level 2 begins a part, 3 a section of it."""

    level: int
    text: str


class Text(NamedTuple):
    """A paragraph. `code` and **strong** are marked as in Markdown."""

    text: str


class Points(NamedTuple):
    """A list of sentences."""

    texts: Sequence[str]


class Table(NamedTuple):
    """A table; the first column is text."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


class Chart(NamedTuple):
    """A chart by its name, with what it shows."""

    name: str
    caption: str


class Scenes(NamedTuple):
    """Where the scenes of chosen cases stand; nothing in Markdown."""


Block = Heading | Text | Points | Table | Chart | Scenes


def as_markdown(blocks: Sequence[Block]) -> str:
    """The blocks as Markdown; charts are left to who knows where their files are."""
    parts = []
    for block in blocks:
        if isinstance(block, Heading):
            parts.append(f"{'#' * (block.level + 1)} {block.text}")
        elif isinstance(block, Text):
            parts.append(block.text)
        elif isinstance(block, Points):
            parts.append("\n".join(f"- {text}" for text in block.texts))
        elif isinstance(block, Table):
            parts.append(markdown(block.columns, [[cell.replace("|", "\\|") for cell in row] for row in block.rows]))
        elif isinstance(block, Chart):
            parts.append(f"![{block.caption}](assets/bench/{block.name}.svg)")
    return "\n\n".join(parts)
