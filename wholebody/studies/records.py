"""What a run of many solves found: one record a case, the table of all, and the records of a folder."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from wholebody.base import checks
from wholebody.base.arrays import Array, brief
from wholebody.base.charts import Shown, new_chart, plain, png
from wholebody.base.errors import InputError, millimetres
from wholebody.base.files import checked_target, csv_text, write
from wholebody.base.records import RecordFile
from wholebody.solution import Solution

REFUSED, ENDED, CANCELLED = "refused", "ended", "cancelled"
HELD = ("penetration", "clearance_violation", "limit_violation", "constraint_violation")
JUDGED = ("goal_error", "goal_angle", *HELD, "measure")


MOST = 100  # rows or columns; letters of more are too small to read
WIDTH, HEIGHT = 0.9, 0.3  # inches of a cell

COLORS: Mapping[str, str] = MappingProxyType(
    {
        "solved": "#009e73",
        "unreachable": "#e69f00",
        "infeasible": "#d55e00",
        "stalled": "#cc79a7",
        "refused": "#999999",
        "ended": "#666666",
        "cancelled": "#dddddd",
    }
)
"""Of outcomes, by Okabe and Ito (2008), whose colours are also told apart by people who are colour-blind."""


@dataclass(frozen=True, eq=False)
class SolveRecord:
    """One problem of many, and what came of it.

    Attributes:
        name: of the case.
        outcome: the status of the solution; "refused" where the input is wrong, "ended" where its process ended,
            "cancelled" where it was not begun.
        message: one sentence that explains the outcome.
        seconds: of the solve, by the clock.
        iterations: of the method.
        goal_error: largest remaining distance, metres.
        goal_angle: largest remaining angle, radians.
        penetration: depth of the deepest overlap, metres.
        clearance_violation: largest shortfall of a pair from its required distance, metres.
        limit_violation: largest violation of a joint limit, radians or metres.
        constraint_violation: largest violation of a constraint, metres or radians.
        measure: weighted sum of the measures.
        q: (nq,) the posture; None where there is none. Numbers of a record without a posture are 0.
        factors: what the case is made of, such as {"person": "F5", "target": "shelf"}.
        neighbour: name of the case whose answer was the start that led to the posture; "" where it was its own start.
        change: of strategy, in a warm-started run: the joint that turns by more than 10 degrees from a neighbouring
            case, such as "left_hip_flexion by 60 degrees from 1"; "" where the posture goes on from its neighbours.

    Examples:
        >>> record = wb.solve_many([problem])[0]
        >>> record.goal_error < 1e-5
        True
    """

    __repr__ = brief

    name: str
    outcome: str = CANCELLED
    message: str = ""
    seconds: float = 0.0
    iterations: int = 0
    goal_error: float = 0.0
    goal_angle: float = 0.0
    penetration: float = 0.0
    clearance_violation: float = 0.0
    limit_violation: float = 0.0
    constraint_violation: float = 0.0
    measure: float = 0.0
    q: Array | None = None
    factors: Mapping[str, str] | None = None
    neighbour: str = ""
    change: str = ""

    @property
    def solved(self) -> bool:
        """Whether the outcome is "solved"."""
        return self.outcome == "solved"

    def row(self) -> dict[str, Any]:
        """The record as plain values, without the posture; the factors are columns of their own."""
        plain = {field.name: getattr(self, field.name) for field in fields(self) if field.name not in ("q", "factors")}
        return {"name": plain.pop("name"), **(self.factors or {}), **plain}

    @classmethod
    def of(cls, plain: dict[str, Any]) -> SolveRecord:
        """The record of the plain values that `dataclasses.asdict` gave, its posture as a list."""
        q = plain.pop("q")
        return cls(q=None if q is None else np.array(q, dtype=float), **plain)


def answer_of(solution: Solution) -> dict[str, Any]:
    """What a record says of a solution, by the names of its attributes."""
    judged = solution.assessment
    return {
        "outcome": solution.status,
        "message": solution.message,
        "seconds": solution.seconds,
        "iterations": solution.iterations,
        "q": np.array(solution.q, dtype=float),
        **{name: getattr(judged, name) for name in JUDGED},
    }


class Records(Shown, Sequence[SolveRecord]):
    """The records of many solves, in the order in which they were asked.

    Raises:
        InputError: no list of records; of its files: another ending, or it cannot be written.

    Examples:
        >>> records = wb.solve_many([problem])
        >>> records[0].outcome, len(records)
        ('solved', 1)
    """

    def __init__(self, records: Sequence[SolveRecord]) -> None:
        listed = checks.listed(records, "Records: records", "those of wb.solve_many")
        for one in listed:
            checks.instance(one, SolveRecord, "Records: a record", "give those of wb.solve_many")
        self._records: tuple[SolveRecord, ...] = tuple(listed)

    def __getitem__(self, index: Any) -> Any:
        return self._records[index]

    def __len__(self) -> int:
        return len(self._records)

    def __repr__(self) -> str:
        counts = ", ".join(f"{number} {outcome}" for outcome, number in self.counts().items()) or "none"
        seconds = sum(one.seconds for one in self._records)
        placed = [one for one in self._records if one.q is not None]
        worst = max(placed, key=lambda one: one.goal_error, default=None)
        missed = f"{worst.name} by {millimetres(worst.goal_error)}" if worst else "none"
        return (
            f"{len(self)} solve{'' if len(self) == 1 else 's'}: {counts}\n  {seconds:.3g} s of solving\n"
            f"  goal missed most: {missed}{self.remarks()}"
        )  # fmt: skip

    def remarks(self) -> str:
        """Lines about answers of neighbours, changes of strategy, and the first refused and the first ended case."""
        lines = f"\n  {self.from_neighbours} solved from the answer of a neighbour" if self.from_neighbours else ""
        changed = [f"{one.name}, {one.change}" for one in self._records if one.change]
        many = "changes" if len(changed) > 1 else "change"
        lines += f"\n  {len(changed)} {many} of strategy, first: {changed[0]}" if changed else ""
        for outcome in (REFUSED, ENDED):
            first = next((one for one in self._records if one.outcome == outcome), None)
            lines += "" if first is None else f"\n  first {outcome}: {first.name}, {first.message}"
        return lines

    @property
    def from_neighbours(self) -> int:
        """How many are solved from the answer of a neighbouring case: they were not from their own start, or worse."""
        return sum(bool(one.neighbour) for one in self._records)

    def counts(self) -> dict[str, int]:
        """How many records have each outcome."""
        return dict(Counter(one.outcome for one in self._records))

    @property
    def solved(self) -> float:
        """Share of the records that are solved; 0 without records."""
        return sum(one.solved for one in self._records) / len(self) if len(self) else 0.0

    def rows(self) -> list[dict[str, Any]]:
        """The records as plain dictionaries, without postures, as `pandas.DataFrame` takes them."""
        return [one.row() for one in self._records]

    def plot(self) -> Any:
        """Draw the outcomes as a table, a matplotlib figure.

        Targets are columns, people and layouts are rows; without factors each record is a row. A cell has the colour of
        its outcome, and where it is not solved the remaining distance, in millimetres.

        Raises:
            InputError: there are no records, more than 100 rows or columns, two records of one name and factors, or an
                outcome that no solve has.
        """
        from matplotlib.patches import Patch

        if unknown := {one.outcome for one in self} - COLORS.keys():
            raise InputError(f"chart: no outcome is called {sorted(unknown)[0]!r}; outcomes are {', '.join(COLORS)}")
        factors = [one.factors or {"": one.name} for one in self]
        places = [
            (", ".join(value for factor, value in each.items() if factor != "target"), each.get("target", ""))
            for each in factors
        ]
        if twice := [place for place, count in Counter(places).items() if count > 1]:
            name = ", ".join(filter(None, twice[0]))
            raise InputError(f"chart: {places.count(twice[0])} records are called {name!r}; give records of one run")
        rows, columns = (list(dict.fromkeys(place[k] for place in places)) for k in (0, 1))
        if not 0 < max(len(rows), len(columns)) <= MOST:
            raise InputError(
                f"chart: {len(rows)} rows and {len(columns)} columns; give records of 1 to {MOST} of each, such as "
                "a part"
            )
        wide = WIDTH * len(columns) + 0.09 * max(map(len, rows)) + 1.8  # inches of a letter of a row's name
        chart, axes = new_chart(1, 1, (wide, HEIGHT * len(rows) + 1.2))
        axis = axes[0, 0]
        for one, (row, column) in zip(self, places, strict=True):
            x, y = columns.index(column), rows.index(row)
            axis.fill([x, x + 1, x + 1, x], [y, y, y + 1, y + 1], facecolor=COLORS[one.outcome], edgecolor="white")
            if one.goal_error > 0.0 and not one.solved:
                axis.text(
                    x + 0.5, y + 0.5, f"{1e3 * one.goal_error:.0f} mm", ha="center", va="center", fontsize="x-small"
                )
        axis.set(xlim=(0, len(columns)), ylim=(len(rows), 0))
        # so that matplotlib reads no formula in a name
        axis.set_xticks(np.arange(len(columns)) + 0.5, [*(plain(name) for name in columns)], fontsize="x-small")
        axis.set_yticks(np.arange(len(rows)) + 0.5, [*(plain(name) for name in rows)], fontsize="x-small")
        axis.tick_params(length=0)
        seen = {one.outcome for one in self}
        patches = [Patch(facecolor=color, label=outcome) for outcome, color in COLORS.items() if outcome in seen]
        chart.legend(handles=patches, loc="outside right upper", fontsize="x-small", frameon=False)
        return chart

    def chart(self, path: str | os.PathLike[str]) -> Path:
        """Write `plot` into a PNG file, and raise the same; returns the path."""
        return write(checked_target(path, "chart: path", "a chart", (".png",)), png(self.plot()))

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the rows as CSV; returns the path."""
        file = checked_target(path, "to_csv: path", "a table", (".csv",))
        return write(file, csv_text(self.rows()))


class KeptRecords(RecordFile[SolveRecord]):
    """Records in a folder, by the fingerprint of what was asked."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder / "records.jsonl", "records of wb.solve_many", SolveRecord.of)

    def done(self, asked: str) -> SolveRecord | None:
        """The record of a case; None where there is none, or its process ended, and it is done again."""
        found = self.kept.get(asked)
        return None if found is None or found.outcome in (ENDED, CANCELLED) else found
