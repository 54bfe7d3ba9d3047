"""People of their own proportions: dimensions that are stated are met, the others follow as they go together in people.

At a given stature and mass, dimensions differ from those of most people by a normal deviate of several variables, whose
covariance is ANSUR II's: standard deviations of the whole survey, correlations of the table "correlations". The most
likely other dimensions are the conditional mean (e.g. Eaton 1983, "Multivariate Statistics", section 3.4). Then the
sizes of the body (`Person.fitted`) are changed until its dimensions, measured on the model, are those.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, lru_cache

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import known, shown
from wholebody.base.errors import InputError
from wholebody.base.fields import Range
from wholebody.figures.anthropometry import Person, keyed, table
from wholebody.figures.measuring import TOLERANCE, measured

DIMENSION = Range(0.0, 3.0, "m")

FARTHEST = 4.0
"""Standard deviations beyond which nobody is made: one in 16,000 people is outside."""

SIZES = {"hand_length": "hand", "hand_breadth": "hand_breadth", "foot_length": "foot_length"}
"""Dimensions that are sizes of the body themselves, with the names of the sizes. Others are measured."""


def dimension_names() -> tuple[str, ...]:
    """Return the names of the dimensions that can be stated."""
    return (*(row["name"] for row in table("dimensions")), *SIZES)


def proportioned(person: Person, proportions: Mapping[str, float] | None) -> Person:
    """Return a person with stated dimensions, metres by the names of `dimension_names`, of the same stature and mass.

    Raises:
        InputError: a dimension that nobody of this stature and mass has, or dimensions that do not go together.
        UnknownNameError: an unknown dimension.
    """
    if proportions is None:
        return person
    if not isinstance(proportions, Mapping):
        raise InputError(f"proportions is {shown(proportions)}; give metres by dimension: {{'sitting_height': 0.93}}")
    names = dimension_names()
    stated = {
        known(name, names, "dimension", "proportions"): DIMENSION(value, f"proportions: {name}")
        for name, value in proportions.items()
    }
    return _proportioned(person, tuple(sorted(stated.items()))) if stated else person


@lru_cache(maxsize=64)
def _proportioned(person: Person, stated: tuple[tuple[str, float], ...]) -> Person:
    names = dimension_names()
    usual = _measured(replace(person, age=None))
    which = [names.index(name) for name, _ in stated]
    change = likely_change(person, which, np.array([value - usual[name] for name, value in stated]))
    wanted = {name: usual[name] + float(change[k]) for k, name in enumerate(names)}
    sizes = {size: wanted[name] - usual[name] for name, size in SIZES.items()}
    sizes["eye"] = wanted["eye_below_vertex"] - usual["eye_below_vertex"]
    fixed = {name for name, _ in stated}
    made = _sized(person, sizes, {name: wanted[name] for name in names if name not in SIZES}, fixed)
    found = _measured(made)
    for name, value in stated:
        # metres within which a stated dimension must be met.
        if abs(found[name] - value) > 0.001:
            raise InputError(
                f"proportions: {name} {value:g} m is out of the model's reach with the other dimensions and stature "
                f"{person.stature:g} m, it comes to {found[name]:.3f} m; give that or leave one dimension out"
            )
    return made


def likely_change(person: Person, which: list[int], change: Array) -> Array:
    """Return by how much all dimensions (n,) differ from those usual for a person's stature and mass, metres.

    Given is the change (k,) of some, by their indices (k,) in `dimension_names`.

    Raises:
        InputError: the differences are those of nobody.
    """
    names, covariance = dimension_names(), residual_covariance(person.column)
    spread = np.sqrt(np.diag(covariance))[which]
    people = f"{'men' if person.column == 'M' else 'women'} of {person.stature:g} m and {person.mass:.3g} kg"
    usual = _measured(replace(person, age=None, deviations=()))
    for k, deviation in enumerate(change / spread):
        if abs(deviation) > FARTHEST:
            name = names[which[k]]
            low, high = (usual[name] + side * FARTHEST * spread[k] for side in (-1.0, 1.0))
            raise InputError(
                f"proportions: {name} {usual[name] + change[k]:g} m is {abs(deviation):.1f} standard deviations from "
                f"that of {people}; give {low:.3f} to {high:.3f} m or another stature"
            )
    from scipy.special import chdtri, ndtr  # loading it takes longer than loading a person, and few are asked for so

    # Metres by which two measurements of one person differ: it keeps dimensions that almost determine each other, such
    # as sitting height, eye height and their difference, from contradicting by a millimetre (estimate).
    given = covariance[np.ix_(which, which)] + 0.002**2 * np.eye(len(which))
    gains = np.linalg.solve(given, change)
    if change @ gains > chdtri(len(which), 2.0 * ndtr(-FARTHEST)):
        raise InputError(
            f"proportions: {', '.join(names[k] for k in which)} do not go together in {people}: fewer than one in "
            "16,000 differ so much; change one or leave one out"
        )
    found = covariance[:, which] @ gains
    found[which] = change
    return np.asarray(found)


@cache
def residual_covariance(column: str) -> Array:
    """Return the covariance (n, n) of the dimensions of people of one stature and mass and a sex, "M" or "F", m^2."""
    rows = table("correlations")
    names = [row["name"] for row in rows]
    correlation = np.array([[float(row[name]) for name in names] for row in rows])
    spread = np.array([_spread(row["name"], row["ansur"], column) for row in rows])
    full = correlation * np.outer(spread, spread)
    size, rest = slice(0, 2), slice(2, None)
    left = full[rest, rest] - full[rest, size] @ np.linalg.solve(full[size, size], full[size, rest])
    # The eyes below the vertex are the difference of two others.
    place = {name: k for k, name in enumerate(names[2:])}
    pick = np.zeros((len(dimension_names()), len(place)))
    for k, name in enumerate(dimension_names()):
        if name in place:
            pick[k, place[name]] = 1.0
        else:
            pick[k, place["sitting_height"]], pick[k, place["eye_height_sitting"]] = 1.0, -1.0
    return np.asarray(pick @ left @ pick.T)


def _spread(name: str, dimension: str, column: str) -> float:
    """Standard deviation in ANSUR II: metres, for the mass kilograms."""
    dimension = "mass" if name == "mass" else dimension
    for row in table("percentiles"):
        if row["sex"] == column and row["dim"] == dimension:
            return float(row["sd"]) * (1.0 if name == "mass" else 0.01)
    row = next(row for row in table("dimensions") if row["name"] == name)
    # Standard deviations from the 5th to the 95th percentile of a normal distribution.
    return (float(row[f"{column}95"]) - float(row[f"{column}5"])) / 3.2897


@lru_cache(maxsize=64)
def _measured(person: Person) -> Mapping[str, float]:
    return measured(person, person.deviations) | {name: person.fitted(size) for name, size in SIZES.items()}


def _sized(person: Person, sizes: Mapping[str, float], wanted: Mapping[str, float], stated: set[str]) -> Person:
    """The person whose measured dimensions are nearest to the wanted ones: Gauss and Newton with one Jacobian."""
    priors = keyed("priors", "name")
    free = list(priors)
    names = list(wanted)
    # Metres: a stated dimension that is off by this counts as one unit, one that follows counts by `TOLERANCE`.
    unit = np.array([0.0002 if name in stated else TOLERANCE for name in names])
    pull = np.diag([1.0 / float(priors[name]["spread"]) for name in free])

    def made(x: Array) -> Person:
        changes = {**sizes, **dict(zip(free, map(float, x), strict=True))}
        return replace(person, deviations=tuple((name, value) for name, value in changes.items() if value))

    def off(x: Array) -> Array:
        found = _measured(made(x))
        return np.asarray(np.array([found[name] - wanted[name] for name in names]) / unit)

    x = np.zeros(len(free))
    start = now = off(x)
    step = 1e-3
    slopes = np.column_stack([(off(x + step * axis) - start) / step for axis in np.eye(len(free))])
    rows = np.vstack([slopes, pull])
    for _ in range(12):
        x = x + np.linalg.lstsq(rows, np.concatenate([-now, -pull @ x]), rcond=None)[0]
        now = off(x)
        if all(abs(value) < 1.0 for value, name in zip(now, names, strict=True) if name in stated):
            break
    return made(x)
