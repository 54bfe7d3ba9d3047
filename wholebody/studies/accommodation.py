"""`wb.accommodation`: the share of a population that reaches, fits and sees, and who does not."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from wholebody.base import checks
from wholebody.base.batches import own_child
from wholebody.base.charts import Shown, new_chart
from wholebody.base.errors import InputError, WholebodyError
from wholebody.ergonomics.vision import sight
from wholebody.figures.adjustable import ADJUSTABLE
from wholebody.figures.figure import Figure
from wholebody.methods.base import Method
from wholebody.methods.qp.method import QP
from wholebody.studies.many import Running, SolveProgress, run_cases
from wholebody.studies.populations import people as sampled
from wholebody.studies.records import CANCELLED, ENDED, HELD, REFUSED, Records
from wholebody.studies.study import TaskFunction, Variant, loaded_person, options_of, planned, warn_of_first
from wholebody.studies.study_files import TaskFile
from wholebody.tasks import inputs

REACHED = 1e-3  # m, rad: by which a goal may be missed by somebody who reaches it


class Share(NamedTuple):
    """Share of some people."""

    share: float  # of those that were tried
    # low and high: between which the share of all such people is, at 95 % confidence, were they drawn at random (Wilson
    # 1927). Those of `wb.people` stand for all more closely than that.
    low: float
    high: float
    tried: int  # how many were tried

    def __str__(self) -> str:
        return f"{self.share:.0%} ({self.low:.0%} to {self.high:.0%})"


class Exclusion(NamedTuple):
    """A dimension that tells who is left out."""

    sex: str  # "male" or "female"
    verdict: str  # "reach", "fit" or "see": what they do not
    dimension: str  # its name, see `wb.people`
    side: str  # "over" or "under"
    value: float  # metres (mass: kilograms) over or under which they are
    excluded: int  # how many are left out for it
    lift: float  # share of these that are on that side, less the share of those that are accommodated

    def __str__(self) -> str:
        unit = "kg" if self.dimension == "mass" else "m"
        words = f"{self.dimension.replace('_', ' ')} {self.side} {self.value:.3f} {unit}"
        who = {"male": ("man", "men"), "female": ("woman", "women")}[self.sex]
        said = f"{who[0]} does" if self.excluded == 1 else f"{who[1]} do"
        chance = "" if self.excluded >= 5 else "; of so few, any dimension may do so by chance"
        return f"{self.excluded} {said} not {self.verdict}: {words} tells them best{chance}"


@dataclass(frozen=True, repr=False)
class Accommodation(Shown):
    """How much of a population a task accommodates.

    Attributes:
        records: one for each person.
        sexes: "male" or "female" for each; "" for figures that are no people.
        dimensions: for each person, name to metres (mass: kilograms); empty for figures that are no people.
        reaches: whether each person meets the goals.
        fits: whether each person does so with all distances, limits and constraints kept.
        sees: whether each person sees the point; None where none was given.
        settings: joint of what is adjustable, such as "seat/slide", to its setting for each person, metres or radians;
            NaN for who was refused. Empty where nobody is joined with an adjustable figure.

    Who was refused has no posture, and is neither in shares nor in exclusions; see `tried`.

    Examples:
        >>> def task(figure, target, layout):
        ...     return wb.Problem(wb.Scene(figure), goals=[wb.Point("right_index_tip", (0.3, -0.2, 1.2))])
        >>> wb.accommodation(task, wb.people(1)).fits
        (True, True)
    """

    records: Records
    sexes: tuple[str, ...]
    dimensions: tuple[Mapping[str, float], ...]
    reaches: tuple[bool, ...]
    fits: tuple[bool, ...]
    sees: tuple[bool, ...] | None
    settings: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def tried(self) -> tuple[bool, ...]:
        """Whether each person has a posture; without one the problem was refused, or its process ended."""
        return tuple(one.q is not None for one in self.records)

    @property
    def accommodated(self) -> tuple[bool, ...]:
        """Whether each person reaches, fits and, if asked, sees."""
        seen = (True,) * len(self.fits) if self.sees is None else self.sees
        return tuple(map(all, zip(self.reaches, self.fits, seen, strict=True)))

    @property
    def share(self) -> float:
        """Share of those tried that reach, fit and, if asked, see; NaN where nobody was tried."""
        return self._of_tried(self.accommodated)

    @property
    def by_sex(self) -> dict[str, Share]:
        """The share of each sex of which somebody was tried."""
        found: dict[str, list[bool]] = {}
        for good, sex, tried in zip(self.accommodated, self.sexes, self.tried, strict=True):
            if tried:
                found.setdefault(sex, []).append(good)
        return {sex: _share(good) for sex, good in found.items()}

    @property
    def exclusions(self) -> tuple[Exclusion, ...]:
        """The dimension that best orders those left out and the others, of each sex and verdict, the most first."""
        found, tried = [], self.tried
        for sex in dict.fromkeys(self.sexes):
            for verdict, good in (("reach", self.reaches), ("fit", self.fits), ("see", self.sees or ())):
                own = [k for k, one in enumerate(self.sexes) if one == sex and tried[k] and self.dimensions[k]]
                out = [k for k in own if good and not good[k]]
                rest = [k for k in own if self.accommodated[k]]
                if out and rest:
                    found.append(self._exclusion(sex, verdict, out, rest))
        return tuple(sorted(found, key=lambda one: -one.excluded))

    def plot(self) -> Any:
        """Draw who is left out, a matplotlib figure: stature, and the dimension that tells most of those left out.

        Raises:
            InputError: nobody was tried who has dimensions.
        """
        chart, axes = new_chart(1, 1, (6.0, 3.6))
        axis, worst = axes[0, 0], next(iter(self.exclusions), None)
        other = "mass" if worst is None or worst.dimension == "stature" else worst.dimension
        known = [k for k, tried in enumerate(self.tried) if tried and self.dimensions[k]]
        if not known:
            raise InputError("plot: nobody was tried who has dimensions; give people, such as wb.people(100)")
        for sex, marker in (("female", "o"), ("male", "^")):
            for good, color, words in ((True, "C2", "accommodated"), (False, "C3", "left out")):
                who = [self.dimensions[k] for k in known if self.sexes[k] == sex and self.accommodated[k] == good]
                if who:
                    x, y = [one["stature"] for one in who], [one[other] for one in who]
                    axis.scatter(x, y, color=color, marker=marker, s=18, label=f"{sex}, {words}")
        if worst is not None and worst.dimension in ("stature", other):
            (axis.axvline if worst.dimension == "stature" else axis.axhline)(worst.value, color="0.6", linestyle="--")
        unit = "kg" if other == "mass" else "m"
        axis.set(
            xlabel="stature [m]", ylabel=f"{other.replace('_', ' ')} [{unit}]", title=f"{self.share:.0%} accommodated"
        )
        chart.legend(loc="outside right upper", fontsize="small")
        return chart

    def _of_tried(self, good: tuple[bool, ...]) -> float:
        held = [one for one, tried in zip(good, self.tried, strict=True) if tried]
        return sum(held) / len(held) if held else math.nan

    def _exclusion(self, sex: str, verdict: str, out: list[int], rest: list[int]) -> Exclusion:
        """The dimension that orders people best (Mann and Whitney 1947), and a bound that parts them (Youden 1950)."""
        # where both ends are left out, people are ordered by how far from the middle of the others they are

        def apart(name: str) -> float:
            left, kept = (np.array([self.dimensions[k][name] for k in who]) for who in (out, rest))
            middle = np.median(kept)
            far = np.subtract.outer(np.abs(left - middle), np.abs(kept - middle))
            return max(abs(float(np.sign(np.subtract.outer(left, kept)).mean())), float(np.sign(far).mean()))

        name = max(self.dimensions[out[0]], key=apart)
        left, kept = (np.sort([self.dimensions[k][name] for k in who]) for who in (out, rest))
        values = np.unique(np.concatenate([left, kept]))
        bounds = 0.5 * (values[1:] + values[:-1]) if len(values) > 1 else values
        below = np.searchsorted(left, bounds) / len(left) - np.searchsorted(kept, bounds) / len(kept)
        side, gain = ("under", below) if below.max() >= -below.min() else ("over", -below)
        k = int(gain.argmax())
        return Exclusion(sex, verdict, name, side, float(bounds[k]), len(out), float(gain[k]))

    def __repr__(self) -> str:
        parts = [("reach", self.reaches), ("fit", self.fits), *([("see", self.sees)] if self.sees is not None else [])]
        words = ", ".join(f"{self._of_tried(values):.0%} {name}" for name, values in parts)
        shares = ", ".join(f"{sex} {share}" for sex, share in self.by_sex.items() if sex)
        counts = self.records.counts()
        others = "".join(f", {counts[one]} more {one}" for one in (REFUSED, ENDED, CANCELLED) if one in counts)
        lines = [
            f"Accommodation of {sum(self.tried)} people{others}: {self.share:.0%}" + (f"; {shares}" if shares else "")
        ]
        lines += [f"  {words}{self.records.remarks()}", *(f"  {one}" for one in self.exclusions)]
        for name, values in self.settings.items():
            good = [value for value, held in zip(values, self.accommodated, strict=True) if held]
            if good:
                low, middle, high = np.percentile(good, (5, 50, 95))
                lines.append(
                    f"  {name} {low:.3f} to {high:.3f}, median {middle:.3f} (5th to 95th percentile of people)"
                )
        return "\n".join(lines)


def _share(good: list[bool]) -> Share:
    """Share with Wilson's interval."""
    from scipy.stats import binomtest

    found = binomtest(sum(good), len(good)).proportion_ci(0.95, method="wilson")
    return Share(sum(good) / len(good), float(found.low), float(found.high), len(good))


