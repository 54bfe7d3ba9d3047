"""Estimates the joint distribution of people's dimensions: `python -m tests.audits.population ansur2.csv`.

The table has a row for each person and the columns of ANSUR II's public release (US Army 2012): lengths in millimetres,
weightkg in tenths of a kilogram, age in years. Every fourth row of it is kept back to judge with (`judge`); the others
give the two tables "population_male" and "population_female". Only these parameters are in the project.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.files import packaged_table, write
from wholebody.figures.anthropometry import make_person
from wholebody.figures.population import Population, odds
from wholebody.figures.tables import FOLDER, keyed, table

DIMENSIONS = {
    "stature": "stature",
    "mass": "weightkg",
    "age": "age",
    "sitting_height": "sittingheight",
    "eye_height_sitting": "eyeheightsitting",
    "acromial_height": "acromialheight",
    "wrist_height": "wristheight",
    "elbow_rest_height": "elbowrestheight",
    "bideltoid_breadth": "bideltoidbreadth",
    "span": "span",
    "thumb_tip_reach": "thumbtipreach",
    "overhead_reach_sitting": "overheadfingertipreachsitting",
    "forearm_hand_length": "forearmhandlength",
    "buttock_knee_length": "buttockkneelength",
    "buttock_popliteal_length": "buttockpopliteallength",
    "popliteal_height": "poplitealheight",
    "knee_height_sitting": "kneeheightsitting",
    "thigh_clearance": "thighclearance",
    "hip_breadth_sitting": "hipbreadthsitting",
    "hip_breadth": "hipbreadth",
    "chest_breadth": "chestbreadth",
    "chest_depth": "chestdepth",
    "waist_breadth": "waistbreadth",
    "waist_depth": "waistdepth",
    "buttock_depth": "buttockdepth",
    "neck_circumference": "neckcircumference",
    "upper_arm_circumference": "bicepscircumferenceflexed",
    "forearm_circumference": "forearmcircumferenceflexed",
    "wrist_circumference": "wristcircumference",
    "calf_circumference": "calfcircumference",
    "ankle_circumference": "anklecircumference",
    "head_length": "headlength",
    "head_breadth": "headbreadth",
    "hand_length": "handlength",
    "hand_breadth": "handbreadth",
    "foot_length": "footlength",
    "foot_breadth": "footbreadthhorizontal",
}
"""Dimension of the body to the column of the table."""

SCALE = {"mass": 0.1, "age": 1.0}
"""Of the columns that are not in millimetres."""

ENDS = {"age": (16.5, 59.0)}
"""Ends of the dimensions that have some: the ages measured are 17 to 58 completed years."""

ARMS = {
    "shoulder_top": (0.02, 0.02, 0.004, "acromion above the shoulder joint; de Leva 1996b"),
    "upper_arm": (0.165, 0.165, 0.012, "shoulder to elbow joint"),
    "forearm": (0.15, 0.147, 0.008, "elbow to wrist joint; radiale-stylion length"),
    "elbow_back": (0.0155, 0.015, 0.004, "olecranon behind the elbow joint when the elbow is bent"),
    "elbow_below": (0.016, 0.016, 0.006, "skin below the elbow joint when the elbow is bent"),
    "shoulder_y": (0.0945, 0.0897, 0.009, "shoulder joint beside the middle; 0.4 of the biacromial breadth"),
    "shoulder_x": (-0.025, -0.03, 0.025, "shoulder joint before the inner end of the clavicle"),
    "rise": (0.065, 0.06, 0.035, "of the shoulder joint in an overhead reach"),
}
"""Sizes of the arms: estimates, as fractions of the stature of men and women; standard deviation, metres; meaning."""


def people(path: Path, kept_back: bool) -> dict[str, dict[str, Array]]:
    """Return the people of a table by sex, a column (n,) for each dimension: those kept back, or the others."""
    rows = packaged_table(path)
    chosen = [row for number, row in enumerate(rows) if (number % 4 == 0) is kept_back]
    return {
        sex: {
            name: np.array([float(row[column]) * SCALE.get(name, 1e-3) for row in chosen if row["sex"] == letter])
            for name, column in DIMENSIONS.items()
        }
        for sex, letter in (("male", "M"), ("female", "F"))
    }


def estimated(columns: Mapping[str, Array]) -> list[list[str]]:
    """Return the rows of a sex's table, headings first."""
    from scipy.stats import boxcox_normmax

    rows, deviates = [], []
    for name, measured in columns.items():
        low, high = ENDS.get(name, (0.0, np.inf))
        x = odds(measured, low, high)
        # Exponents beyond these put the end of the distribution near people.
        power = round(float(np.clip(boxcox_normmax(x / np.median(x), method="mle"), -2.0, 3.0)), 3)
        centre = float(np.exp(np.log(x).mean())) if power == 0.0 else float((x**power).mean() ** (1.0 / power))
        ratio = x / centre
        plain = np.log(ratio) if power == 0.0 else (ratio**power - 1.0) / power
        rows.append(
            [name, DIMENSIONS[name], f"{low:g}", f"{high:g}", f"{centre:.6g}", f"{power:g}", f"{plain.std():.6g}"]
        )
        deviates.append(plain)
    correlation = np.corrcoef(deviates)
    heading = ["name", "ansur", "low", "high", "centre", "exponent", "spread", *columns]
    return [
        heading,
        *([*row, *(f"{value:.4f}" for value in line)] for row, line in zip(rows, correlation, strict=True)),
    ]


