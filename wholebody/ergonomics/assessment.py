"""All ergonomic scores of one posture, as an object, a table and plain values."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import degrees
from typing import Any

from wholebody.base.arrays import Array, brief
from wholebody.ergonomics.angles import SIDES, BodyAngles, check_person
from wholebody.ergonomics.exertion import StaticTorques, static_torques
from wholebody.ergonomics.observation import Owas, Reba, Rula, owas_of, reba_of, rula_of
from wholebody.ergonomics.work import Work, seen
from wholebody.figures.figure import Figure
from wholebody.figures.strength import Strength
from wholebody.scene.scene import Scene

Color = tuple[float, float, float, float]

COLORS: tuple[Color, ...] = (
    (0.10, 0.59, 0.25, 1.0),
    (0.65, 0.85, 0.42, 1.0),
    (0.99, 0.75, 0.38, 1.0),
    (0.84, 0.19, 0.15, 1.0),
)
"""Green to red, of scores from the least to the greatest."""

PARTS = {"upper_arm": "upper_arm", "clavicle": "upper_arm", "forearm": "lower_arm", "hand": "wrist"}
"""Segments of a side -> the parts in RULA that colour them; legs for all others."""

MOST = {"upper_arm": 6, "lower_arm": 3, "wrist": 4, "neck": 6, "trunk": 6, "legs": 2}


@dataclass(frozen=True)
class Ergonomics:
    """The ergonomic scores of a posture.

    Attributes:
        angles: of the body.
        rula, reba, owas: the scores.
        torques: static torques against strength.
        seat: whether the person was taken to sit, and why.

    Examples:
        >>> wb.ergonomics.ergonomics_of(human, standing).rula.left.score
        2
    """

    angles: BodyAngles
    rula: Rula
    reba: Reba
    owas: Owas
    torques: StaticTorques
    seat: str = ""

    __repr__ = brief

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Rows of a table: method, left, right, and what it says of the worse side."""
        made = [
            (name, str(found.left.score), str(found.right.score), f"{found.score}: {found.action}")
            for name, found in (("RULA", self.rula), ("REBA", self.reba))
        ]
        made.append(("OWAS", "", "", f"category {self.owas.category}: {self.owas.action} ({self.owas})"))
        sides = [f"{share:.0%} {joint}" if joint else "" for joint, share in map(self.torques.of_side, SIDES)]
        joint, share = self.torques.worst
        made.append(("strength", *sides, f"{share:.0%} of the strength of {joint}" if joint else "not known"))  # type: ignore[arg-type]
        made.append(("back", "", "", f"{self.torques.compression:.0f} N press the disc L5/S1"))
        made.append(("seat", "", "", self.seat))
        return made

    def __str__(self) -> str:
        table = [("score", "left", "right", "worse"), *self.rows()]
        wide = [max(len(row[column]) for row in table) for column in range(3)]
        return "\n".join(
            f"{score:{wide[0]}}  {left:{wide[1]}}  {right:{wide[2]}}  {worse}" for score, left, right, worse in table
        )

    def summary(self) -> dict[str, Any]:
        """All of it as plain numbers and texts; angles in degrees."""
        scores = {}
        for name, found in (("rula", self.rula), ("reba", self.reba)):
            sides = {side: {**asdict(getattr(found, side)), "score": getattr(found, side).score} for side in SIDES}
            scores[name] = {**sides, "worse": found.worse, "score": found.score, "action": found.action}
        joint, share = self.torques.worst
        return {
            **scores,
            "owas": {"code": self.owas.code, "category": self.owas.category, "action": self.owas.action},
            "strength": {"worst": joint, "share": share, "shares": dict(self.torques.share)},
            "compression": self.torques.compression,
            "torques": dict(self.torques.torque),
            "seat": self.seat,
            "angles": _plain(asdict(self.angles)),
        }

    def colors(self, figure: Figure) -> dict[str, Color]:
        """Segments of a person -> colour by the part's score in RULA: green is the least, red the greatest."""
        found: dict[str, Color] = {}
        for name in check_person(figure, "colors: figure").segments:
            side, _, part = name.partition("_")
            if side in SIDES:
                mine, known = getattr(self.rula, side), PARTS.get(part, "legs")
            else:
                mine, known = self.rula.right, "neck" if name in ("neck", "head") else "trunk"
            level = (getattr(mine, known) - 1) / (MOST[known] - 1)
            found[name] = COLORS[min(int(level * len(COLORS)), len(COLORS) - 1)]
        return found


def ergonomics_of(
    figure: Figure | Scene, q: Array, work: Work | None = None, strength: Strength | None = None
) -> Ergonomics:
    """Assess a person's posture: RULA, REBA, OWAS, and static torques against strength.

    Args:
        figure: a person, see `body_angles`; or a scene with one: then whoever has a thing below pelvis or thighs sits.
        q: (nq,) posture.
        work: load, repetition, support; none if left out.
        strength: of the person; the median of its sex and age if left out.

    Raises:
        InputError: no person, no posture, no work or no strength.

    Examples:
        >>> scores = wb.ergonomics.ergonomics_of(human, standing, wb.ergonomics.Work(load=6.0))
        >>> rows = scores.rows()
    """
    person = seen(figure, q, work, "ergonomics_of")
    seated = person.work.sits(person.angles)
    torques = static_torques(person.figure, q, load=person.work.load, seated=seated, strength=strength)
    return Ergonomics(person.angles, rula_of(person), reba_of(person), owas_of(person), torques, person.seat)


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    """Angles in degrees; lengths, shares and flags as they are."""
    kept = ("shoulder_rise", "foot_height", "knee_height", "left_share", "center_ahead")
    nested = {name: _plain(value) for name, value in values.items() if isinstance(value, dict)}
    turned = {name: degrees(value) for name, value in values.items() if isinstance(value, float) and name not in kept}
    return {**values, **nested, **turned}
