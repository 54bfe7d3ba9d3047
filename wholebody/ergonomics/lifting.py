"""The revised NIOSH lifting equation.

T. R. Waters, V. Putz-Anderson, A. Garg, "Applications manual for the revised NIOSH lifting equation", DHHS (NIOSH)
publication 94-110, revised 2021.

RWL = 23 kg (25 / H) (1 - 0.003 |V - 75|) (0.82 + 4.5 / D) (1 - 0.0032 A) FM CM, with H, V, D in cm and A in degrees.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, inf, pi
from typing import Annotated, Literal

import numpy as np

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.fields import Checked, Range
from wholebody.ergonomics.angles import SIDES, check_person
from wholebody.ergonomics.observation import published
from wholebody.figures.figure import Figure

CLOSEST, FARTHEST = 25.0, 63.0  # cm, of H
HIGHEST = 175.0  # cm, of V and D

Grip = Literal["good", "fair", "poor"]


@dataclass(frozen=True)
class Lift(Checked):
    """A lift, and what the equation says of it.

    Attributes:
        horizontal: H, of the hands from the middle of the ankles, metres.
        vertical: V, of the hands above the floor, metres.
        travel: D, by which the hands go up or down, metres.
        asymmetry: A, of the hands from the middle plane of the body, radians.
        frequency: lifts a minute.
        duration: of the lifting, hours, up to 8.
        coupling: "good", "fair" or "poor".
        load: kg; None for a lift of which only the limit is asked.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> lift = wb.ergonomics.Lift(horizontal=0.4, vertical=0.7, travel=0.5, load=10.0)
        >>> lift.index > 0.5
        True
    """

    horizontal: Annotated[float, Range(0.0, 3.0, "m")]
    vertical: Annotated[float, Range(0.0, 3.0, "m")]
    travel: Annotated[float, Range(0.0, 3.0, "m")]
    asymmetry: Annotated[float, Range(0.0, pi, "rad")] = 0.0
    frequency: Annotated[float, Range(0.0, 60.0, "lifts a minute")] = 0.2
    duration: Annotated[float, Range(0.0, 8.0, "hours")] = 1.0
    coupling: Grip = "good"
    load: Annotated[float, Range(0.0, 1000.0, "kg")] | None = None

    def __str__(self) -> str:
        """The limit, what makes it zero, and the lifting index of a load."""
        none = [name for name, value in self.multipliers.items() if value == 0.0]
        why = f" ({' and '.join(none)} = 0)" if none else ""
        index = "" if self.index is None else f", lifting index {self.index:.2f} with {self.load:g} kg"
        return f"at most {self.limit:.1f} kg by the NIOSH equation{why}{index}"

    @property
    def multipliers(self) -> dict[str, float]:
        """HM, VM, DM, AM, FM and CM by name, each 0 to 1."""
        h, v, d, a = 100.0 * self.horizontal, 100.0 * self.vertical, 100.0 * self.travel, degrees(self.asymmetry)
        high = int(v >= 75.0)  # cm: height of the hands from which the second columns of the tables count
        column = next(row[1 + high] for row in published("niosh")["multipliers"] if self.duration <= row[0])
        return {
            "HM": 25.0 / max(h, CLOSEST) if h <= FARTHEST else 0.0,
            "VM": 1.0 - 0.003 * abs(v - 75.0) if v <= HIGHEST else 0.0,
            "DM": 0.82 + 4.5 / max(d, 25.0) if d <= HIGHEST else 0.0,  # cm: least travel
            "AM": 1.0 - 0.0032 * a if a <= 135.0 else 0.0,  # degrees: most turned
            "FM": _frequency(self.frequency, column),
            "CM": published("niosh")["coupling"][self.coupling][high],
        }

    @property
    def limit(self) -> float:
        """The recommended weight limit, kg; 0 where the equation allows no such lift."""
        return float(23.0 * np.prod(list(self.multipliers.values())))  # constant, kg

    @property
    def index(self) -> float | None:
        """The lifting index: load / limit; infinite where nothing may be lifted, None without a load."""
        if self.load is None:
            return None
        return self.load / self.limit if self.limit > 0.0 else inf if self.load > 0.0 else 0.0


def lift_between(
    figure: Figure, origin: Array, destination: Array, *, floor: float = 0.0, frequency: float = 0.2,
    duration: float = 1.0, coupling: Grip = "good", load: float | None = None,
) -> tuple[Lift, Lift]:  # fmt: skip
    """The lift between two postures of a person: at its origin, and at its destination, where control is needed.

    The hands are the middle of both palms. The middle plane goes through the middle of the ankles, in the mean
    direction in which the feet point.

    Args:
        figure: a person, see `body_angles`.
        origin: (nq,) posture in which the load is taken.
        destination: (nq,) posture in which it is put down.
        floor: height of the floor, metres.
        frequency: lifts a minute.
        duration: of the lifting, hours.
        coupling: see `Lift`.
        load: kg; None for a lift of which only the limit is asked.

    Raises:
        InputError: no person, no posture, or a value out of range.

    Examples:
        >>> take = human.with_joints(standing, {"left_shoulder_flexion": 1.0, "right_shoulder_flexion": 1.0})
        >>> origin, destination = wb.ergonomics.lift_between(human, standing, take, load=5.0)
    """
    person = check_person(figure, "lift_between: figure")
    floor = checks.number(floor, "lift_between: floor", -100.0, 100.0, "m")
    found = []
    for name, q in (("origin", origin), ("destination", destination)):
        posture = checks.posture(q, person.model.nq, f"lift_between: {name}")
        person.warn_of_angles(posture, f"lift_between: {name}")
        found.append(_hands(person, posture))
    travel = abs(found[1][1] - found[0][1])
    first, second = (
        Lift(h, max(v - floor, 0.0), travel, a, frequency, duration, coupling, load) for h, v, a in found
    )  # fmt: skip
    return first, second


def _hands(figure: Figure, q: Array) -> tuple[float, float, float]:
    """Horizontal distance, height and asymmetry of the hands."""
    palms, ankle, feet = (
        [figure.placement(q, f"{side}_{part}") for side in SIDES] for part in ("palm", "ankle", "foot")
    )
    hands, ankles = (0.5 * (left.translation + right.translation) for left, right in (palms, ankle))
    forward = sum(foot.rotation[:2, 0] for foot in feet)
    away = (hands - ankles)[:2]
    turned = abs(np.arctan2(forward[0] * away[1] - forward[1] * away[0], forward @ away))
    return float(np.linalg.norm(away)), float(hands[2]), float(turned)


def _frequency(asked: float, column: list[float]) -> float:
    """The frequency multiplier, interpolated between the frequencies of the table; 0 from where the table has 0."""
    frequencies = published("niosh")["frequencies"]
    if asked > frequencies[-1]:
        return 0.0
    upper = next(k for k, frequency in enumerate(frequencies) if asked <= frequency)
    return float(np.interp(asked, frequencies, column)) if column[upper] > 0.0 else 0.0
