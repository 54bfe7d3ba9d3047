"""Lengths, masses and radii of a person, from sex, stature, mass and other dimensions.

What is not stated is likely for what is, by the joint distribution of all dimensions (`population`). Joint centres and
thicknesses follow from the dimensions (`sizes`); masses are fractions (de Leva 1996). The tables in ``figures/data``
name the source of every column. `Dimensions` has the sizes that pieces and landmarks share.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import known, shown
from wholebody.base.errors import InputError, millimetres
from wholebody.base.fields import Range
from wholebody.figures.population import SEXES, UNITS, population
from wholebody.figures.sizes import THUMB_TIP, TRUNK, Skeleton, arm_sizes, leg_sizes
from wholebody.figures.tables import keyed, table

STATURE = Range(1.3, 2.2, "m")  # the distribution comes from adults of 1.4 to 2.0 m; beyond this range it is invalid

MASS = Range(25.0, 250.0, "kg")
PERCENTILE = Range(1.0, 99.0, "percent, such as 95")
DIMENSION = Range(0.0, 3.0, "m")

AGE = Range(17.0, 69.0, "years")
"""Of the adults that were measured: 17 to 58 years the dimensions, 20 to 69 the ranges of motion."""

SHOES = Range(0.0, 0.15, "m")
CLOTHING = Range(0.0, 0.1, "m")

_ENDS = {
    "elbow_flexion": "upper_arm", "wrist_flexion": "forearm", "knee_flexion": "thigh", "ankle_dorsiflexion": "shank",
}  # fmt: skip
"""Joints at the ends of segments whose length is a size."""

MEDIAN = {"male": (1.755, 84.6), "female": (1.626, 66.8)}
"""Stature, metres, and mass, kilograms, of half of all 4,082 men and 1,986 women of ANSUR II."""

OVERHEAD = "overhead_reach_sitting"
"""The dimension that says how far the shoulder rises; one man in seven stretches farther than the model can."""


@dataclass(frozen=True)
class Person:
    """One person; all other quantities follow from these."""

    sex: str  # "male" or "female"
    stature: float  # metres
    mass: float  # kilograms
    # name and metres of all others, in the order of `dimension_names`
    dimensions: tuple[tuple[str, float], ...] = field(repr=False)
    stated: tuple[str, ...] = ()  # names of those that were given; the others are likely for them
    age: float | None = field(default=None, repr=False)  # years, for the ranges of motion; None for those of all adults
    shoes: float = field(default=0.0, repr=False)  # metres of sole below the foot
    clothing: float = field(default=0.0, repr=False)  # metres of cloth on trunk and limbs

    def __repr__(self) -> str:
        """What differs from the likely person of the sex, stature and mass, in bare skin."""
        of, aged = dict(self.dimensions), {} if self.age is None else {"age": self.age}
        likely = population(self.sex).likely({"stature": self.stature, "mass": self.mass} | aged)
        names = self.stated or tuple(name for name in of if abs(of[name] - likely[name]) > 1e-6)
        told = {"proportions": {name: round(of[name], 4) for name in names if name in of}, "age": self.age}
        told |= {"shoes": self.shoes, "clothing": self.clothing}
        more = "".join(f", {name}={value!r}" for name, value in told.items() if value)
        return f"Person({self.sex!r}, stature={self.stature!r}, mass={self.mass!r}{more})"

    @property
    def column(self) -> str:
        """Suffix of the tables' columns for this sex: "M" or "F"."""
        return "M" if self.sex == "male" else "F"

    def segment(self, name: str, quantity: str) -> float:
        """Return a number of the segment table for this sex, without conversion (mostly a fraction of the stature)."""
        return float(keyed("segments")[name][f"{quantity}_{self.column}"])

    def size(self, name: str) -> float:
        """Return a dimension or a size of the body, see `sizes`, metres."""
        return self.built[0][name]

    @cached_property
    def built(self) -> tuple[dict[str, float], dict[str, float]]:
        """All sizes and dimensions, metres, and the dimensions of the arms that the body has."""
        of = dict(self.dimensions) | {"stature": self.stature}
        toe = self._offset("left_toe_extension")[2]
        legs = leg_sizes(of, ankle=self.segment("left_toes", "radius_b") * self.stature - toe)
        of |= legs
        hip = self.stature - of["sitting_height"] + legs["seat"]
        upright = ("spine1_flexion", "spine2_flexion", "spine3_flexion", "spine4_flexion")
        offsets = [self._offset(joint) for joint in (*upright, "left_clavicle_protraction")]
        share = self._trunk_scale(of)
        ahead, backs = 0.0, [legs["buttock"]]
        for x, part in zip((x for x, _, _ in offsets), TRUNK, strict=False):
            ahead += x
            backs.append(part.back(of) - ahead)
        girdle = (ahead + offsets[-1][0], offsets[-1][1], share * sum(z for _, _, z in offsets))
        frame = Skeleton(hip, girdle, max(backs))
        arms, dimensions = arm_sizes(self.sex, of, self.stated, frame)
        return of | arms, dimensions

    def length(self, segment: str) -> float:
        """Length of a segment, metres."""
        part = segment.removeprefix("left_").removeprefix("right_")
        if part in ("thigh", "shank", "upper_arm", "forearm"):
            return self.size(part)
        if part == "hand":
            return self.size("hand_length")
        length = self.segment(segment, "length") * self.stature
        return length if part in ("foot", "toes", "clavicle") else length * self._trunk_scale(self.built[0])

    def origin(self, joint: str) -> tuple[float, float, float]:
        """Position of a joint in the frame of its parent, metres."""
        x, y, z = self._offset(joint)
        side, _, rest = joint.partition("_")
        if side not in ("left", "right") or rest == "clavicle_protraction":
            return x, y, z * self._trunk_scale(self.built[0])
        if rest == "shoulder_flexion":
            inner = self._offset("left_clavicle_protraction")[1]
            beside = self.size("shoulder_y") - inner
            return self.size("shoulder_x"), math.copysign(beside, y), self.size("shoulder_z")
        return (x, y, -self.size(_ENDS[rest])) if rest in _ENDS else (x, y, z)

    def _offset(self, joint: str) -> tuple[float, float, float]:
        """The table's position of a joint, metres."""
        row = keyed("joints")[joint]
        x, y, z = (float(row[f"o{axis}_{self.column}"]) * self.stature for axis in "xyz")
        return x, y, z

    def _trunk_scale(self, sizes: Mapping[str, float]) -> float:
        """How much longer the trunk and head are than their shares of the stature, because the legs are shorter."""
        ankle = self.segment("left_toes", "radius_b") * self.stature - self._offset("left_toe_extension")[2]
        leg = ankle + sizes["thigh"] + sizes["shank"]
        shares = self.segment("left_thigh", "length") + self.segment("left_shank", "length")
        return (self.stature - leg) / (self.stature * (1.0 - shares) - ankle)

    def segment_mass(self, segment: str) -> float:
        """Mass of a segment, kilograms; all of them add up to the mass of the body."""
        return self.segment(segment, "mass") / _whole(self.column) * self.mass

    def source_length(self, segment: str) -> float:
        """Length [m] of a segment between de Leva's landmarks; these differ most for the thighs of women."""
        fraction = keyed("segments")[segment][f"source_length_{self.column}"]
        return float(fraction) * self.stature if fraction else self.length(segment)

    def center_of_mass(self, segment: str) -> Array:
        """Centre of mass of a segment in its own frame, shape (3,), metres."""
        return self.source_length(segment) * np.array([self.segment(segment, f"com_{axis}") for axis in "xyz"])

    def inertia(self, segment: str) -> Array:
        """Principal moments about the centre of mass, along x, y, z, shape (3,), kg m^2: ``m (k l)^2``."""
        gyration = np.array([self.segment(segment, f"k{axis}") for axis in "xyz"])
        return self.segment_mass(segment) * (gyration * self.source_length(segment)) ** 2

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on stated dimensions that the body does not have, and on postures that clothing forbids."""
        wanted, own, found = dict(self.dimensions)[OVERHEAD], self.built[1][OVERHEAD], list[str]()
        if OVERHEAD in self.stated and abs(wanted - own) > 0.001:
            found.append(f"{OVERHEAD} is {own:.3f} m, not {wanted:.3f} m: the shoulder rises as far as it can")
        if self.clothing > 0.03:  # m: up to which named postures are free
            found.append(
                f"clothing of {millimetres(self.clothing)} is so thick that parts may overlap in named postures"
            )
        return tuple(found)

    def radius(self, part: str) -> float:
        """Radius of a part with a circumference, metres."""
        return self.size(f"{part}_circumference") / (2.0 * math.pi)


@lru_cache(maxsize=2)
def _whole(column: str) -> float:
    """Sum of the shares of the mass that all segments have."""
    return sum(float(row[f"mass_{column}"]) for row in table("segments"))


def dimension_names() -> tuple[str, ...]:
    """Return the names of the dimensions that can be stated as proportions, metres."""
    return tuple(name for name in population("male").names if name != "stature" and name not in UNITS)


def make_person(
    sex: str = "male",
    stature: float | None = None,
    mass: float | None = None,
    percentile: float | None = None,
    age: float | None = None,
    proportions: Mapping[str, float] | None = None,
    shoes: float = 0.0,
    clothing: float = 0.0,
) -> Person:
    """Return a checked `Person`.

    Args:
        sex: "male" or "female".
        stature: metres; if left out, the one that is likely for the proportions, or the median of the sex without any.
        mass: kilograms; if left out, the one that is likely for stature and proportions, or the median without any.
        percentile: 1 to 99: stature and mass, unless one of them is given, are this percentile of the sex; the other
            dimensions are likely for them, and not of this percentile.
        age: years, 17 to 69, for the ranges of motion, and for dimensions that change with it; those of all adults if
            left out.
        proportions: other dimensions, metres by the names of `dimension_names`; those left out are likely for them.
        shoes: thickness of their level soles, metres; the bare foot stands that much higher.
        clothing: thickness of cloth around trunk, arms and legs, metres: breadths and depths grow by twice that, girths
            by 2 pi times that, and who sits is higher by it. Hands, head and feet are bare.

    Raises:
        InputError: an unknown sex, a number out of the range of people, a percentile of nothing, or dimensions that
            nobody has together.
        UnknownNameError: an unknown dimension.
    """
    if not isinstance(sex, str) or sex.lower() not in SEXES:
        raise InputError(f"sex is {shown(sex)}; give 'male' or 'female'")
    people = population(sex.lower())
    stated = _stated(proportions)
    if percentile is not None:
        if stature is not None and mass is not None:
            raise InputError("stature and mass are given, which leaves nothing to percentile; leave one out")
        share = 0.01 * PERCENTILE(percentile, "percentile")
        stature = people.quantile("stature", share) if stature is None else stature
        mass = people.quantile("mass", share) if mass is None else mass
    height = None if stature is None else STATURE(stature, "stature")
    weight = None if mass is None else MASS(mass, "mass")
    years = None if age is None else AGE(age, "age")
    person = _made(people.sex, height, weight, years, tuple(sorted(stated.items())))
    sole, cloth = SHOES(shoes, "shoes"), CLOTHING(clothing, "clothing")
    return replace(person, shoes=sole, clothing=cloth) if sole or cloth else person


@lru_cache(maxsize=256)
def _made(
    sex: str, stature: float | None, mass: float | None, age: float | None, stated: tuple[tuple[str, float], ...]
) -> Person:
    size = {name: value for name, value in (("stature", stature), ("mass", mass)) if value is not None}
    known, values = size | ({} if age is None else {"age": age}), dict(stated)
    if values and (odd := population(sex).unlikely(values, size)):
        name, deviation, low, high = odd
        sizes = " and ".join(f"{value:.4g} {UNITS.get(name, 'm')}" for name, value in size.items())
        people = SEXES[sex] + (f" of {sizes}" if sizes else "") + (" with the others" if len(values) > 1 else "")
        raise InputError(
            f"proportions: {name} {values[name]:g} m is {deviation:.1f} standard deviations from that of {people}; "
            f"give {low:.3f} to {high:.3f} m, or change another one"
        )
    usual = {} if values or stature is not None else dict(zip(("stature", "mass"), MEDIAN[sex], strict=True))
    all_of = population(sex).likely({**usual, **known, **values})
    stature, mass = STATURE(all_of["stature"], "stature"), MASS(all_of["mass"], "mass")
    # kg of body mass indices, kg / m^2, outside of which nobody lives; most likely a unit is wrong
    lightest, heaviest = 13.0 * stature**2, 50.0 * stature**2
    if not lightest <= mass <= heaviest:
        raise InputError(
            f"mass {mass:g} kg does not go with stature {stature:g} m; give a mass between {lightest:.0f} and "
            f"{heaviest:.0f} kg"
        )
    person = Person(sex, stature, mass, tuple((name, all_of[name]) for name in dimension_names()), tuple(values), age)
    for name, value in person.built[1].items():
        # metres within which a stated dimension must be met; `notes` says an overhead reach
        if name in values and name != OVERHEAD and abs(value - values[name]) > 0.001:
            raise InputError(
                f"proportions: {name} {values[name]:g} m is out of the model's reach with the other dimensions and "
                f"stature {stature:g} m, it comes to {value:.3f} m; give that or leave one dimension out"
            )
    return person


def _stated(proportions: Mapping[str, float] | None) -> dict[str, float]:
    if proportions is None:
        return {}
    if not isinstance(proportions, Mapping):
        raise InputError(f"proportions is {shown(proportions)}; give metres by dimension: {{'sitting_height': 0.93}}")
    names = dimension_names()
    return {
        known(name, names, "dimension", "proportions"): DIMENSION(value, f"proportions: {name}")
        for name, value in proportions.items()
    }


def describe(person: Person) -> str:
    """Return one line on a person for the head of a file."""
    own = "" if person.age is None else f", {person.age:g} years"
    if person.stated:
        own += ", proportions of their own"
    own += "".join(f", {name} of {mm:.3g} mm" for name in ("shoes", "clothing") if (mm := 1e3 * getattr(person, name)))
    size = f"stature {person.stature:.4g} m, mass {person.mass:.4g} kg"
    return f"{person.sex}, {size}{own}; written by wholebody from its tables"


@cache
def design_cases() -> Mapping[str, Person]:
    """Small, median and large women and men (5th, 50th, 95th percentile of stature and mass): "F5" ... "M95"."""
    return {
        f"{sex[0].upper()}{percentile}": make_person(sex, percentile=percentile)
        for sex in SEXES
        for percentile in (5, 50, 95)
    }


RELAXED = 0.93  # the arm's circumferences were measured flexed; relaxed they are 5 to 8 % less (estimate)


class Finger(NamedTuple):
    """A straight finger in the hand's frame: `x` towards the thumb, `tip` from the wrist to the end, `radius`."""

    x: float
    knuckle: float
    tip: float
    radius: float