def accommodation(
    task: TaskFunction | str | os.PathLike[str],
    people: Mapping[str, Any] | None = None,
    *,
    sees: Any = None,
    method: str | Method | None = None,
    jobs: int = 1,
    folder: str | os.PathLike[str] | None = None,
    progress: Callable[[SolveProgress], Any] | bool | None = None,
) -> Accommodation:
    """Solve a task for many people, and count who reaches, fits and sees.

    Each begins at the answer of the one of nearest stature before, and who is not solved from there at the task's
    start, see `study`.

    Args:
        task: a task file, or a function, see `study`; its target and layout are None.
        people: by name, as `wb.people` and `wb.boundary` make them, or as of `study`; `wb.people(100)` if left out.
        sees: (3,) a point that has to be seen without turning the head, metres; None for none.
        method: name or settings, see `study`; if left out with a function, "qp". It leaves out the measures where
            nothing of them is counted, that is, nobody is to see and nothing is adjustable: postures are then possible
            ones, not those that people prefer.
        jobs: people at a time.
        folder: keeps the records, see `solve_many`.
        progress: see `study`.

    Raises:
        InputError: a value of the wrong kind or range, or everybody is refused.
        UnknownNameError: there is no such task file or method.
        FileFormatError: the task file cannot be read.

    Examples:
        >>> def task(figure, target, layout):
        ...     return wb.Problem(wb.Scene(figure), goals=[wb.Point("right_index_tip", (0.3, -0.2, 1.2))])
        >>> wb.accommodation(task, wb.people(1)).reaches  # a woman and a man
        (True, True)
    """
    point = None if sees is None else inputs.point(sees, "accommodation: sees")
    given = sampled(100) if people is None else people
    if not isinstance(given, Mapping) or not given:
        raise InputError(
            f"accommodation: people is {checks.shown(people)}; give {{name: person, ...}}, such as wb.people(100)"
        )
    who = {name: loaded_person(one) for name, one in given.items()}
    order = sorted(who, key=lambda name: ("", 0.0) if (one := who[name]) is None else (one.sex, one.stature))
    population = {name: options_of(given[name]) for name in order}
    make = TaskFile(checks.path(task, "task")) if isinstance(task, (str, os.PathLike)) else task
    variants = [Variant(make, person, None, None) for person in population.values()]
    if method is None and callable(task):
        method = QP(measures=point is not None or _may_have_settings(variants[0]))
    run = partial(Running.checked, "accommodation", jobs=jobs, progress=progress)
    # Who reaches and fits does not depend on how low the measure is: jumps between people are no reason to solve again.
    varied = {"people": population, "targets": None, "layouts": None}
    cases, warm, how, store = planned(task, varied, method, run, True, folder)
    warn_of_first(cases, how.method, 2)
    records = run_cases(cases, warm, how, store, lowers=False)
    if all(one.outcome == REFUSED for one in records):
        raise InputError(f"accommodation: everybody is refused; the first, {records[0].name}: {records[0].message}")
    reaches = tuple(one.q is not None and one.goal_error <= REACHED and one.goal_angle <= REACHED for one in records)
    # m, rad: by which limits, constraints and distances may be violated by somebody who fits
    fits = tuple(one.q is not None and all(getattr(one, held) <= 1e-4 for held in HELD) for one in records)
    seen = None
    if point is not None:
        seen = tuple(  # a problem that failed is not made again
            one.q is not None and sight(variant().scene, one.q, point).seen
            for variant, one in zip(variants, records, strict=True)
        )
    persons = [who[name] for name in order]
    sizes = tuple(
        {} if one is None else {"stature": one.stature, "mass": one.mass, **dict(one.dimensions), **one.built[1]}
        for one in persons
    )
    sexes = tuple("" if one is None else one.sex for one in persons)
    return Accommodation(records, sexes, sizes, reaches, fits, seen, _settings(variants, records))


