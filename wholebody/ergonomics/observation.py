"""RULA, REBA and OWAS of a person's posture, and the published tables of these and of the lifting equation.

RULA, rapid upper limb assessment: L. McAtamney and E. N. Corlett, Applied Ergonomics 24(2), 1993, pages 91 to 99. The
tables are those of the paper as the worksheets of A. Hedge (Cornell University) and ErgonomicsPlus print them. Nine
public implementations were compared with table C; eight agree in every cell. Loads are the paper's: of more than 10 kg
now and then it scores 2, which the worksheets shorten to 3.

REBA, rapid entire body assessment: S. Hignett and L. McAtamney, Applied Ergonomics 31, 2000, pages 201 to 205. The
paper raises the upper arm's score where it is "abducted or rotated", the worksheets where it is abducted: rotation of
the upper arm about its axis is not scored here.

OWAS, Ovako working posture analysing system: O. Karhu, P. Kansi, I. Kuorinka, Applied Ergonomics 8(4), 1977. The action
categories are those of Karhu, Härkönen, Sorvali and Vepsäläinen, Applied Ergonomics 12(1), 1981, as handbooks tabulate
them; where public tables differ in a cell, the value of most of them was taken.

Where the papers have words or pictures instead of numbers ("twisted", "raised"), the constants say what is taken.
`tables.json` has:

RULA: tables A (upper arm 1 to 6, lower arm 1 to 3, wrist 1 to 4, wrist twist 1 or 2), B (neck 1 to 6, trunk 1 to 6,
legs 1 or 2) and C (score C 1 to 8 and more, score D 1 to 7 and more), and the greatest score of each action level.
REBA: tables A (neck 1 to 3, trunk 1 to 5, legs 1 to 4), B (upper arm 1 to 6, lower arm 1 or 2, wrist 1 to 3) and C
(score A and score B, 1 to 12), and the greatest score of each action level.
OWAS: words of the code's digits, and action categories by back and arms, in a text by legs and for each by load.
NIOSH: lifts a minute of table 5; rows of the greatest duration in hours and the frequency multipliers with the hands
below 75 cm, and at 75 cm or above; coupling multipliers of table 7, below 75 cm, and at 75 cm or above.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from math import pi, radians
from pathlib import Path
from typing import Annotated, Any

from wholebody.base.arrays import Array
from wholebody.base.fields import Checked, Range
from wholebody.ergonomics.angles import SIDES, BodyAngles, SideAngles
from wholebody.ergonomics.work import COUPLINGS, KNEELING, Seen, Work, both_feet, seen
from wholebody.figures.figure import Figure
from wholebody.scene.scene import Scene

NEUTRAL = 5.0  # degrees: up to which a wrist is neutral, a trunk upright, and a head not in extension
DEVIATED = radians(10.0)  # of a wrist from its middle line
END_OF_TWIST = radians(45.0)  # half of the forearm's usual range to either side: "at or near the end of range"
TURNED = radians(20.0)  # OWAS: of the trunk to any side or about its axis
BENT_KNEE = radians(30.0)  # OWAS


@cache
def published(method: str) -> dict[str, Any]:
    """The tables of "rula", "reba", "owas" or "niosh"."""
    tables: dict[str, dict[str, Any]] = json.loads(Path(__file__).with_name("tables.json").read_text("utf-8"))
    return tables[method]


def _entry(method: str, table: str, *scores: int) -> int:
    """The entry of a table in the row, column and so on of some scores, which count from 1."""
    found = published(method)[table]
    for score in scores:
        found = found[score - 1]
    return int(found)


def _action(method: str, score: int) -> str:
    """What the paper of "rula" or "reba" says of a score."""
    return str(next(words for greatest, words in published(method)["actions"] if score <= greatest))


@dataclass(frozen=True)
class BothSides:
    """Scores of both sides, of which the worse one counts."""

    left: Any  # the parts of each side
    right: Any

    @property
    def worse(self) -> str:
        """The side with the greater score; "right" where they are equal."""
        return "left" if self.left.score > self.right.score else "right"

    @property
    def score(self) -> int:
        """The greater score of both sides."""
        return int(max(self.left.score, self.right.score))

    @property
    def action(self) -> str:
        """What the paper says of the greater score."""
        return str(getattr(self, self.worse).action)


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
        return _entry("rula", "A", self.upper_arm, self.lower_arm, self.wrist, self.wrist_twist)

    @property
    def body(self) -> int:
        """Posture score B, of table B."""
        return _entry("rula", "B", self.neck, self.trunk, self.legs)

    @property
    def score(self) -> int:
        """The grand score, 1 to 7, of table C."""
        more = self.muscle + self.force
        return _entry("rula", "C", min(self.arm + more, 8), min(self.body + more, 7))

    @property
    def action(self) -> str:
        """What the paper says of the score."""
        return _action("rula", self.score)


class Rula(BothSides):
    """RULA of both sides.

    Examples:
        >>> rula = wb.ergonomics.rula(human, standing)
        >>> max(rula.left.score, rula.right.score) == rula.score
        True
    """

    left: RulaParts
    right: RulaParts


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
        return _entry("reba", "A", self.neck, self.trunk, self.legs) + self.load

    @property
    def arm(self) -> int:
        """Score B: table B and the coupling."""
        return _entry("reba", "B", self.upper_arm, self.lower_arm, self.wrist) + self.coupling

    @property
    def score(self) -> int:
        """The REBA score, 1 to 15: table C and the activity."""
        return _entry("reba", "C", min(self.body, 12), min(self.arm, 12)) + self.activity

    @property
    def action(self) -> str:
        """What the paper says of the score."""
        return _action("reba", self.score)


class Reba(BothSides):
    """REBA of both sides: neck, trunk and legs are scored once, for the body, and the arm of each side.

    Examples:
        >>> reba = wb.ergonomics.reba(human, standing)
        >>> max(reba.left.score, reba.right.score) == reba.score
        True
    """

    left: RebaParts
    right: RebaParts


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
        return _entry("owas", "categories", self.back, self.arms, 3 * (self.legs - 1) + self.load)

    @property
    def action(self) -> str:
        """What the category says."""
        return str(published("owas")["actions"][self.category - 1])

    def __str__(self) -> str:
        digits = {"back": self.back, "arms": self.arms, "legs": self.legs, "loads": self.load}
        words = [published("owas")[name][digit - 1] for name, digit in digits.items()]
        return f"{self.code}: back {words[0]}, arms {words[1]}, {words[2]}, {words[3]}"


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
    return rula_of(seen(figure, q, work, "rula"))


def reba(figure: Figure | Scene, q: Array, work: Work | None = None) -> Reba:
    """REBA of a person's posture; arguments and errors as for `rula`. Of `work` the grip counts too.

    Examples:
        >>> wb.ergonomics.reba(human, standing).score
        1
    """
    return reba_of(seen(figure, q, work, "reba"))


def owas(figure: Figure | Scene, q: Array, work: Work | None = None) -> Owas:
    """OWAS of a person's posture; arguments and errors as for `rula`. Of `work` counts whether the person walks too.

    Examples:
        >>> wb.ergonomics.owas(human, standing).category
        1
    """
    return owas_of(seen(figure, q, work, "owas"))


def rula_of(person: Seen) -> Rula:
    """RULA of what is seen."""
    return Rula(*(_rula_parts(person.angles, side, person.work) for side in SIDES))


def reba_of(person: Seen) -> Reba:
    """REBA of what is seen."""
    return Reba(*(_reba_parts(person.angles, side, person.work) for side in SIDES))


def owas_of(person: Seen) -> Owas:
    """OWAS of what is seen."""
    angles, work = person.angles, person.work
    twisted = max(abs(angles.trunk_twist), abs(angles.trunk_lateral)) > TURNED
    return Owas(
        back=1 + int(abs(angles.trunk_flexion) > TURNED) + 2 * int(twisted),
        arms=1 + int(angles.left.arm_raised) + int(angles.right.arm_raised),
        legs=_owas_legs(angles, work),
        load=1 if work.load < 10.0 else 2 if work.load <= 20.0 else 3,
    )


def _rula_parts(angles: BodyAngles, side: str, work: Work) -> RulaParts:
    arm, often = angles.side(side), work.static or work.repeated
    balanced = work.sits(angles) or both_feet(angles)
    outward = arm.forearm_outward > radians(30.0)  # "out to the side of the body"
    head = 4 if angles.neck_flexion < -radians(NEUTRAL) else _grade(angles.neck_flexion, 10.0, 20.0)
    load = 0 if work.load < 2.0 else (1 if work.load <= 10.0 else 2) + int(often)
    return RulaParts(
        upper_arm=_upper_arm(arm, work),
        lower_arm=_lower_arm(arm) + int(arm.across or outward),
        wrist=_grade(abs(arm.wrist_flexion), NEUTRAL, 15.0) + int(abs(arm.wrist_deviation) > DEVIATED),
        wrist_twist=1 + int(abs(arm.forearm_twist) > END_OF_TWIST),
        neck=head + _turned(angles.neck_twist, angles.neck_lateral),
        trunk=_rula_trunk(angles, work),
        legs=1 if work.legs_supported and balanced else 2,
        muscle=int(often),
        force=3 if work.shock else load,
    )


def _reba_parts(angles: BodyAngles, side: str, work: Work) -> RebaParts:
    arm, bent = angles.side(side), angles.trunk_flexion
    # "knee(s)": the paper scores legs once, as neck and trunk, and the arms of both sides
    knee = max(angles.left.knee_flexion, angles.right.knee_flexion)
    head = 1 if -radians(NEUTRAL) <= angles.neck_flexion <= radians(20.0) else 2
    twisted = abs(arm.wrist_deviation) > DEVIATED or abs(arm.forearm_twist) > END_OF_TWIST
    trunk = min(_grade(abs(bent), NEUTRAL, 20.0, 60.0), 4 if bent > 0.0 else 3)
    standing = 1 if both_feet(angles) or work.walking else 2
    return RebaParts(
        neck=head + min(_turned(angles.neck_twist, angles.neck_lateral), 1),
        trunk=trunk + min(_turned(angles.trunk_twist, angles.trunk_lateral), 1),
        legs=1 if work.sits(angles) else standing + int(knee >= radians(30.0)) + int(knee > radians(60.0)),
        upper_arm=_upper_arm(arm, work),
        lower_arm=_lower_arm(arm),
        wrist=_grade(abs(arm.wrist_flexion), 15.0) + int(twisted),
        load=(0 if work.load < 5.0 else 1 if work.load <= 10.0 else 2) + int(work.shock),
        coupling=COUPLINGS.index(work.coupling),
        activity=int(work.static) + int(work.repeated) + int(work.unstable),
    )


def _owas_legs(angles: BodyAngles, work: Work) -> int:
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


def _rula_trunk(angles: BodyAngles, work: Work) -> int:
    """A trunk that rests on a back scores 1 if it is at least at a right angle to the thighs, however it leans."""
    opened = pi - max(angles.left.thigh_slope, angles.right.thigh_slope) - angles.trunk_flexion
    # between trunk and thighs, from which a seated trunk with a back is well supported
    rests = bool(work.back_supported) and work.sits(angles) and opened >= radians(90.0)
    # upright too scores 2 "if not" well supported while seated, on the worksheet of Cornell University
    free = work.sits(angles) and work.back_supported is False
    score = max(_grade(abs(angles.trunk_flexion), NEUTRAL, 20.0, 60.0), 1 + int(free))
    return (1 if rests else score) + _turned(angles.trunk_twist, angles.trunk_lateral)


def _upper_arm(arm: SideAngles, work: Work) -> int:
    """Score of RULA and REBA: flexion, a raised shoulder, abduction, and what supports it."""
    bent = max(arm.shoulder_flexion, -radians(45.0))  # backward there are two classes
    score = _grade(abs(bent), 20.0, 45.0, 90.0) + int(arm.shoulder_rise > 0.03)  # m: a raised shoulder
    return max(score + int(arm.shoulder_abduction > radians(20.0)) - int(work.arms_supported), 1)


def _lower_arm(arm: SideAngles) -> int:
    """Score of the elbow's flexion, 1 or 2; of RULA and REBA."""
    return 1 if radians(60.0) <= arm.elbow_flexion <= radians(100.0) else 2


def _grade(angle: float, *bounds: float) -> int:
    """1, and 1 for each of some bounds, degrees, that an angle is beyond, radians."""
    return 1 + sum(angle > radians(bound) for bound in bounds)


def _turned(*angles: float) -> int:
    """How many of some angles, to one or the other side, count as turned."""
    # a trunk or neck is twisted or bent sideways: EN 1005-4 (2005) calls up to 10 degrees "not clearly visible"
    return sum(abs(angle) > radians(10.0) for angle in angles)