def arm_rows(usual: Mapping[str, tuple[float, float]]) -> str:
    """Return the text of the table "arm_sizes", with fractions of the stature of men and women."""
    out = io.StringIO()
    out.write(
        "# Written by tests.audits.population: fractions of the stature; standard deviations in metres (estimates).\n"
    )
    rows = [[name, *(f"{value:.6g}" for value in usual[name]), own[2], own[3]] for name, own in ARMS.items()]
    csv.writer(out, lineterminator="\n").writerows([["name", "male", "female", "spread", "meaning"], *rows])
    return out.getvalue()


def write_arms() -> None:
    """Write the table "arm_sizes": the sizes nearest to the estimates that give median people their dimensions."""
    write(FOLDER / "arm_sizes.csv", arm_rows({name: own[:2] for name, own in ARMS.items()}))
    keyed.cache_clear()
    table.cache_clear()
    found = {}
    for sex in ("male", "female"):
        likely = make_person(sex)
        met = replace(likely, stated=tuple(name for name, _ in likely.dimensions))
        found[sex] = {name: met.size(name) / met.stature for name in ARMS}
    write(FOLDER / "arm_sizes.csv", arm_rows({name: (found["male"][name], found["female"][name]) for name in ARMS}))


def judge(path: Path, sex: str) -> dict[str, float]:
    """Compare the distribution with the people kept back.

    Returns:
        Largest difference of a share below a kept-back percentile (5 to 95); the root mean square error of shares that
        are at most a quartile in two dimensions, that of the table's other rows, and the standard error that kept-back
        shares have themselves; the largest root mean square error, over that of a linear regression on the same
        dimensions, of the dimensions given stature and mass, and given these and six more; share of these people whose
        dimensions are refused.
    """
    own, other = people(path, False)[sex], people(path, True)[sex]
    whole = Population(sex)
    share = 0.0
    blur = np.random.default_rng(0).uniform(-0.5, 0.5, len(other["age"]))
    for name, exact in other.items():
        x = exact + blur * SCALE.get(name, 1e-3)  # all were rounded
        for part in (0.05, 0.25, 0.5, 0.75, 0.95):
            share = max(share, abs(float((x <= whole.quantile(name, part)).mean()) - part))
    found = {"share": share, **_pairs(own, other, whole)}
    size = ("stature", "mass")
    six = ("sitting_height", "bideltoid_breadth", "span", "hip_breadth_sitting", "popliteal_height", "foot_length")
    for given in (size, (*size, *six)):
        ratios = []
        likely = [whole.likely({name: float(other[name][k]) for name in given}) for k in range(len(other["age"]))]
        for name in DIMENSIONS:
            if name in (*given, "age"):
                continue
            rows, rest = (
                np.column_stack([*(part[n] for n in given), np.ones(len(part["age"]))]) for part in (own, other)
            )
            line = np.linalg.lstsq(rows, own[name], rcond=None)[0]
            usual = np.sqrt(np.mean((rest @ line - other[name]) ** 2))
            ratios.append(np.sqrt(np.mean((np.array([one[name] for one in likely]) - other[name]) ** 2)) / usual)
        found[f"given {len(given)}"] = float(max(ratios))
    refused = 0
    for k in range(len(other["age"])):
        values = {name: float(column[k]) for name, column in other.items() if name not in size}
        refused += whole.unlikely(values, {name: float(other[name][k]) for name in size}) is not None
    found["refused"] = refused / len(other["age"])
    return found


def _pairs(own: Mapping[str, Array], other: Mapping[str, Array], whole: Population) -> dict[str, float]:
    """Errors of shares in two dimensions, of the distribution and of the table's other rows."""
    sample = whole.sample(8192, np.random.default_rng(0))
    drawn = {name: np.array([one[name] for one in sample]) for name in other}
    ends = {  # half a unit above, as the table is rounded
        name: np.quantile(column, (0.25, 0.5, 0.75)) + 0.5 * SCALE.get(name, 1e-3)
        for name, column in other.items()
        if name != "age"
    }

    def shares(of: Mapping[str, Array]) -> Array:
        below = np.stack([of[name][:, None] <= ends[name] for name in ends]).astype(float)
        both = np.einsum("ipa,jpb->ijab", below, below) / below.shape[1]
        return np.asarray(both[np.triu_indices(len(ends), 1)])

    kept = shares(other)
    errors = {"pairs": shares(drawn) - kept, "pairs of rows": shares(own) - kept}
    noise = float(np.sqrt(np.mean(kept * (1.0 - kept)) / len(other["age"])))
    return {name: float(np.sqrt(np.mean(one**2))) for name, one in errors.items()} | {"pairs' standard error": noise}


def main(path: Path) -> None:
    """Write both tables and print how they do on the people kept back."""
    for sex, columns in people(path, False).items():
        out = io.StringIO()
        out.write("# Written by tests.audits.population from ANSUR II (US Army 2012, approved for public release): ")
        out.write(f"{len(columns['age'])} {'men' if sex == 'male' else 'women'}; metres, kilograms, years.\n")
        csv.writer(out, lineterminator="\n").writerows(estimated(columns))
        write(FOLDER / f"population_{sex}.csv", out.getvalue())
    write_arms()
    for sex in ("male", "female"):
        for name, value in judge(path, sex).items():
            sys.stdout.write(f"{sex} {name} {value:.4f}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
