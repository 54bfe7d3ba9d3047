"""OWAS, Ovako working posture analysing system: O. Karhu, P. Kansi, I. Kuorinka, Applied Ergonomics 8(4), 1977.

The action categories are those of Karhu, Härkönen, Sorvali and Vepsäläinen, Applied Ergonomics 12(1), 1981, as
handbooks tabulate them; where public tables differ in a cell, the value of most of them was taken. The papers have
pictures instead of angles; the constants say what is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Annotated

from wholebody.base.arrays import Array
from wholebody.base.fields import Checked, Range
from wholebody.ergonomics.angles import BodyAngles
from wholebody.ergonomics.published import published
from wholebody.ergonomics.work import KNEELING, Work, both_feet, seen
from wholebody.figures.figure import Figure
from wholebody.scene.scene import Scene

BENT = radians(20.0)  # of the trunk forward or backward
TURNED = radians(20.0)  # of the trunk sideways or about its axis
BENT_KNEE = radians(30.0)


@dataclass(frozen=True)
class Owas(Checked):
    """The digits of an OWAS code; an InputError if one is out of its range.

    Examples:
        >>> wb.ergonomics.Owas(back=2, arms=1, legs=2, load=1).category
        2
    """

    back: Annotated[int, Range(1, 4, whole=True)]
    arms: Annotated[int, Range(1, 3, whole=True)]
    legs: Annotated[int, Range(1, 7, whole=True)]
    load: Annotated[int, Range(1, 3, whole=True)]

    @property
    def code(self) -> str:
        """The four digits."""
        return f"{self.back}{self.arms}{self.legs}{self.load}"

    @property
    def category(self) -> int:
        """The action category, 1 to 4."""
        return int(published("owas")["categories"][self.back - 1][self.arms - 1][3 * (self.legs - 1) + self.load - 1])

    @property
    def action(self) -> str:
        """What the category says."""
        return str(published("owas")["actions"][self.category - 1])

    def __str__(self) -> str:
        digits = {"back": self.back, "arms": self.arms, "legs": self.legs, "loads": self.load}
        words = [published("owas")[name][digit - 1] for name, digit in digits.items()]
        return f"{self.code}: back {words[0]}, arms {words[1]}, {words[2]}, {words[3]}"


def owas(figure: Figure | Scene, q: Array, work: Work | None = None) -> Owas:
    """OWAS of a person's posture; arguments and errors as for `rula`. Of `work` counts whether the person walks too.

    Examples:
        >>> wb.ergonomics.owas(human, standing).category
        1
    """
    person = seen(figure, q, work, "owas")
    return owas_code(person.angles, person.work)


def owas_code(angles: BodyAngles, work: Work) -> Owas:
    """The code of a body's angles."""
    bent = abs(angles.trunk_flexion) > BENT
    twisted = max(abs(angles.trunk_twist), abs(angles.trunk_lateral)) > TURNED
    return Owas(
        back=1 + int(bent) + 2 * int(twisted),
        arms=1 + int(angles.left.arm_raised) + int(angles.right.arm_raised),
        legs=_legs(angles, work),
        load=1 if work.load < 10.0 else 2 if work.load <= 20.0 else 3,
    )


def _legs(angles: BodyAngles, work: Work) -> int:
    sides = (angles.left, angles.right)
    if work.sits(angles):
        return 1
    if work.walking:
        return 7
    if any(side.knee_height <= KNEELING and side.knee_flexion > BENT_KNEE for side in sides):
        return 6
    if both_feet(angles):
        return 4 if any(side.knee_flexion > BENT_KNEE for side in sides) else 2
    lower = min(sides, key=lambda side: side.foot_height)
    bearing = lower if abs(sides[0].foot_height - sides[1].foot_height) > 0.01 else sides[int(angles.left_share < 0.5)]
    return 5 if bearing.knee_flexion > BENT_KNEE else 3
