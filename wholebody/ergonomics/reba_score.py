"""REBA, rapid entire body assessment: S. Hignett and L. McAtamney, Applied Ergonomics 31, 2000, pages 201 to 205."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.ergonomics.angles import SIDES, BodyAngles, BothSides
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

TABLE_A = (
    ((1, 2, 3, 4), (2, 3, 4, 5), (2, 4, 5, 6), (3, 5, 6, 7), (4, 6, 7, 8)),
    ((1, 2, 3, 4), (3, 4, 5, 6), (4, 5, 6, 7), (5, 6, 7, 8), (6, 7, 8, 9)),
    ((3, 3, 5, 6), (4, 5, 6, 7), (5, 6, 7, 8), (6, 7, 8, 9), (7, 8, 9, 9)),
)
"""Of neck (1 to 3), trunk (1 to 5) and legs (1 to 4)."""

TABLE_B = (
    ((1, 2, 2), (1, 2, 3)),
    ((1, 2, 3), (2, 3, 4)),
    ((3, 4, 5), (4, 5, 5)),
    ((4, 5, 5), (5, 6, 7)),
    ((6, 7, 8), (7, 8, 8)),
    ((7, 8, 8), (8, 9, 9)),
)
"""Of upper arm (1 to 6), lower arm (1 or 2) and wrist (1 to 3)."""

TABLE_C = (
    (1, 1, 1, 2, 3, 3, 4, 5, 6, 7, 7, 7),
    (1, 2, 2, 3, 4, 4, 5, 6, 6, 7, 7, 8),
    (2, 3, 3, 3, 4, 5, 6, 7, 7, 8, 8, 8),
    (3, 4, 4, 4, 5, 6, 7, 8, 8, 9, 9, 9),
    (4, 4, 4, 5, 6, 7, 8, 8, 9, 9, 9, 9),
    (6, 6, 6, 7, 8, 8, 9, 9, 10, 10, 10, 10),
    (7, 7, 7, 8, 9, 9, 9, 10, 10, 11, 11, 11),
    (8, 8, 8, 9, 10, 10, 10, 10, 10, 11, 11, 11),
    (9, 9, 9, 10, 10, 10, 11, 11, 11, 12, 12, 12),
    (10, 10, 10, 11, 11, 11, 11, 12, 12, 12, 12, 12),
    (11, 11, 11, 11, 12, 12, 12, 12, 12, 12, 12, 12),
    (12, 12, 12, 12, 12, 12, 12, 12, 12, 12, 12, 12),
)
"""Of score A and score B, 1 to 12."""

ACTIONS = (
    (1, "negligible risk"),
    (3, "low risk; change may be needed"),
    (7, "medium risk; investigate further, change soon"),
    (10, "high risk; investigate and change"),
    (15, "very high risk; change now"),
)


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
        return TABLE_A[self.neck - 1][self.trunk - 1][self.legs - 1] + self.load

    @property
    def arm(self) -> int:
        """Score B: table B and the coupling."""
        return TABLE_B[self.upper_arm - 1][self.lower_arm - 1][self.wrist - 1] + self.coupling

    @property
    def score(self) -> int:
        """The REBA score, 1 to 15: table C and the activity."""
        return TABLE_C[min(self.body, 12) - 1][min(self.arm, 12) - 1] + self.activity

    @property
    def action(self) -> str:
        """What the paper says of the score."""
        return next(words for most, words in ACTIONS if self.score <= most)


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
