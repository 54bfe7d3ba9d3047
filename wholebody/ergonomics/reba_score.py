"""REBA, rapid entire body assessment: S. Hignett and L. McAtamney, Applied Ergonomics 31, 2000, pages 201 to 205."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.ergonomics.angles import SIDES, BodyAngles, BothSides
from wholebody.ergonomics.published import action, published
from wholebody.ergonomics.rula_score import (
    ABDUCTED,
    DEVIATED,
    END_OF_TWIST,
    NEUTRAL,
    RAISED,
    lower_arm,
    position,
    turned,
)
from wholebody.ergonomics.seat import seen
from wholebody.ergonomics.work import COUPLINGS, Work, both_feet
from wholebody.figures.figure import Figure
from wholebody.scene.scene import Scene


@dataclass(frozen=True)
class RebaParts:
    """Scores of the parts of the body, which the tables combine.

    Attributes:
        neck: 1 to 3.
        trunk: 1 to 5.
        legs: 1 to 4.
        upper_arm: 1 to 6.
        lower_arm: 1 or 2.
        wrist: 1 to 3.
        load: 0 to 3.
        coupling: 0 to 3.
        activity: 0 to 3.
    """

    neck: int
    trunk: int
    legs: int
    upper_arm: int
    lower_arm: int
    wrist: int
    load: int = 0
    coupling: int = 0
    activity: int = 0

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InputError: a score out of its range.
        """
        for name, most in {"neck": 3, "trunk": 5, "legs": 4, "upper_arm": 6, "lower_arm": 2, "wrist": 3}.items():
            checks.settle(self, name, checks.whole(getattr(self, name), f"RebaParts: {name}", 1, most))
        for name in ("load", "coupling", "activity"):
            checks.settle(self, name, checks.whole(getattr(self, name), f"RebaParts: {name}", 0, 3))

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


class Reba(BothSides[RebaParts]):
    """REBA of both sides: the parts with the arm and the leg of each side."""


def reba(figure: Figure | Scene, q: Array, work: Work | None = None) -> Reba:
    """REBA of a person's posture.

    Args:
        figure: a person, see `body_angles`; or a scene, whose things then tell whether the person sits.
        q: (nq,) posture.
        work: load, grip and repetition; none if left out.

    Raises:
        InputError: no person, no posture, or no work.
    """
    person = seen(figure, q, work, "reba")
    return Reba(*(reba_parts(person.angles, side, person.work) for side in SIDES))


def reba_parts(angles: BodyAngles, side: str, work: Work) -> RebaParts:
    """Scores of the parts of one side."""
    arm = angles.side(side)
    upper = position(arm) + int(arm.shoulder_rise > RAISED) + int(abs(arm.shoulder_abduction) > ABDUCTED)
    twisted = abs(arm.wrist_deviation) > DEVIATED or abs(arm.forearm_twist) > END_OF_TWIST
    return RebaParts(
        neck=_neck(angles),
        trunk=_trunk(angles),
        legs=_legs(angles, side, work),
        upper_arm=max(upper - int(work.arms_supported), 1),
        lower_arm=lower_arm(arm),
        wrist=(1 if abs(arm.wrist_flexion) <= radians(15.0) else 2) + int(twisted),
        load=(0 if work.load < 5.0 else 1 if work.load <= 10.0 else 2) + int(work.shock),
        coupling=COUPLINGS.index(work.coupling),
        activity=int(work.static) + int(work.repeated) + int(work.unstable),
    )


def _neck(angles: BodyAngles) -> int:
    score = 1 if -NEUTRAL <= angles.neck_flexion <= radians(20.0) else 2
    return score + min(turned(angles.neck_twist, angles.neck_lateral), 1)


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
