"""Fits the sizes of the person to ANSUR II: `python -m wholebody.figures.fit` writes the tables "fit" and "residuals".

Every fitted size is linear in one variable of the body: lengths in stature, thicknesses in sqrt(mass / stature). Hand,
foot and eyes have one dimension each and are fitted to it. The others are chosen together, for each sex, so that the
fifteen dimensions of `wholebody.figures.measuring` come out right at the 5th, 50th and 95th percentile: least squares
in the values at the 5th and 95th, in units of `TOLERANCE`, with a weak pull towards `PRIORS`.
"""

from __future__ import annotations

import csv
import io
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.files import write
from wholebody.figures.anthropometry import FOLDER, Person, design_cases, table
from wholebody.figures.body_spec import BodySpec, geometry_of, model_of
from wholebody.figures.dimensions import Dimensions
from wholebody.figures.human import capsules
from wholebody.figures.measuring import ansur, measure

TOLERANCE = 0.005
"""Metres: a dimension that is off by this counts as one unit of the fit."""


PERCENTILES = (5, 50, 95)


class Prior(NamedTuple):
    """What a size is without the fit.

    Attributes:
        man, woman: fraction of the stature, or of sqrt(mass / stature) for thicknesses.
        spread: metres by which it may differ before that counts as one unit.
        thick: whether it is a thickness.
        meaning: of the size, and where the fractions come from.
    """

    man: float
    woman: float
    spread: float
    thick: bool
    meaning: str


PRIORS: Mapping[str, Prior] = {
    "thigh": Prior(0.2390, 0.2439, 0.010, False, "hip to knee centre; trochanterion and epicondyle heights (ANSUR II)"),
    "shank": Prior(0.2384, 0.2395, 0.010, False, "knee to ankle centre; epicondyle and malleolus heights (ANSUR II)"),
    "upper_arm": Prior(0.1618, 0.1586, 0.010, False, "shoulder to elbow centre; de Leva 1996"),
    "forearm": Prior(0.1525, 0.1482, 0.006, False, "elbow to wrist centre; radiale-stylion length (ANSUR II)"),
    "shoulder_x": Prior(-0.020, -0.020, 0.010, False, "shoulder centre forward of the clavicle's inner end; estimate"),
    "shoulder_y": Prior(
        0.0869, 0.0807, 0.006, False, "shoulder centre lateral of the clavicle's inner end; biacromial"
    ),
    "shoulder_z": Prior(-0.0167, -0.0146, 0.006, False, "shoulder centre above the clavicle's inner end; acromion"),
    "shoulder_top": Prior(0.020, 0.020, 0.010, False, "acromion above the shoulder centre; de Leva 1996b"),
    "deltoid": Prior(0.0117, 0.0117, 0.030, True, "skin lateral of the shoulder centre; estimate"),
    "elbow_back": Prior(0.0043, 0.0043, 0.010, True, "olecranon behind the elbow centre, elbow bent; estimate"),
    "seat": Prior(0.0107, 0.0123, 0.020, True, "seat below the hip centre; sitting height"),
    "thigh_top": Prior(0.0153, 0.0137, 0.020, True, "top of the thigh above the hip centre, sitting; thigh clearance"),
    "hip_side": Prior(0.0150, 0.0180, 0.030, True, "skin of the sitting person lateral of the hip centre"),
    "knee_front": Prior(0.0094, 0.0094, 0.020, True, "front of the knee before its centre; lower thigh circumference"),
    "buttock": Prior(0.0205, 0.0205, 0.030, True, "buttock behind the hip centre; buttock depth (ANSUR II)"),
}

DIRECT: Mapping[str, tuple[str, str]] = {
    "hand": ("handlength", "wrist centre to the end of the middle finger's skin, stretched"),
    "hand_breadth": ("handbreadth", "across the knuckles"),
    "foot_length": ("footlength", "heel to the longest toe"),
    "eye": ("eye_below_vertex", "eyes below the vertex"),
}
"""Sizes that are one dimension of ANSUR II: the dimension, and what it is."""


def fit() -> tuple[list[list[str]], list[list[str]]]:
    """Return the rows of the tables "fit" and "residuals", headings first."""
    coefficients = {sex: _fit_sex(sex) for sex in ("male", "female")}
    rows = [["name", "M_c0", "M_cq", "M_cH", "F_c0", "F_cq", "F_cH", "meaning"]]
    for name in coefficients["male"]:
        meaning = PRIORS[name].meaning if name in PRIORS else f"{DIRECT[name][1]}; {DIRECT[name][0]} (ANSUR II)"
        numbers = [f"{value:.6g}" for sex in ("male", "female") for value in coefficients[sex][name]]
        rows.append([name, *numbers, meaning])
    cases = design_cases()
    left = {}
    for case, person in cases.items():
        own = coefficients[person.sex]
        moved = tuple((name, _value(own[name], person) - person.fitted(name)) for name in own)
        found, wanted = measured(person, moved), ansur(person.sex, int(case[1:]))
        left[case] = {name: found[name] - wanted[name] for name in wanted}
    residuals = [["name", *cases]]
    residuals += [[name, *(f"{left[case][name]:.4f}" for case in cases)] for name in left["M50"]]
    return rows, residuals


