"""Points of feet that stand, and how far they slide meanwhile."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.motion.stance import StanceFeet, foot_points, standing
from wholebody.motion.windows import runs


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


def paths(figure: Figure, q: Array, frames: tuple[str, ...]) -> Array:
    """Positions (n, frames, 3) of frames in the world at postures (n, nq), metres."""
    data, numbers = figure.model.createData(), [figure.frame_id(name) for name in frames]
    found = np.zeros((len(q), len(frames), 3))
    for k, posture in enumerate(q):
        pin.forwardKinematics(figure.model, data, posture)
        for i, number in enumerate(numbers):
            found[k, i] = pin.updateFramePlacement(figure.model, data, number).translation
    return found


def standing_points(figure: Figure, q: Array, dt: float) -> dict[str, NDArray[np.bool_]]:
    """In which frames of (n, nq), `dt` seconds apart, each point of the feet stands: name -> (n,)."""
    names = foot_points(figure)
    return dict(standing(figure, q, dt, StanceFeet(names))) if names else {}


def slid(path: Array, stands: NDArray[np.bool_]) -> tuple[float, int]:
    """How far a point moves in the horizontal plane while it stands, from where it stood first.

    Args:
        path: (n, 3) position in each frame, metres.
        stands: (n,) when it stands.

    Returns:
        The longest distance, metres, and its frame; 0 and 0 where it never stands.
    """
    far, at = 0.0, 0
    for first, after in runs(stands):
        away = np.linalg.norm(path[first:after, :2] - path[first, :2], axis=1)
        if away.max() > far:
            far, at = float(away.max()), int(first + np.argmax(away))
    return far, at


def sliding(figure: Figure, q: Array, dt: float) -> tuple[Sliding, ...]:
    """How far each point of the feet slides while it stands, at postures (n, nq), `dt` seconds apart."""
    stand, found = standing_points(figure, q, dt), []
    for name, path in zip(stand, paths(figure, q, tuple(stand)).transpose(1, 0, 2), strict=True):
        found.append(Sliding(name, stand[name], *slid(path, stand[name])))
    return tuple(found)
