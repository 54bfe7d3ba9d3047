"""What a posture does not tell: load, repetition, grip, support."""

from __future__ import annotations

from dataclasses import dataclass

from wholebody.base import checks
from wholebody.base.errors import InputError
from wholebody.ergonomics.angles import BodyAngles

COUPLINGS = ("good", "fair", "poor", "unacceptable")
HEAVIEST = 200.0  # kg

KNEELING = 0.12  # m: height of a knee above the lower ankle up to which it is on the ground
BOTH_FEET = 0.1  # share of the weight that a foot bears at least if both stand


@dataclass(frozen=True)
class Work:
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
        back_supported: whether the back of somebody seated rests on something (RULA); None to tell it from the scene,
            and without a scene as if it did not.
        walking: whether the person walks (OWAS).
        seated: None to tell it from the posture: both thighs lie, both knees are bent, no knee is on the ground, and
            the centre of mass is behind the feet.

    Raises:
        InputError: a value of the wrong kind or out of range.
    """

    load: float = 0.0
    static: bool = False
    repeated: bool = False
    shock: bool = False
    unstable: bool = False
    coupling: str = "good"
    arms_supported: bool = False
    legs_supported: bool = True
    walking: bool = False
    seated: bool | None = None
    back_supported: bool | None = None

    def __post_init__(self) -> None:
        """Check the values."""
        checks.settle(self, "load", checks.number(self.load, "Work: load", 0.0, HEAVIEST, "kg"))
        checks.choice(self.coupling, COUPLINGS, "Work: coupling")
        for name in ("static", "repeated", "shock", "unstable", "arms_supported", "legs_supported", "walking"):
            checks.settle(self, name, checks.flag(getattr(self, name), f"Work: {name}"))
        for name in ("seated", "back_supported"):
            if getattr(self, name) is not None:
                checks.settle(self, name, checks.flag(getattr(self, name), f"Work: {name}"))
        if self.seated and self.walking:
            raise InputError("Work: a person who walks is not seated; leave one of them out")

    def sits(self, angles: BodyAngles) -> bool:
        """Whether the person is seated.

        Raises:
            InputError: no angles of a body.
        """
        checks.instance(angles, BodyAngles, "sits: angles", "give those of wb.ergonomics.body_angles(figure, q)")
        if self.seated is not None:
            return self.seated
        # rad: of both thighs, from which a body with bent knees counts as seated
        # rad: 30 degrees
        lies = all(
            side.thigh_slope > 0.7854 and side.knee_flexion > 0.5236 and side.knee_height > KNEELING
            for side in (angles.left, angles.right)
        )
        # m: centre of mass before the ankles; farther back nobody stands on their feet
        behind = angles.center_ahead < -0.12
        # rad: a thigh that points upwards belongs to nobody who sits
        return lies and behind and max(angles.left.thigh_slope, angles.right.thigh_slope) < 2.0


def check_work(work: object, what: str) -> Work:
    """A `Work`, or the default of None.

    Raises:
        InputError: something else.
    """
    return Work() if work is None else checks.instance(work, Work, what, "give wb.ergonomics.Work(load=5.0)")


def both_feet(angles: BodyAngles) -> bool:
    """Whether both feet bear weight."""
    # m: height of an ankle above the other up to which both feet stand
    level = max(angles.left.foot_height, angles.right.foot_height) <= 0.08
    return level and BOTH_FEET <= angles.left_share <= 1.0 - BOTH_FEET
