"""Feet that stand: found in a clip by their speed and height."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wholebody.base import checks
from wholebody.base.arrays import Array, Mask
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.motion.windows import long_runs
from wholebody.tasks import Hold

FEET = ("left_foot", "right_foot")
POINTS = ("heel", "ball", "toe_tip")
"""Ends of the names of frames that are points of a foot."""

LOWEST_SHARE = 0.02  # of the frames: how many may be lower than what counts as the ground, because they are errors


def foot_points(figure: Figure) -> tuple[str, ...]:
    """Names of the frames of a figure that are points of feet; none where the figure does not name any."""
    return tuple(name for name in figure.frames if name.endswith(POINTS))


def _usual(figure: Figure) -> tuple[str, ...]:
    return foot_points(figure) or tuple(name for name in FEET if name in (*figure.frames, *figure.segments))


def has_feet(figure: Figure) -> bool:
    """Whether a figure that may move about has frames that `StanceFeet` finds by itself."""
    return figure.root == "free" and bool(_usual(figure))


@dataclass(frozen=True)
class StanceFeet:
    """Hold every foot that stands where it was: a constraint for `wb.avoid`.

    A frame stands where it is slow and near its lowest height in the clip. Of a foot of which one point stands, this
    point is held, and the foot may turn about it; of a foot of which two stand, the orientation is held too.

    Attributes:
        feet: frames of the feet; None for the figure's heels, balls and tips of the toes, or without these for its
            "left_foot" and "right_foot".
        speed: largest speed of a standing frame, m/s.
        height: largest height of a standing frame above its lowest, metres.
        least: shortest stand, seconds; shorter ones are moments of a swing.

    Raises:
        InputError: a value out of range.
    """

    feet: Sequence[str] | None = None
    speed: float = 0.15
    height: float = 0.05
    least: float = 0.1

    def __post_init__(self) -> None:
        """Check the values."""
        if self.feet is not None:
            object.__setattr__(self, "feet", tuple(checks.listed(self.feet, "StanceFeet: feet", "['left_foot']")))
        for name, most in (("speed", 100.0), ("height", 10.0), ("least", 100.0)):
            checks.settle(self, name, checks.number(getattr(self, name), f"StanceFeet: {name}", 0.0, most))

    def names(self, figure: Figure) -> tuple[str, ...]:
        """Frames of the feet of a figure.

        Raises:
            UnknownNameError: the figure has no such frame.
            InputError: no feet are named, and the figure has none of the usual names.
        """
        checks.instance(figure, Figure, "StanceFeet: figure", "load one with wb.load('human')")
        if self.feet is not None:
            for name in self.feet:
                figure.frame_id(name)
            return tuple(self.feet)
        found = _usual(figure)
        if not found:
            raise InputError(f"StanceFeet: {figure.name} has no frames {' or '.join(FEET)}; name the feet")
        return found


def standing(figure: Figure, q: Array, dt: float, feet: StanceFeet | None = None) -> Mapping[str, Mask]:
    """For each foot in which frames of (n, nq), `dt` seconds apart, it stands: name -> (n,).

    Raises:
        UnknownNameError: the figure has no such frame.
        InputError: the figure has no feet of the usual names, and none are named.
    """
    settings = StanceFeet() if feet is None else feet
    names = settings.names(figure)
    state = State(figure.model)
    places = np.empty((len(q), len(names), 3))
    for frame, posture in enumerate(q):
        state.update(posture)
        places[frame] = [state.frame(figure.frame_id(name)).translation for name in names]
    speed = speeds(places, dt)
    shortest = max(1, round(settings.least / dt))
    found = {}
    for number, name in enumerate(names):
        height = places[:, number, 2]
        lowest = np.quantile(height, LOWEST_SHARE)
        stand = (speed[:, number] <= settings.speed) & (height <= lowest + settings.height)
        found[name] = long_runs(stand, shortest)
    return found


def held_feet(figure: Figure, stand: Sequence[str]) -> tuple[Hold, ...]:
    """What holds the feet of which some frames stand; a term that is not resolved keeps what is at the start.

    A frame that is not the only one of its segment, or that is no point of a foot, is held with its orientation.
    """
    joints = [figure.model.frames[figure.frame_id(name)].parentJoint for name in stand]
    found = []
    for number, (name, joint) in enumerate(zip(stand, joints, strict=True)):
        if not name.endswith(POINTS):
            found.append(Hold(name))
        elif joint not in joints[:number]:
            found.append(Hold(name, orientation=joints.count(joint) > 1))
    return tuple(found)


def speeds(places: Array, dt: float) -> Array:
    """(n, ...) speeds of places (n, ..., 3), `dt` seconds apart; central inside."""
    if len(places) < 2:
        return np.zeros(places.shape[:-1])
    return np.asarray(np.linalg.norm(np.gradient(places, dt, axis=0), axis=-1))
