"""Feet that stand: when a point of a foot stands, from its height and speed, and how far it slides meanwhile."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.motion.clip_contacts import runs

LOW = 0.05
"""Metres above its own lowest height: a higher point does not stand. More takes a foot that swings low for one that
stands, less loses feet of recordings whose ground is not level."""

SLOW = 0.2
"""Metres a second: a faster point does not stand. A foot that swings reaches 2 to 4 m/s; the noise of recordings is up
to 0.1 m/s."""

SHORTEST = 0.1  # s: a foot that is low and slow for less is turning round in the air
GROUND = 0.02  # share of the frames that may be lower than the ground: recordings have single frames that are too low

POINTS = ("heel", "ball", "toe_tip")
"""Ends of the names of frames that are points of a foot."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """How far a point of a foot slides while it stands.

    Attributes:
        frame: name of the point's frame.
        stands: (n,) whether it stands in each frame.
        distance: farthest from where it stood first, in the horizontal plane, in any of the times that it stands,
            metres.
        at: the frame in which it is farthest.
    """

    frame: str
    stands: NDArray[np.bool_] = field(repr=False)
    distance: float
    at: int


def foot_points(figure: Figure) -> tuple[str, ...]:
    """Names of the frames of a figure that are points of feet; none where the figure does not name any."""
    return tuple(name for name in figure.frames if name.endswith(POINTS))


def paths(figure: Figure, q: Array, frames: tuple[str, ...]) -> Array:
    """Positions (n, frames, 3) of frames in the world at postures (n, nq), metres."""
    data, numbers = figure.model.createData(), [figure.frame_id(name) for name in frames]
    found = np.zeros((len(q), len(frames), 3))
    for k, posture in enumerate(q):
        pin.forwardKinematics(figure.model, data, posture)
        for i, number in enumerate(numbers):
            found[k, i] = pin.updateFramePlacement(figure.model, data, number).translation
    return found


def standing(path: Array, dt: float) -> NDArray[np.bool_]:
    """In which frames a point stands: low, slow, and for at least `SHORTEST` seconds.

    Args:
        path: (n, 3) position of the point in each frame, z up, metres.
        dt: seconds from frame to frame.

    Returns:
        (n,) true where it stands.
    """
    if len(path) < 2:
        return np.ones(len(path), dtype=bool)
    height = path[:, 2] - np.quantile(path[:, 2], GROUND)
    slow = np.linalg.norm(np.gradient(path, dt, axis=0), axis=1) < SLOW
    stands: NDArray[np.bool_] = slow & (height < LOW)
    for first, after in zip(*runs(stands), strict=True):
        if (after - first) * dt < SHORTEST and after - first < len(path):
            stands[first:after] = False
    return stands


def slid(path: Array, stands: NDArray[np.bool_]) -> tuple[float, int]:
    """How far a point moves in the horizontal plane while it stands, from where it stood first.

    Args:
        path: (n, 3) position in each frame, metres.
        stands: (n,) when it stands.

    Returns:
        The longest distance, metres, and its frame; 0 and 0 where it never stands.
    """
    far, at = 0.0, 0
    for first, after in zip(*runs(stands), strict=True):
        away = np.linalg.norm(path[first:after, :2] - path[first, :2], axis=1)
        if away.max() > far:
            far, at = float(away.max()), int(first + np.argmax(away))
    return far, at


def sliding(figure: Figure, q: Array, dt: float) -> tuple[Sliding, ...]:
    """How far each point of the feet slides while it stands, at postures (n, nq), `dt` seconds apart."""
    names = foot_points(figure)
    found = []
    for name, path in zip(names, paths(figure, q, names).transpose(1, 0, 2), strict=True):
        stands = standing(path, dt)
        found.append(Sliding(name, stands, *slid(path, stands)))
    return tuple(found)
