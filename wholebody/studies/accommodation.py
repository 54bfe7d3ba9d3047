"""`wb.accommodation`: the share of a population that reaches, fits and sees."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtri

from wholebody.base import checks
from wholebody.base.errors import InputError
from wholebody.ergonomics.vision import sight
from wholebody.figures.anthropometry import STATURE, table
from wholebody.methods.base import Method
from wholebody.studies.many import SolveProgress
from wholebody.studies.records import Records
from wholebody.studies.study import TaskFunction, Variant, study
from wholebody.studies.study_files import TaskFile
from wholebody.tasks import inputs

SEXES = {"male": "M", "female": "F"}
REACHED = 1e-3  # m, rad: by which a goal may be missed by somebody who reaches it


@dataclass(frozen=True)
class Accommodation:
    """How much of a population a task accommodates.

    Attributes:
        records: one for each person, by sex and percentile of stature.
        reaches: whether each person meets the goals.
        fits: whether each person does so without overlap and with all constraints.
        sees: whether each person sees the point; None where none was given.
    """

    records: Records
    reaches: tuple[bool, ...]
    fits: tuple[bool, ...]
    sees: tuple[bool, ...] | None

    @property
    def share(self) -> float:
        """Share of the people that reach, fit and, if asked, see."""
        good = np.array(self.reaches) & np.array(self.fits)
        return float((good if self.sees is None else good & np.array(self.sees)).mean())

    def __repr__(self) -> str:
        parts = [("reach", self.reaches), ("fit", self.fits), *([("see", self.sees)] if self.sees is not None else [])]
        words = ", ".join(f"{np.mean(values):.0%} {name}" for name, values in parts)
        return f"Accommodation of {len(self.records)} people: {self.share:.0%}\n  {words}{self.records.remarks()}"


def people(count: int = 9, sexes: Sequence[str] = ("male", "female")) -> dict[str, dict[str, Any]]:
    """People who stand for a population: for each sex, equally many of equal shares of the statures.

    The statures are the middles of equal shares of a normal distribution with mean and deviation of ANSUR II.

    Args:
        count: for each sex.
        sexes: "male", "female" or both.

    Returns:
        Name such as "female P25" to options of `wb.load("human")`.

    Raises:
        InputError: a value of the wrong kind or range.
    """
    count = checks.whole(count, "people: count", 1, 10_000)  # most people
    found = {}
    for sex in checks.listed(sexes, "people: sexes", "['male', 'female']"):
        checks.choice(sex, SEXES, "people: a sex")
        mean, deviation = _statures(sex)
        for k in range(count):
            part = (k + 0.5) / count
            stature = float(np.clip(mean + deviation * ndtri(part), STATURE.low, STATURE.high))
            found[f"{sex} P{100.0 * part:.3g}"] = {"sex": sex, "stature": stature}
    if not found:
        raise InputError("people: sexes is empty; give 'male', 'female' or both")
    return found


def accommodation(
    task: TaskFunction | str | os.PathLike[str],
    *,
    sees: Any = None,
    count: int = 9,
    sexes: Sequence[str] = ("male", "female"),
    method: str | Method | None = None,
    jobs: int = 1,
    folder: str | os.PathLike[str] | None = None,
    progress: Callable[[SolveProgress], Any] | None = None,
) -> Accommodation:
    """Solve a task for people of all statures, and count who reaches, fits and sees.

    Who is not solved from the task's start is tried from the answers of people of neighbouring statures, see `study`.

    Args:
        task: a task file, or a function, see `study`; its target and layout are None.
        sees: (3,) a point that has to be seen without turning the head, metres; None for none.
        count: people of each sex; their statures stand for equal shares of the population.
        sexes: of the population, in equal shares.
        method: name or settings, see `study`.
        jobs: people at a time.
        folder: keeps the records, see `solve_many`.
        progress: see `study`.

    Raises:
        InputError: a value of the wrong kind or range.
        UnknownNameError: there is no such task file or method.
        FileFormatError: the task file cannot be read.
    """
    point = None if sees is None else inputs.point(sees, "accommodation: sees")
    population = people(count, sexes)
    records = study(task, people=population, method=method, jobs=jobs, folder=folder, progress=progress)
    reaches = tuple(one.q is not None and one.goal_error <= REACHED and one.goal_angle <= REACHED for one in records)
    # m, rad: by which limits, constraints and distances may be violated by somebody who fits
    fits = tuple(
        one.q is not None
        and all(missed <= 1e-4 for missed in (one.penetration, one.limit_violation, one.constraint_violation))
        for one in records
    )
    seen = None
    if point is not None:
        make = TaskFile(checks.path(task, "task")) if isinstance(task, (str, os.PathLike)) else task
        variants = [Variant(make, person, None, None) for person in population.values()]
        seen = tuple(  # a problem that failed is not made again
            one.q is not None and sight(variant().scene, one.q, point).seen
            for variant, one in zip(variants, records, strict=True)
        )
    return Accommodation(records, reaches, fits, seen)


def _statures(sex: str) -> tuple[float, float]:
    """Mean and standard deviation of the stature, metres."""
    for row in table("percentiles"):
        values = list(row.values())
        if values[0].startswith("ANSUR") and values[1] == SEXES[sex] and values[2] == "stature":
            return 0.01 * float(values[5]), 0.01 * float(values[6])
    raise InputError("people: the tables have no statures")
