"""Fits the sizes of the person to ANSUR II: `python -m tests.audits.sizes` writes the tables "fit" and "residuals".

Every fitted size is linear in one variable of the body: lengths in stature, thicknesses in sqrt(mass / stature). Hand,
foot and eyes have one dimension each and are fitted to it. The others are chosen together, for each sex, so that the
fifteen dimensions of `wholebody.figures.measuring` come out right at the 5th, 50th and 95th percentile: least squares
in the values at the 5th and 95th, in units of `TOLERANCE`, with a weak pull towards the table "priors".
"""

from __future__ import annotations

import csv
import io
import math
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from wholebody.base.arrays import Array
from wholebody.base.files import write
from wholebody.figures.anthropometry import FOLDER, Person, design_cases, keyed, table
from wholebody.figures.measuring import TOLERANCE, ansur, measured

PERCENTILES = (5, 50, 95)
PRIORS = keyed("priors", "name")

DIRECT = {
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
        meaning = PRIORS[name]["meaning"] if name in PRIORS else f"{DIRECT[name][1]}; {DIRECT[name][0]} (ANSUR II)"
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


def _fit_sex(sex: str) -> dict[str, tuple[float, float, float]]:
    """The coefficients (c0, cq, cH) of every size."""
    column = "M" if sex == "male" else "F"
    people = [design_cases()[f"{column}{percentile}"] for percentile in PERCENTILES]
    direct = {name: _line(people, _percentiles(column, dimension)) for name, (dimension, _) in DIRECT.items()}
    names = list(PRIORS)
    prior = np.array([[_prior(name, person) for name in names] for person in (people[0], people[-1])])
    spread = np.array([float(PRIORS[name]["spread"]) for name in names])
    wanted = [ansur(sex, percentile) for percentile in PERCENTILES]

    def lines(ends: Array) -> dict[str, tuple[float, float, float]]:
        low, high = ends.reshape(2, -1)
        return direct | {
            name: _through(people[0], people[-1], low[k], high[k], PRIORS[name]["thick"] == "1")
            for k, name in enumerate(names)
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
    return float(prior[person.column]) * _variable(person, prior["thick"] == "1")


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
    write(folder / "fit.csv", _text(rows, f"Written by tests.audits.sizes; {form}."))
    write(folder / "residuals.csv", _text(residuals, "Written by tests.audits.sizes; model less ANSUR II, metres."))
    for name, *numbers in residuals:
        shown = numbers if name == "name" else [f"{1e3 * float(number):.0f}" for number in numbers]
        sys.stdout.write(f"{name:24s} {' '.join(f'{text:>5s}' for text in shown)}\n")


if __name__ == "__main__":
    main()
