"""The person measured: dimensions, ranges of motion, self-contacts, everyday tasks; and the page."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.audits import human_contacts, human_postures, human_sizes, human_tasks
from tests.audits.human_contacts import ContactRow
from tests.audits.human_postures import PostureRow
from tests.audits.human_sizes import DimensionRow, RangeRow
from tests.audits.human_tasks import TaskRow
from tests.audits.templates import TEMPLATES
from wholebody.bench.tables import render

QUICK = 3
"""Number of tasks of a short run."""


@dataclass(frozen=True)
class Measured:
    """Everything that was measured.

    Attributes:
        dimensions: of women and men.
        ranges: of motion, of the median man.
        contacts: of the median man with himself.
        tasks: of the median man.
        postures: of the median man, beside those of people.
    """

    dimensions: Sequence[DimensionRow]
    ranges: Sequence[RangeRow]
    contacts: Sequence[ContactRow]
    tasks: Sequence[TaskRow]
    postures: Sequence[PostureRow]

    @property
    def largest(self) -> DimensionRow:
        """The dimension that bodies differ in most."""
        return max(self.dimensions, key=lambda row: abs(row.residual))


def measure(pictures: Path | None, *, quick: bool) -> Iterator[str | Measured]:
    """Measure the person: sentences on the way, and at the end what was measured.

    Args:
        pictures: folder for a picture of each contact and task; None draws none.
        quick: one build and three tasks.
    """
    import wholebody as wb

    figure = wb.load("human")
    sizes = human_sizes.dimensions(("male",), (50,)) if quick else human_sizes.dimensions(("female", "male"))
    yield f"{len(sizes)} dimensions"
    ranges = human_sizes.ranges(figure)
    first = wb.solve(wb.Problem(wb.Scene(figure)))  # numba's loops are compiled or read back
    contacts = human_contacts.contacts(figure, None if quick else pictures)
    yield f"{sum(row.reached for row in contacts)} of {len(contacts)} self-contacts ({first.status} at rest)"
    rows = []
    made = human_tasks.tasks(figure)
    for name in list(made)[:QUICK] if quick else made:
        row, _ = human_tasks.solve_task(name, made[name](), pictures)
        rows.append(row)
        yield f"{name}: {row.status} in {row.seconds:.2f} s"
    postures = list(human_postures.measure(human_postures.median_man(), "fit" if quick else None))
    yield human_postures.summary(postures)
    yield Measured(sizes, ranges, contacts, rows, postures)


def page(found: Measured, facts: Mapping[str, str], *, pictures: bool) -> str:
    """Return the page about the person as Markdown."""
    by_name = {row.name: [one for one in found.dimensions if one.name == row.name] for row in found.dimensions}
    return (
        render(
            "human.md",
            TEMPLATES,
            found=found,
            facts=facts,
            by_name=by_name,
            summary=human_postures.summary(found.postures),
            sources=list(dict.fromkeys(row.source for row in found.postures)),
            pictures=pictures,
        )
        + "\n"
    )


def figures(found: Measured, facts: Mapping[str, str]) -> str:
    """Return all numbers as JSON."""
    told = {
        "machine": dict(facts),
        "dimensions": [asdict(row) for row in found.dimensions],
        "ranges": [asdict(row) for row in found.ranges],
        "contacts": [asdict(row) | {"reached": row.reached} for row in found.contacts],
        "tasks": [asdict(row) | {"plausible": row.plausible} for row in found.tasks],
        "postures": [asdict(row) | {"off": row.off} for row in found.postures],
    }
    return json.dumps(told, indent=1) + "\n"
