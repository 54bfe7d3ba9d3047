"""Lengths, masses and radii of a body from sex, stature and mass.

Masses are fractions (de Leva 1996). Radii are linear fits to ANSUR II, ``c0 + cq sqrt(mass / stature) + cH stature``.
Lengths of limbs, joint centres and some thicknesses are of the same form; `tests.audits.sizes` chooses their
coefficients so that the dimensions of the model are those of ANSUR II. The tables in ``figures/data`` name the source
of every column.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from statistics import NormalDist

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import shown
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.base.fields import Range
from wholebody.base.files import packaged_table

STATURE = Range(1.3, 2.2, "m")
"""The fits come from adults of 1.4 to 2.0 m; beyond this range they are invalid."""

MASS = Range(25.0, 250.0, "kg")
PERCENTILE = Range(1.0, 99.0, "percent, such as 95")

AGE = Range(20.0, 69.0, "years")
"""Of the adults whose ranges of motion were measured (table "age_ranges")."""

_SEXES = {"male": "M", "female": "F"}

_ENDS = {
    "elbow_flexion": "upper_arm", "wrist_flexion": "forearm", "knee_flexion": "thigh", "ankle_dorsiflexion": "shank",
}  # fmt: skip
"""Joints at the ends of segments with a fitted length."""

FOLDER = Path(__file__).parent / "data"

Row = dict[str, str]


@dataclass(frozen=True)
class Person:
    """One person; all other quantities follow from these.

    Attributes:
        sex: "male" or "female".
        stature: metres.
        mass: kilograms.
        deviations: how much larger fitted sizes (see `fitted`) are than those of most people of this build: name and
            metres.
        age: years, for the ranges of motion; None for those of all adults. The size does not depend on it.
    """

    sex: str
    stature: float
    mass: float
    deviations: tuple[tuple[str, float], ...] = ()
    age: float | None = field(default=None, repr=False)

    @property
    def column(self) -> str:
        """Suffix of the tables' columns for this sex: "M" or "F"."""
        return _SEXES[self.sex]

    def segment(self, name: str, quantity: str) -> float:
        """Return a number of the segment table for this sex, without conversion (mostly a fraction of the stature)."""
        return float(_row("segments", "name", name)[f"{quantity}_{self.column}"])

    def fitted(self, name: str) -> float:
        """Return a size of the table "fit", metres: a length of a limb, a joint centre or a thickness."""
        return self._linear(_row("fit", "name", name), f"{self.column}_") + sum(
            more for which, more in self.deviations if which == name
        )

    def length(self, segment: str) -> float:
        """Length of a segment, metres."""
        part = segment.removeprefix("left_").removeprefix("right_")
        if part in ("thigh", "shank", "upper_arm", "forearm", "hand"):
            return self.fitted(part)
        length = self.segment(segment, "length") * self.stature
        return length if part in ("foot", "toes", "clavicle") else length * self._trunk_scale()

    def origin(self, joint: str) -> tuple[float, float, float]:
        """Position of a joint in the frame of its parent, metres."""
        row = _row("joints", "name", joint)
        x, y, z = (float(row[f"o{axis}_{self.column}"]) * self.stature for axis in "xyz")
        side, _, rest = joint.partition("_")
        if side not in ("left", "right"):
            return x, y, z * self._trunk_scale()
        if rest == "clavicle_protraction":
            return x, y, z * self._trunk_scale()
        if rest == "shoulder_flexion":
            return self.fitted("shoulder_x"), math.copysign(self.fitted("shoulder_y"), y), self.fitted("shoulder_z")
        if rest in _ENDS:
            return x, y, -self.fitted(_ENDS[rest])
        return x, y, z

    def _trunk_scale(self) -> float:
        """How much longer the trunk and head are than their shares of the stature, because the legs are shorter."""
        toe = float(_row("joints", "name", "left_toe_extension")[f"oz_{self.column}"])
        ankle = (self.segment("left_toes", "radius_b") - toe) * self.stature
        leg = ankle + self.fitted("thigh") + self.fitted("shank")
        shares = self.segment("left_thigh", "length") + self.segment("left_shank", "length")
        return (self.stature - leg) / (self.stature * (1.0 - shares) - ankle)

    def segment_mass(self, segment: str) -> float:
        """Mass of a segment, kilograms; all of them add up to the mass of the body."""
        total = sum(float(row[f"mass_{self.column}"]) for row in table("segments"))
        return self.segment(segment, "mass") / total * self.mass

    def source_length(self, segment: str) -> float:
        """Length that the fractions of a segment's centre of mass and gyration belong to, metres.

        The landmarks of de Leva's segments differ from those of the model's, most for the thighs of women.
        """
        fraction = _row("segments", "name", segment)[f"source_length_{self.column}"]
        return float(fraction) * self.stature if fraction else self.length(segment)

    def center_of_mass(self, segment: str) -> Array:
        """Centre of mass of a segment in its own frame, shape (3,), metres."""
        return self.source_length(segment) * np.array([self.segment(segment, f"com_{axis}") for axis in "xyz"])

    def inertia(self, segment: str) -> Array:
        """Principal moments about the centre of mass, along x, y, z, shape (3,), kg m^2: ``m (k l)^2``."""
        gyration = np.array([self.segment(segment, f"k{axis}") for axis in "xyz"])
        return self.segment_mass(segment) * (gyration * self.source_length(segment)) ** 2

    def radius(self, part: str) -> float:
        """Radius of a body part, metres: circumference / 2 pi, or half a breadth (``*_y``) or depth (``*_x``)."""
        return self._linear(_row("radii_ansur", "part", part), f"{self.column}_fit_")

    def _linear(self, row: Mapping[str, str], start: str) -> float:
        c0, cq, ch = (float(row[start + name]) for name in ("c0", "cq", "cH"))
        return c0 + cq * math.sqrt(self.mass / self.stature) + ch * self.stature


