"""The joint distribution of people's dimensions: percentiles of all of ANSUR II, and its own algebra."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from tests.audits.population import people
from wholebody.figures.population import population

NAMES = {
    "stature": "stature",
    "mass": "mass",
    "acromialheight": "acromial_height",
    "sittingheight": "sitting_height",
    "span": "span",
    "bideltoidbreadth": "bideltoid_breadth",
    "chestbreadth": "chest_breadth",
    "waistbreadth": "waist_breadth",
    "waistdepth": "waist_depth",
    "hipbreadth": "hip_breadth",
    "handlength": "hand_length",
    "footlength": "foot_length",
}


def percentiles(sex: str) -> list[tuple[str, float, float, dict[float, float]]]:
    """Dimension, scale, standard deviation and values by share, of all men or women of ANSUR II."""
    text = (Path(__file__).parents[1] / "data" / "ansur_percentiles.csv").read_text()
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    found = []
    for row in rows:
        if row["sex"] == sex[0].upper() and row["dim"] in NAMES:
            scale = 0.01 if row["unit"] == "cm" else 1.0
            values = {float(f"0.{share}"): scale * float(row[f"p{share}"]) for share in ("05", "25", "50", "75", "95")}
            found.append((NAMES[row["dim"]], scale, scale * float(row["sd"]), values))
    return found


@pytest.mark.parametrize("sex", ["male", "female"])
def test_quantiles_are_those_of_all_people(sex: str) -> None:
    rows = percentiles(sex)
    assert len(rows) >= 8
    for name, _, deviation, values in rows:
        for share, value in values.items():
            found = population(sex).quantile(name, share)
            assert found == pytest.approx(value, abs=0.15 * deviation), (name, share)


@pytest.mark.parametrize("sex", ["male", "female"])
def test_a_sample_has_the_tails_of_people_kept_back(sex: str, shared_data: Path) -> None:
    path = shared_data.parent / "human" / "ansur2.csv"
    if not path.exists():
        pytest.skip("needs the table of ANSUR II, which is not in the project")
    drawn, kept = population(sex).sample(2048, np.random.default_rng(5)), people(path, True)[sex]
    for name, column in kept.items():
        found = np.quantile([one[name] for one in drawn], (0.01, 0.05, 0.5, 0.95, 0.99))
        off = (found - np.quantile(column, (0.01, 0.05, 0.5, 0.95, 0.99))) / column.std()
        # Three standard errors of the percentiles of 372 people of a normal distribution are 0.6, 0.33 and 0.2 standard
        # deviations; of an upper tail as heavy as that of girths, half as much again.
        assert (np.abs(off) <= (0.6, 0.33, 0.2, 0.33, 0.9)).all(), (name, off)


@pytest.mark.parametrize("sex", ["male", "female"])
def test_nobody_is_older_or_younger_than_the_table(sex: str) -> None:
    ages = [one["age"] for one in population(sex).sample(8192, np.random.default_rng(6))]
    assert 16.5 <= min(ages) < 18.0
    assert 54.0 < max(ages) < 59.0
    # Older than anybody in the table is what the oldest are, not what a trend would make of them.
    waists = [population(sex).likely({"stature": 1.7, "mass": 75.0, "age": age})["waist_depth"] for age in (59.0, 69.0)]
    assert waists[0] == waists[1]


def test_what_is_likely_is_the_regression_on_what_is_given() -> None:
    whole = population("female")
    rng = np.random.default_rng(7)
    deviates = rng.multivariate_normal(np.zeros(len(whole.names)), whole.correlation, size=100_000, method="svd")
    which = [whole.names.index(name) for name in ("span", "sitting_height", "mass")]
    slopes = np.linalg.lstsq(deviates[:, which], deviates, rcond=None)[0]
    given = np.array([1.2, -0.7, 0.4])
    values = whole.values(given @ slopes)
    stated = {whole.names[k]: values[whole.names[k]] for k in which}
    for name, value in whole.likely(stated).items():
        assert value == pytest.approx(values[name], rel=2e-3), name


@pytest.mark.parametrize("sex", ["male", "female"])
def test_a_sample_has_the_shares_and_the_correlations_of_all(sex: str) -> None:
    whole = population(sex)
    drawn = whole.sample(200, np.random.default_rng(3))
    columns = {name: np.array([one[name] for one in drawn]) for name in whole.names}
    for name, column in columns.items():
        for share in (0.05, 0.3, 0.9):
            assert (column < whole.quantile(name, share)).mean() == pytest.approx(share, abs=0.006)
    found = np.corrcoef([[whole.deviates({name: x})[1][0] for x in columns[name]] for name in whole.names])
    assert np.abs(found - whole.correlation).max() < 0.17
    assert np.abs(found - whole.correlation).mean() < 0.03


def test_nine_tenths_are_within_the_boundary_that_says_so() -> None:
    whole, names = population("male"), ("sitting_height", "hip_breadth_sitting", "popliteal_height")
    people = whole.boundary(names, 0.9)
    assert len(people) == 1 + 6 + 8
    which = [whole.names.index(name) for name in names]
    correlation = whole.correlation[np.ix_(which, which)]
    deviates = np.array([whole.deviates({name: one[name] for name in names})[1] for one in people])
    apart = np.einsum("ij,ij->i", deviates, np.linalg.solve(correlation, deviates.T).T)
    assert apart[0] == pytest.approx(0.0, abs=1e-12)
    assert apart[1:] == pytest.approx(np.full(14, 6.251), abs=1e-3)  # chi-square of three variables, 90 %


def test_dimensions_that_nobody_has_together_are_told() -> None:
    whole, size = population("male"), {"stature": 1.755, "mass": 84.6}
    assert whole.unlikely({"sitting_height": 0.93}, size) is None
    name, off, low, high = whole.unlikely({"sitting_height": 1.1}, size) or ("", 0.0, 0.0, 0.0)
    assert name == "sitting_height"
    assert 6.0 < off < 10.0  # 22 mm of standard deviation about 0.918 m
    assert low < 0.93 < high < 1.1
    # Each is usual, but nobody's eyes are 0.2 m below the vertex.
    assert whole.unlikely({"sitting_height": 0.97, "eye_height_sitting": 0.77}, size) is not None
