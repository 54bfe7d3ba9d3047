"""`wb.people` and `wb.boundary`: people who stand for a population."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wholebody.base import checks
from wholebody.base.errors import InputError
from wholebody.figures.anthropometry import AGE, PERCENTILE, Person, dimension_names, make_person
from wholebody.figures.population import SEXES, population

SEATED = ("sitting_height", "bideltoid_breadth", "hip_breadth_sitting", "buttock_knee_length", "popliteal_height")
"""Dimensions of `boundary` that are not left out: those of a seat."""


def people(
    count: int | None = None,
    sex: str | None = None,
    *,
    seed: int = 0,
    percentiles: Sequence[float] | None = None,
) -> dict[str, dict[str, Any]]:
    """Draw people from the joint distribution of all dimensions of men and women.

    With `percentiles`, people whose stature is that percentile, and whose other dimensions are likely for it. Nobody is
    of one percentile in everything, and what fits the 5th and the 95th percentile of stature does not fit 90 % of the
    people: take a sample, or `boundary`.

    Args:
        count: of each sex; 100 if left out.
        sex: "male" or "female"; None for both.
        seed: another one draws others.
        percentiles: 1 to 99, of stature, in place of a sample.

    Returns:
        Name such as "female 12" or "female P5" to options of `wb.load("human")`.

    Raises:
        InputError: a value of the wrong kind or range.

    Examples:
        >>> sorted(wb.people(2, seed=1))
        ['female 1', 'female 2', 'male 1', 'male 2']
    """
    sexes = _sexes(sex, "people")
    if percentiles is not None:
        if count is not None:
            raise InputError("people: count and percentiles are given; leave one out")
        shares = [
            PERCENTILE(one, "people: percentiles") for one in checks.listed(percentiles, "people: percentiles", "[5]")
        ]
        if not shares:
            raise InputError("people: percentiles is empty; give some, such as [5, 50, 95], or leave it out")
        # in as many digits as tell one from every other
        named = {f"P{share:g}" if float(f"{share:g}") == share else f"P{share!r}": share for share in shares}
        return {
            f"{own} {name}": {"sex": own, "stature": population(own).quantile("stature", 0.01 * share)}
            for own in sexes
            for name, share in named.items()
        }
    most = checks.whole(100 if count is None else count, "people: count", 1, 10_000)
    rng = checks.whole(seed, "people: seed", 0, 2**32 - 1)
    found = {}
    for own in sexes:
        drawn = population(own).sample(most, np.random.default_rng([rng, own == "male"]))
        found.update({f"{own} {number}": _options(own, values) for number, values in enumerate(drawn, 1)})
    return found


def boundary(
    confidence: float = 0.95, dimensions: Sequence[str] = SEATED, sex: str | None = None
) -> dict[str, dict[str, Any]]:
    """Return people on the boundary of a share of all people: a design that fits them fits those within.

    They lie on the ellipsoid, in the principal components of some dimensions, that holds the share: at the ends of its
    axes and between them (A-CADRE, Bittner 2000); and the person in its middle. Other dimensions are likely for these.

    Args:
        confidence: share of the people within, 0.5 to 0.999.
        dimensions: those that the design depends on, such as "sitting_height", "stature" and "mass" among them.
        sex: "male" or "female"; None for both.

    Returns:
        Name such as "female boundary 3" to options of `wb.load("human")`; the first of each sex is the middle.

    Raises:
        InputError: a value of the wrong kind or range.
        UnknownNameError: an unknown dimension.

    Examples:
        >>> list(wb.boundary(0.9, ("stature", "mass"), "female"))[0]
        'female boundary 0'
    """
    share = checks.number(confidence, "boundary: confidence", 0.5, 0.999)
    names = ("stature", "mass", *dimension_names())
    wanted = [checks.known(one, names, "dimension", "boundary: dimensions")
              for one in checks.listed(dimensions, "boundary: dimensions", "['sitting_height']")]  # fmt: skip
    if not wanted or len(set(wanted)) < len(wanted):
        raise InputError("boundary: dimensions is empty, or has one twice; give each that the design depends on once")
    return {
        f"{own} boundary {number}": _options(own, values)
        for own in _sexes(sex, "boundary")
        for number, values in enumerate(population(own).boundary(wanted, share))
    }


def _sexes(sex: str | None, what: str) -> tuple[str, ...]:
    return tuple(SEXES) if sex is None else (checks.choice(sex, SEXES, f"{what}: sex"),)


def _options(sex: str, values: Mapping[str, float]) -> dict[str, Any]:
    """Options of `wb.load("human")` of somebody with these dimensions, as far as one body can have them."""
    low, high = AGE.low, AGE.high
    person = Person(sex, values["stature"], values["mass"], tuple((name, values[name]) for name in dimension_names()))
    proportions = {**dict(person.dimensions), **person.built[1]}
    age = float(np.clip(values["age"], low, high))
    checked = make_person(sex, person.stature, person.mass, age=age, proportions=proportions)
    return {"sex": sex, "stature": checked.stature, "mass": checked.mass, "age": age, "proportions": proportions}