def make_person(
    sex: str = "male",
    stature: float | None = None,
    mass: float | None = None,
    percentile: float | None = None,
    age: float | None = None,
) -> Person:
    """Return a checked `Person`.

    Args:
        sex: "male" or "female".
        stature: metres; the median of the sex if left out.
        mass: kilograms; if left out, the median of the sex, or the mass expected at the stature that was given.
        percentile: 1 to 99: stature and mass, unless one of them is given, are this percentile of the sex in ANSUR II,
            between the percentiles of the table on a line in the normal deviate.
        age: years, 20 to 69, for the ranges of motion; those of all adults if left out.

    Raises:
        InputError: an unknown sex, a number out of the range of people, or a percentile of nothing.
    """
    if not isinstance(sex, str) or sex.lower() not in _SEXES:
        raise InputError(f"sex is {shown(sex)}; give 'male' or 'female'")
    sex = sex.lower()
    column = _SEXES[sex]
    median = keyed("design_cases", "case")[f"{column}50"]
    if percentile is not None:
        if stature is not None and mass is not None:
            raise InputError("stature and mass are given, which leaves nothing to percentile; leave one out")
        share = PERCENTILE(percentile, "percentile")
        stature = 0.01 * _percentile(column, "stature", share) if stature is None else stature
        mass = _percentile(column, "mass", share) if mass is None else mass
    if mass is None and stature is not None:
        # log-log fit to ANSUR II
        factor, exponent = {"M": (27.41, 1.999), "F": (23.00, 2.192)}[column]
        mass = factor * STATURE(stature, "stature") ** exponent
    height = STATURE(float(median["stature_m"]) if stature is None else stature, "stature")
    weight = MASS(float(median["mass_kg_same_percentile"]) if mass is None else mass, "mass")
    # kg of body mass indices, kg / m^2, outside of which nobody lives; most likely a unit is wrong
    low, high = 13.0 * height**2, 50.0 * height**2
    if not low <= weight <= high:
        raise InputError(
            f"mass {weight:g} kg does not go with stature {height:g} m; give a mass between {low:.0f} and {high:.0f} kg"
        )
    return Person(sex, height, weight, age=None if age is None else AGE(age, "age"))


def _percentile(column: str, dimension: str, percentile: float) -> float:
    row = next(row for row in table("percentiles") if row["sex"] == column and row["dim"] == dimension)
    known = [int(name[1:]) for name in row if name[0] == "p" and name[1:].isdigit()]
    deviate = [NormalDist().inv_cdf(0.01 * share) for share in (percentile, *known)]
    return float(np.interp(deviate[0], deviate[1:], [float(row[f"p{share:02d}"]) for share in known]))


def describe(person: Person) -> str:
    """Return one line on a person for the head of a file."""
    own = "" if person.age is None else f", {person.age:g} years"
    if person.deviations:
        own += ", proportions of their own"
    size = f"stature {person.stature:g} m, mass {person.mass:g} kg"
    return f"{person.sex}, {size}{own}; written by wholebody from its tables"


def design_cases() -> Mapping[str, Person]:
    """Small, median and large women and men (5th, 50th, 95th percentile of stature and mass): "F5" ... "M95"."""
    return {
        row["case"]: make_person(
            "male" if row["sex"] == "M" else "female", float(row["stature_m"]), float(row["mass_kg_same_percentile"])
        )
        for row in table("design_cases")
    }


def _row(name: str, column: str, key: str) -> Mapping[str, str]:
    rows = keyed(name, column)
    if key not in rows:
        raise UnknownNameError("segment" if name == "segments" else "body part", key, rows)
    return rows[key]


@cache
def table(name: str) -> tuple[Row, ...]:
    """Return the rows of a table in `figures/data`, each a mapping from column to text.

    Raises:
        UnknownNameError: there is no such table.
    """
    path = FOLDER / f"{name}.csv"
    if not path.is_file():
        raise UnknownNameError("table", name, [file.stem for file in FOLDER.glob("*.csv")])
    return packaged_table(path)


@cache
def named_angles(of: str) -> dict[str, dict[str, float]]:
    """Return the angles of the table "postures", degrees by joint, of each posture of "human", "hand" or "fingers"."""
    found: dict[str, dict[str, float]] = {}
    for row in table("postures"):
        if row["of"] == of:
            found.setdefault(row["name"], {}).update({row["joint"]: float(row["degrees"])} if row["joint"] else {})
    return found


@cache
def keyed(name: str, column: str) -> dict[str, Row]:
    """Return the rows of a table by the text in one column."""
    return {row[column]: row for row in table(name)}
