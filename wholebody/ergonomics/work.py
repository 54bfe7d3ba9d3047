"""Data beside the posture: load, repetition, grip, support; and whether the person sits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians
from typing import Annotated, Literal, NamedTuple, get_args

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.fields import Checked, Range
from wholebody.ergonomics.angles import BodyAngles, body_angles
from wholebody.figures.figure import Figure
from wholebody.scene.scene import Scene

Coupling = Literal["good", "fair", "poor", "unacceptable"]
COUPLINGS: tuple[Coupling, ...] = get_args(Coupling)
LOAD = Range(0.0, 200.0, "kg")

KNEELING = 0.12  # m: height of a knee above the lower ankle up to which it is on the ground
BOTH_FEET = 0.1  # share of the weight that a foot bears at least if both stand


@dataclass(frozen=True)
class Work(Checked):
    """What observation methods ask besides the posture.

    Attributes:
        load: mass in both hands together, kg.
        static: whether the posture is held for longer than a minute (RULA: ten minutes).
        repeated: whether the action is repeated more than four times a minute.
        shock: whether the load comes with a shock or a rapid build-up.
        unstable: whether the posture changes rapidly over a large range, or the base is unstable (REBA).
        coupling: of hands and load: "good", "fair", "poor" or "unacceptable" (REBA).
        arms_supported: whether the arms rest on something, or the person leans.
        legs_supported: whether legs and feet are supported (RULA).
        back_supported: whether the back of somebody seated rests on something (RULA); None to tell it from the scene;
            without a scene it is unknown then, and neither good nor bad.
        walking: whether the person walks (OWAS).
        seated: None to tell it from the posture: both thighs lie, both knees are bent, no knee is on the ground, and
            the centre of mass is behind the feet.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> work = wb.ergonomics.Work(load=6.0, repeated=True)
    """

    load: Annotated[float, LOAD] = 0.0
    static: bool = False
    repeated: bool = False
    shock: bool = False
    unstable: bool = False
    coupling: Coupling = "good"
    arms_supported: bool = False
    legs_supported: bool = True
    walking: bool = False
    seated: bool | None = None
    back_supported: bool | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.seated and self.walking:
            raise InputError("Work: a person who walks is not seated; leave one of them out")

    def sits(self, angles: BodyAngles) -> bool:
        """Whether the person is seated."""
        checks.instance(angles, BodyAngles, "sits: angles", "give those of wb.ergonomics.body_angles(figure, q)")
        if self.seated is not None:
            return self.seated
        # rad: slopes of both thighs, and of the knees 30 degrees, from which a body counts as seated
        lies = all(
            side.thigh_slope > 0.7854 and side.knee_flexion > 0.5236 and side.knee_height > KNEELING
            for side in (angles.left, angles.right)
        )
        # m: centre of mass before the ankles; farther back nobody stands on their feet
        behind = angles.center_ahead < -0.12
        # rad: a thigh that points upwards belongs to nobody who sits
        return lies and behind and max(angles.left.thigh_slope, angles.right.thigh_slope) < 2.0


def both_feet(angles: BodyAngles) -> bool:
    """Whether both feet bear weight."""
    # m: height of an ankle above the other up to which both feet stand
    level = max(angles.left.foot_height, angles.right.foot_height) <= 0.08
    return level and BOTH_FEET <= angles.left_share <= 1.0 - BOTH_FEET


class Seen(NamedTuple):
    """What the scores are made of."""

    figure: Figure  # the person
    angles: BodyAngles  # of the body
    work: Work  # with `seated` decided, and `back_supported` where a scene tells
    seat: str  # words for how they were decided


def seen(body: Figure | Scene, q: Array, work: Work | None, what: str) -> Seen:
    """A person's angles, and whether the person sits."""
    figure = body.figure if isinstance(body, Scene) else body
    asked = Work() if work is None else checks.instance(
        work, Work, f"{what}: work", "give wb.ergonomics.Work(load=5.0)"
    )  # fmt: skip
    angles = body_angles(figure, q)
    seat, rest = _bearers(body, q, angles) if isinstance(body, Scene) and not asked.walking else (None, None)
    if asked.seated is not None:
        reason, sits = "as Work says", asked.seated
    elif seat is not None:
        reason, sits = f"as {seat} is below pelvis or thighs", True
    else:
        reason, sits = "by the posture", asked.sits(angles) and not asked.walking
    words = f"{'sits' if sits else 'does not sit'}, {reason}"
    if sits and asked.back_supported is None and rest is not None:
        words += f"; the back is at {rest}"
    shown = rest is not None if isinstance(body, Scene) and not asked.walking else None
    back = shown if asked.back_supported is None else asked.back_supported
    return Seen(figure, angles, replace(asked, seated=sits, back_supported=back), words)


def _bearers(scene: Scene, q: Array, angles: BodyAngles) -> tuple[str | None, str | None]:
    """Names of the things nearest below pelvis or thighs and at the trunk; no seat for who lies."""
    # of the trunk against the vertical: who is beyond lies
    lies = max(abs(angles.trunk_flexion), abs(angles.trunk_lateral)) > radians(70.0)
    # m: up to which a body rests on a thing, as the viewer colours contacts
    found, seat, rest = scene.contacts(q, within=0.005), None, None
    for (one, other), normal in zip(found.pair, found.normal, strict=True):
        owners = scene.piece_owner[one], scene.piece_owner[other]
        for thing, segment, up in ((*owners, normal[2]), (*owners[::-1], -normal[2])):
            if thing not in scene.objects or scene.objects[thing].segment is not None:
                continue  # what is carried bears nobody
            # upward part of a contact's unit normal, from which the thing is rather below than beside
            if segment in ("pelvis", "left_thigh", "right_thigh") and up > 0.5 and not lies:
                seat = seat or thing
            if segment in ("thorax", "upper_lumbar", "lower_lumbar"):
                rest = rest or thing
    return seat, rest