class Dimensions:
    """Sizes of one `Person`."""

    def __init__(self, person: Person) -> None:
        self.body = person
        self.stature = height = person.stature
        toe = person.origin("left_toe_extension")
        self.toe_joint_x = toe[0]
        self.toe_half_height = person.segment("left_toes", "radius_b") * height
        self.toe_length = person.segment("left_toes", "length") * height
        bare = toe[2] - self.toe_half_height
        self.sole = bare - person.shoes
        self.heel_x = toe[0] + self.toe_length - person.size("foot_length")
        self.foot_half_width = 0.5 * person.size("foot_breadth")
        hip_height = person.length("left_thigh") + person.length("left_shank") - bare

        self.hand_length = person.length("left_hand")
        self.hand_breadth = person.size("hand_breadth")
        self.palm_length = {"M": 0.603, "F": 0.600}[person.column] * self.hand_length  # ANSUR II
        self.palm_half_thickness = keyed_hand("palm", "depth") * self.hand_breadth
        lateral, distal = FINGER_BASES["index"]
        length = sum(keyed_hand(f"index_{part}", "length") for part in ("pp", "mp", "dp"))
        self.index = Finger(
            lateral * self.hand_breadth,
            distal * self.hand_length,
            (distal + length) * self.hand_length,
            keyed_hand("index_mp", "width") * self.hand_breadth,
        )
        self.thumb = Finger(
            0.58 * self.hand_breadth,
            0.22 * self.hand_length,
            THUMB_TIP * self.hand_length,
            keyed_hand("thumb_dp", "width") * self.hand_breadth,
        )
        # Centre of a rod in the hand, in hand lengths from the wrist: what forearm-hand length leaves of forearm to
        # centre of grip in ANSUR II (481 and 355 mm in 28 men).
        self.grip = 0.31 * self.hand_length

        upward = ("spine1", "spine2", "spine3", "spine4", "neck1", "neck2")
        above = sum(person.origin(f"{name}_flexion")[2] for name in upward)
        self.head_top = height - hip_height - above
        self.head_half_breadth = 0.5 * person.size("head_breadth")
        self.head_half_length = 0.5 * person.size("head_length")
        # Fraction of stature (Drillis & Contini, in Winter 2009).
        self.head_bottom = self.head_top - (1.0 - 0.870) * height
        self.head_x = person.center_of_mass("head")[0]
        self.eye_z = self.head_top - person.size("eye")
        # The skull is a capsule from front to back; its front at the height of the eyes.
        below = self.head_top - self.head_half_breadth - self.eye_z
        front = self.head_half_length - self.head_half_breadth
        self.eye_x = self.head_x + front + math.sqrt(max(self.head_half_breadth**2 - below**2, 0.0))


FINGER_BASES = {
    "thumb": (0.27, 0.13),
    "index": (0.207, 0.450),
    "middle": (0.008, 0.447),
    "ring": (-0.158, 0.440),
    "little": (-0.267, 0.396),
}
"""Knuckles, and the root of the thumb: in hand breadths to the thumb's side, in hand lengths from the wrist.
They are MyoHand's, as in the table "hand"."""


def keyed_hand(part: str, quantity: str) -> float:
    """Return "length" (in hand lengths), "width" or "depth" (semi-axes, in hand breadths) of one part of the hand."""
    return float(keyed("hand")[part][quantity])
