"""Soles: in which frames feet stand, and the points of them that bear force."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.motion.clip import Clip
from wholebody.motion.stance import FEET, StanceFeet, foot_points, standing
from wholebody.tasks.balance import low_points

SOLE = 0.02
"""Metres above a sole's lowest point up to which its corners bear force: soles are rounded, recordings uneven."""

SPREAD_CORNERS = 12
"""Most points of one foot: the outermost ones in as many directions. Fewer cut off the ends of a rounded sole."""


def usual_feet(figure: Figure, constraints: Iterable[object]) -> tuple[str, ...]:
    """The segments on which a figure with a free root stands, or else the frames that `StanceFeet` among terms name."""
    if figure.root != "free":
        return ()
    found = tuple(name for name in FEET if name in figure.segments)
    given = [term for term in constraints if isinstance(term, StanceFeet) and term.feet is not None]
    return found or tuple(name for term in given for name in term.names(figure))


def standing_feet(clip: Clip, feet: Sequence[str]) -> dict[str, Mask]:
    """In which frames (n,) each foot stands: one of its points does; none of a root that is fixed.

    Raises:
        InputError: no feet are named.
    """
    figure = clip.figure
    found: dict[str, Mask] = {}
    if figure.root != "free":
        return found
    for name in feet:
        joint = figure.model.frames[figure.frame_id(name)].parentJoint
        points = tuple(
            point
            for point in foot_points(figure)
            if joint in figure.model.supports[figure.model.frames[figure.frame_id(point)].parentJoint]
        )
        marks = standing(figure, clip.q, clip.dt, StanceFeet(points or (name,)))
        found[name] = np.any(list(marks.values()), axis=0)
    if not found:
        raise InputError(f"torques: {figure.name} has no segments {' or '.join(FEET)}; name its feet with feet=[...]")
    return found


class Soles:
    """Points of feet that bear force: the lowest corners of their pieces, toes included.

    Attributes:
        joints: number of the joint of each foot.
    """

    def __init__(self, figure: Figure, feet: tuple[str, ...]) -> None:
        """Find the pieces of the feet.

        Raises:
            InputError: a foot has none.
        """
        self.joints: list[int] = []
        self._pieces: list[list[Any]] = []
        for foot in feet:
            joint = figure.model.frames[figure.frame_id(foot)].parentJoint
            pieces = [
                piece for piece in figure.geometry.geometryObjects if joint in figure.model.supports[piece.parentJoint]
            ]
            if joint == 0 or not pieces:
                raise InputError(f"torques: {foot} has no pieces to stand on; name segments with geometry as feet")
            self.joints.append(joint)
            self._pieces.append(pieces)

    def points(self, data: pin.Data, stand: list[bool]) -> tuple[Array, Any]:
        """Points (n, 3) in the world of the feet that stand, and the number of each one's foot (n,)."""
        points, owner = [np.zeros((0, 3))], [np.zeros(0, dtype=int)]
        for foot, stands in enumerate(stand):
            if not stands:
                continue
            lows = np.vstack(
                [
                    low_points(piece.geometry, data.oMi[piece.parentJoint] * piece.placement)
                    for piece in self._pieces[foot]
                ]
            )
            lows = _outermost(lows[lows[:, 2] <= lows[:, 2].min() + SOLE])
            points.append(lows)
            owner.append(np.full(len(lows), foot))
        return np.vstack(points), np.concatenate(owner)


def _outermost(points: Array) -> Array:
    """The points that are farthest in the horizontal plane in evenly spread directions."""
    around = 2.0 * np.pi * np.arange(SPREAD_CORNERS) / SPREAD_CORNERS
    far = np.argmax(points[:, :2] @ np.array([np.cos(around), np.sin(around)]), axis=0)
    found: Array = points[np.unique(far)]
    return found
