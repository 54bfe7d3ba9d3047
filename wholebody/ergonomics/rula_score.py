"""RULA, rapid upper limb assessment: L. McAtamney and E. N. Corlett, Applied Ergonomics 24(2), 1993, pages 91 to 99.

The tables are those of the paper as the worksheets of A. Hedge (Cornell University) and ErgonomicsPlus print them. Nine
public implementations were compared with table C; eight agree in every cell. Where the paper has words instead of
numbers ("twisted", "raised"), the constants say what is taken. Loads are the paper's: of more than 10 kg now and then
it scores 2, which the worksheets shorten to 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians
from typing import Annotated

from wholebody.base.arrays import Array
from wholebody.base.fields import Checked, Range
from wholebody.ergonomics.angles import SIDES, BodyAngles, SideAngles
from wholebody.ergonomics.published import BothSides, action, published
from wholebody.ergonomics.work import Work, both_feet, seen
from wholebody.figures.figure import Figure
from wholebody.scene.scene import Scene

NEUTRAL = radians(5.0)  # Up to which a wrist is neutral, a trunk upright, and a head not in extension
RAISED = 0.03  # m: of a shoulder
DEVIATED = radians(10.0)  # of a wrist from its middle line
END_OF_TWIST = radians(45.0)  # half of the forearm's usual range to either side: "at or near the end of range"


@dataclass(frozen=True)
class RulaParts(Checked):
    """Scores of the parts of the body, which the tables combine; an InputError if one is out of its range.

    Examples:
        >>> wb.ergonomics.RulaParts(upper_arm=1, lower_arm=1, wrist=1, wrist_twist=1, neck=1, trunk=1, legs=1).score
        1
    """

    upper_arm: Annotated[int, Range(1, 6, whole=True)]
    lower_arm: Annotated[int, Range(1, 3, whole=True)]
    wrist: Annotated[int, Range(1, 4, whole=True)]
    wrist_twist: Annotated[int, Range(1, 2, whole=True)]
    neck: Annotated[int, Range(1, 6, whole=True)]
    trunk: Annotated[int, Range(1, 6, whole=True)]
    legs: Annotated[int, Range(1, 2, whole=True)]
    muscle: Annotated[int, Range(0, 1, whole=True)] = 0  # static or repeated use
    force: Annotated[int, Range(0, 3, whole=True)] = 0

    @property
    def arm(self) -> int:
        """Posture score A, of table A."""
        table = published("rula")["A"]
        return int(table[self.upper_arm - 1][self.lower_arm - 1][self.wrist - 1][self.wrist_twist - 1])

    @property
    def body(self) -> int:
        """Posture score B, of table B."""
        return int(published("rula")["B"][self.neck - 1][self.trunk - 1][self.legs - 1])

    @property
    def score(self) -> int:
        """The grand score, 1 to 7, of table C."""
        more = self.muscle + self.force
        return int(published("rula")["C"][min(self.arm + more, 8) - 1][min(self.body + more, 7) - 1])

    @property
    def action(self) -> str:
        """What the paper says of the score."""
        return action("rula", self.score)


class Rula(BothSides):
    """RULA of both sides.

    Examples:
        >>> rula = wb.ergonomics.rula(human, standing)
        >>> max(rula.left.score, rula.right.score) == rula.score
        True
    """

    left: RulaParts
    right: RulaParts


def rula(figure: Figure | Scene, q: Array, work: Work | None = None) -> Rula:
    """RULA of a person's posture.

    Args:
        figure: a person, see `body_angles`; or a scene, whose things then tell whether the person sits.
        q: (nq,) posture.
        work: load and repetition; none if left out.

    Raises:
        InputError: no person, no posture, or no work.

    Examples:
        >>> wb.ergonomics.rula(human, standing, wb.ergonomics.Work(repeated=True)).score
        3
    """
    person = seen(figure, q, work, "rula")
    return Rula(*(rula_parts(person.angles, side, person.work) for side in SIDES))


def rula_parts(angles: BodyAngles, side: str, work: Work) -> RulaParts:
    """Scores of the parts of one side."""
    arm = angles.side(side)
    bent = abs(arm.wrist_flexion)
    wrist = 1 if bent <= NEUTRAL else 2 if bent <= radians(15.0) else 3
    balanced = work.sits(angles) or both_feet(angles)
    outward = arm.forearm_outward > radians(30.0)  # "out to the side of the body"
    return RulaParts(
        upper_arm=max(raised(arm) - int(work.arms_supported), 1),
        lower_arm=lower_arm(arm) + int(arm.across or outward),
        wrist=wrist + int(abs(arm.wrist_deviation) > DEVIATED),
        wrist_twist=1 + int(abs(arm.forearm_twist) > END_OF_TWIST),
        neck=_neck(angles),
        trunk=_trunk(angles, work),
        legs=1 if work.legs_supported and balanced else 2,
        muscle=int(work.static or work.repeated),
        force=_force(work),
    )


def raised(arm: SideAngles) -> int:
    """Score of an upper arm that nothing supports, 1 to 6: its flexion, a raised shoulder, abduction; also of REBA."""
    bent = arm.shoulder_flexion
    score = 4 if bent > radians(90.0) else 3 if bent > radians(45.0) else 2 if abs(bent) > radians(20.0) else 1
    return score + int(arm.shoulder_rise > RAISED) + int(arm.shoulder_abduction > radians(20.0))


def lower_arm(arm: SideAngles) -> int:
    """Score of the elbow's flexion, 1 or 2; of RULA and REBA."""
    return 1 if radians(60.0) <= arm.elbow_flexion <= radians(100.0) else 2


def turned(*angles: float) -> int:
    """How many of some angles, to one or the other side, count as turned."""
    # from which a trunk or neck counts as twisted or bent sideways: EN 1005-4 (2005) calls up to 10
    # degrees "not clearly visible"
    return sum(abs(angle) > radians(10.0) for angle in angles)


def _neck(angles: BodyAngles) -> int:
    bent = angles.neck_flexion
    score = 4 if bent < -NEUTRAL else 1 if bent <= radians(10.0) else 2 if bent <= radians(20.0) else 3
    return score + turned(angles.neck_twist, angles.neck_lateral)


def _trunk(angles: BodyAngles, work: Work) -> int:
    """A trunk that rests on a back scores 1 if it is at least at a right angle to the thighs, however it leans."""
    bent = abs(angles.trunk_flexion)
    opened = pi - max(angles.left.thigh_slope, angles.right.thigh_slope) - angles.trunk_flexion
    # between trunk and thighs, from which a seated trunk with a back is well supported
    rests = bool(work.back_supported) and work.sits(angles) and opened >= radians(90.0)
    # upright too scores 2 "if not" well supported while seated, on the worksheet of Cornell University
    free = work.sits(angles) and work.back_supported is False
    score = 1 if bent <= NEUTRAL else 2 if bent <= radians(20.0) else 3 if bent <= radians(60.0) else 4
    return (1 if rests else max(score, 1 + int(free))) + turned(angles.trunk_twist, angles.trunk_lateral)


def _force(work: Work) -> int:
    """Loads of less than 2 kg: 0; of 2 to 10 kg: 1, static or repeated 2; of more: 2, static or repeated 3; shock 3."""
    if work.shock:
        return 3
    if work.load < 2.0:
        return 0
    return (1 if work.load <= 10.0 else 2) + int(work.static or work.repeated)
