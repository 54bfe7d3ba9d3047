"""REBA, rapid entire body assessment: S. Hignett and L. McAtamney, Applied Ergonomics 31, 2000, pages 201 to 205."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Annotated

from wholebody.base.arrays import Array
from wholebody.base.fields import Checked, Range
from wholebody.ergonomics.angles import SIDES, BodyAngles
from wholebody.ergonomics.published import BothSides, action, published
from wholebody.ergonomics.rula_score import (
    DEVIATED,
    END_OF_TWIST,
    NEUTRAL,
    lower_arm,
    raised,
    turned,
)
from wholebody.ergonomics.work import COUPLINGS, Work, both_feet, seen
from wholebody.figures.figure import Figure
from wholebody.scene.scene import Scene


@dataclass(frozen=True)
class RebaParts(Checked):
    """Scores of the parts of the body, which the tables combine; an InputError if one is out of its range.

    Examples:
        >>> wb.ergonomics.RebaParts(neck=1, trunk=2, legs=1, upper_arm=1, lower_arm=1, wrist=1).score
        1
    """

    neck: Annotated[int, Range(1, 3, whole=True)]
    trunk: Annotated[int, Range(1, 5, whole=True)]
    legs: Annotated[int, Range(1, 4, whole=True)]
    upper_arm: Annotated[int, Range(1, 6, whole=True)]
    lower_arm: Annotated[int, Range(1, 2, whole=True)]
    wrist: Annotated[int, Range(1, 3, whole=True)]
    load: Annotated[int, Range(0, 3, whole=True)] = 0
    coupling: Annotated[int, Range(0, 3, whole=True)] = 0
    activity: Annotated[int, Range(0, 3, whole=True)] = 0

    @property
    def body(self) -> int:
        """Score A: table A and the load."""
        return int(published("reba")["A"][self.neck - 1][self.trunk - 1][self.legs - 1]) + self.load

    @property
    def arm(self) -> int:
        """Score B: table B and the coupling."""
        return int(published("reba")["B"][self.upper_arm - 1][self.lower_arm - 1][self.wrist - 1]) + self.coupling

    @property
    def score(self) -> int:
        """The REBA score, 1 to 15: table C and the activity."""
        return int(published("reba")["C"][min(self.body, 12) - 1][min(self.arm, 12) - 1]) + self.activity

    @property
    def action(self) -> str:
        """What the paper says of the score."""
        return action("reba", self.score)


class Reba(BothSides):
    """REBA of both sides: the parts with the arm and the leg of each side.

    Examples:
        >>> reba = wb.ergonomics.reba(human, standing)
        >>> max(reba.left.score, reba.right.score) == reba.score
        True
    """

    left: RebaParts
    right: RebaParts


def reba(figure: Figure | Scene, q: Array, work: Work | None = None) -> Reba:
    """REBA of a person's posture; arguments and errors as for `rula`. Of `work` the grip counts too.

    Examples:
        >>> wb.ergonomics.reba(human, standing).score
        1
    """
    person = seen(figure, q, work, "reba")
    return Reba(*(reba_parts(person.angles, side, person.work) for side in SIDES))


def reba_parts(angles: BodyAngles, side: str, work: Work) -> RebaParts:
    """Scores of the parts of one side."""
    arm = angles.side(side)
    head = 1 if -NEUTRAL <= angles.neck_flexion <= radians(20.0) else 2
    twisted = abs(arm.wrist_deviation) > DEVIATED or abs(arm.forearm_twist) > END_OF_TWIST
    return RebaParts(
        neck=head + min(turned(angles.neck_twist, angles.neck_lateral), 1),
        trunk=_trunk(angles),
        legs=_legs(angles, side, work),
        upper_arm=max(raised(arm) - int(work.arms_supported), 1),
        lower_arm=lower_arm(arm),
        wrist=(1 if abs(arm.wrist_flexion) <= radians(15.0) else 2) + int(twisted),
        load=(0 if work.load < 5.0 else 1 if work.load <= 10.0 else 2) + int(work.shock),
        coupling=COUPLINGS.index(work.coupling),
        activity=int(work.static) + int(work.repeated) + int(work.unstable),
    )


def _trunk(angles: BodyAngles) -> int:
    bent = angles.trunk_flexion
    score = 4 if bent > radians(60.0) else 3 if bent > radians(20.0) or bent < -radians(20.0) else 2
    if abs(bent) <= NEUTRAL:
        score = 1
    return score + min(turned(angles.trunk_twist, angles.trunk_lateral), 1)


def _legs(angles: BodyAngles, side: str, work: Work) -> int:
    if work.sits(angles):
        return 1
    knee = angles.side(side).knee_flexion
    bent = 2 if knee > radians(60.0) else 1 if knee >= radians(30.0) else 0
    return (1 if both_feet(angles) or work.walking else 2) + bent
