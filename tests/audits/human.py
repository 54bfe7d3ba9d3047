"""The person measured: dimensions, circumferences, ranges of motion, self-contacts, everyday tasks; and the page."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.audits import human_contacts, human_sizes, human_tasks
from tests.audits.human_contacts import ContactRow
from tests.audits.human_sizes import DimensionRow, RangeRow
from tests.audits.human_tasks import TaskRow
from tests.audits.templates import TEMPLATES
from wholebody.bench.report import render

CASES = ("F5", "F50", "F95", "M5", "M50", "M95")
WITHIN, OVERHEAD = 0.015, 0.025
"""Metres: residuals to keep to, and that of the overhead reach."""

THIN = ("thigh",)
"""Circumferences that the pieces do not keep to."""

QUICK = 3
"""Number of tasks of a short run."""


@dataclass(frozen=True)
class Measured:
    """Everything that was measured.

    Attributes:
        dimensions: fifteen of each design case.
        circumferences: of the median woman and man.
        ranges: of motion, of the median man.
        contacts: of the median man with himself.
        tasks: of the median man.
    """

    dimensions: Sequence[DimensionRow]
    circumferences: Sequence[DimensionRow]
    ranges: Sequence[RangeRow]
    contacts: Sequence[ContactRow]
    tasks: Sequence[TaskRow]

    @property
    def largest(self) -> DimensionRow:
        """The dimension with the largest residual, the overhead reach aside."""
        return max((row for row in self.dimensions if "overhead" not in row.name), key=lambda row: abs(row.residual))

    @property
    def overhead(self) -> float:
        """Largest residual of the overhead reach, metres."""
        return max(abs(row.residual) for row in self.dimensions if "overhead" in row.name)


def measure(pictures: Path | None, *, quick: bool) -> Iterator[str | Measured]:
    """Measure the person: sentences on the way, and at the end what was measured.

    Args:
        pictures: folder for a picture of each contact and task; None draws none.
        quick: one design case and three tasks.
    """
    import wholebody as wb

    figure = wb.load("human")
    sizes = human_sizes.dimensions(CASES[-2:-1] if quick else CASES)
    yield f"{len(sizes)} dimensions"
    girths = human_sizes.circumferences(("M50",) if quick else ("F50", "M50"))
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
    yield Measured(sizes, girths, ranges, contacts, rows)


def page(found: Measured, facts: Mapping[str, str], *, pictures: bool) -> str:
    """Return the page about the person as Markdown."""
    names = list(dict.fromkeys(row.name for row in found.dimensions))
    cases = list(dict.fromkeys(row.case for row in found.dimensions))
    residuals = {(row.name, row.case): 1e3 * row.residual for row in found.dimensions}
    values = {(row.name, row.case): 1e3 * row.ansur for row in found.dimensions}
    others = max(1e3 * abs(row.residual) for row in found.circumferences if row.name not in THIN)
    return (
        render(
            "human.md",
            TEMPLATES,
            found=found,
            facts=facts,
            names=names,
            cases=cases,
            residuals=residuals,
            values=values,
            thin=THIN,
            others=others,
            pictures=pictures,
            within=1e3 * WITHIN,
            overhead=1e3 * OVERHEAD,
        )
        + "\n"
    )


def figures(found: Measured, facts: Mapping[str, str]) -> str:
    """Return all numbers as JSON."""
    told = {
        "machine": dict(facts),
        "dimensions": [asdict(row) | {"residual": row.residual} for row in found.dimensions],
        "circumferences": [asdict(row) | {"residual": row.residual} for row in found.circumferences],
        "ranges": [asdict(row) for row in found.ranges],
        "contacts": [asdict(row) | {"reached": row.reached} for row in found.contacts],
        "tasks": [asdict(row) | {"plausible": row.plausible} for row in found.tasks],
    }
    return json.dumps(told, indent=1) + "\n"