def measured(person: Person, deviations: tuple[tuple[str, float], ...] = ()) -> dict[str, float]:
    """Return the dimensions of a person, metres, with some of the fitted sizes changed."""
    from wholebody.figures.human.spec import human_spec

    person = Person(person.sex, person.stature, person.mass, deviations)
    spec: BodySpec = human_spec(person)
    model = model_of(spec)
    geometry = geometry_of(model, capsules.solids(Dimensions(person)), ())

    def with_joints(q: Array, values: Mapping[str, float]) -> Array:
        q = q.copy()
        for name, value in values.items():
            q[model.joints[model.getJointId(name)].idx_q] = value
        return q

    return measure(SimpleNamespace(model=model, geometry=geometry, with_joints=with_joints))


def _fit_sex(sex: str) -> dict[str, tuple[float, float, float]]:
    """The coefficients (c0, cq, cH) of every size."""
    from scipy.optimize import least_squares

    column = "M" if sex == "male" else "F"
    people = [design_cases()[f"{column}{percentile}"] for percentile in PERCENTILES]
    direct = {name: _line(people, _percentiles(column, dimension)) for name, (dimension, _) in DIRECT.items()}
    names = list(PRIORS)
    prior = np.array([[_prior(name, person) for name in names] for person in (people[0], people[-1])])
    spread = np.array([PRIORS[name].spread for name in names])
    wanted = [ansur(sex, percentile) for percentile in PERCENTILES]

    def lines(ends: Array) -> dict[str, tuple[float, float, float]]:
        low, high = ends.reshape(2, -1)
        return direct | {
            name: _through(people[0], people[-1], low[k], high[k], PRIORS[name].thick) for k, name in enumerate(names)
        }

    def residuals(ends: Array) -> Array:
        coefficients, off = lines(ends), []
        for person, dimensions in zip(people, wanted, strict=True):
            moved = tuple((name, _value(line, person) - person.fitted(name)) for name, line in coefficients.items())
            found = measured(person, moved)
            # Metres, for the overhead reach: how far people stretch varies more than their bones.
            off += [
                (found[name] - value) / (0.010 if name == "overhead_reach_sitting" else TOLERANCE)
                for name, value in dimensions.items()
            ]
        pull = (ends.reshape(2, -1) - prior) / spread
        return np.concatenate([off, pull.ravel()])

    return lines(least_squares(residuals, prior.ravel(), diff_step=1e-4, max_nfev=8).x)


def _prior(name: str, person: Person) -> float:
    prior = PRIORS[name]
    return (prior.man if person.sex == "male" else prior.woman) * _variable(person, prior.thick)


def _variable(person: Person, thick: bool) -> float:
    return math.sqrt(person.mass / person.stature) if thick else person.stature


def _value(line: tuple[float, float, float], person: Person) -> float:
    return line[0] + line[1] * _variable(person, True) + line[2] * person.stature


def _through(first: Person, last: Person, low: float, high: float, thick: bool) -> tuple[float, float, float]:
    """The line that has two values at two people."""
    a, b = _variable(first, thick), _variable(last, thick)
    slope = (high - low) / (b - a)
    return (low - slope * a, slope, 0.0) if thick else (low - slope * a, 0.0, slope)


def _line(people: list[Person], values: list[float]) -> tuple[float, float, float]:
    """The line in stature nearest to three values."""
    slope, start = np.polyfit([person.stature for person in people], values, 1)
    return float(start), 0.0, float(slope)


def _percentiles(column: str, dimension: str) -> list[float]:
    for row in table("percentiles"):
        if row["sex"] == column and row["dim"] == dimension:
            return [0.01 * float(row[f"p{percentile:02d}"]) for percentile in PERCENTILES]
    row = next(row for row in table("dimensions") if row["name"] == dimension)
    return [float(row[f"{column}{percentile}"]) for percentile in PERCENTILES]


def _text(rows: list[list[str]], remark: str) -> str:
    out = io.StringIO()
    out.write(f"# {remark}\n")
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()


def main(folder: Path = FOLDER) -> None:
    """Write both tables and print the residuals in millimetres."""
    rows, residuals = fit()
    form = "metres: c0 + cq sqrt(mass / stature) + cH stature, with mass in kg and stature in m"
    write(folder / "fit.csv", _text(rows, f"Written by wholebody.figures.fit; {form}."))
    write(folder / "residuals.csv", _text(residuals, "Written by wholebody.figures.fit; model less ANSUR II, metres."))
    for name, *numbers in residuals:
        shown = numbers if name == "name" else [f"{1e3 * float(number):.0f}" for number in numbers]
        sys.stdout.write(f"{name:24s} {' '.join(f'{text:>5s}' for text in shown)}\n")


if __name__ == "__main__":
    main()