def _may_have_settings(variant: Variant) -> bool:
    """Whether somebody's scene has what is adjustable; true where it cannot be made, which the records tell."""
    try:  # a task of the user's own can end the process that makes it
        return bool(own_child().call(_has_settings, variant, seconds=0.0))
    except WholebodyError:
        return True


def _has_settings(variant: Variant) -> bool:
    try:
        members = variant().scene.figure.members.values()
    except Exception:  # of a task of the user's own
        return True
    return any(member.figure.name == ADJUSTABLE for member in members)


def _settings(variants: Sequence[Variant], records: Records) -> dict[str, tuple[float, ...]]:
    """Settings of adjustable figures by joint, for each person."""
    found: dict[str, list[float]] = {}
    figures: dict[int, Figure] = {}  # by coordinates: scenes of people differ in sizes, and take long to make
    for k, one in enumerate(records):
        if one.q is None:
            continue
        figure = figures.get(len(one.q)) or figures.setdefault(len(one.q), variants[k]().scene.figure)
        movable = tuple(f"{name}/" for name, member in figure.members.items() if member.figure.name == ADJUSTABLE)
        for joint, value in figure.joint_values(one.q).items() if movable else ():
            if joint.startswith(movable):
                found.setdefault(joint, [math.nan] * len(records))[k] = value
    return {joint: tuple(values) for joint, values in found.items()}
