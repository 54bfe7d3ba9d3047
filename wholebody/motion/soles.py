"""Soles: in which frames feet stand, their points that bear force, and the split of a wrench over these points."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.motion.clip import Clip
from wholebody.motion.stance import FEET, StanceFeet, foot_points, standing
from wholebody.tasks.support import low_points

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
            # up to 2 cm above the lowest point: soles are rounded, recordings uneven
            lows = _outermost(lows[lows[:, 2] <= lows[:, 2].min() + 0.02])
            points.append(lows)
            owner.append(np.full(len(lows), foot))
        return np.vstack(points), np.concatenate(owner)


def _outermost(points: Array) -> Array:
    """The points that are farthest in the horizontal plane in evenly spread directions."""
    around = 2.0 * np.pi * np.arange(SPREAD_CORNERS) / SPREAD_CORNERS
    far = np.argmax(points[:, :2] @ np.array([np.cos(around), np.sin(around)]), axis=0)
    found: Array = points[np.unique(far)]
    return found


CONE_EDGES = 8
"""Edges of the pyramid that stands for the cone of friction: eight lie within 8 % of it, and inside."""

EVENNESS = 1e-3
"""Weight [m] of even forces beside the wrench in the least squares: many splits give the same wrench, the one with the
smallest forces is taken. More lets the sum of the forces miss the wrench: by about the square of this."""


class GroundForces(NamedTuple):
    """Forces of the ground in one frame.

    Attributes:
        forces: (points, 3) force on each point of the soles, N, in the world.
        missing: (6,) what the ground cannot give of the wrench: force N, moment N m about the wrench's point.
        split: (3 points, 6) derivative of the forces with respect to the wrench, while the same edges bear.
    """

    forces: Array
    missing: Array
    split: Array


def ground_forces(wrench: Array, about: Array, points: Array, friction: float) -> GroundForces:
    """Forces at points of the soles, within their cones of friction, that give a wrench as nearly as can be.

    Minimises |sum of the forces' wrenches - wrench|^2 + (EVENNESS |forces|)^2 over combinations with coefficients >= 0
    of the edges of each point's friction pyramid (non-negative least squares, Lawson and Hanson 1974, chapter 23).

    Args:
        wrench: (6,) force, N, and moment about a point, N m; in the world.
        about: (3,) the point, metres.
        points: (points, 3) where the soles touch the level ground; there may be none.
        friction: coefficient of friction, more than 0.
    """
    if len(points) == 0:
        return GroundForces(np.zeros((0, 3)), wrench.copy(), np.zeros((0, 6)))
    from scipy.optimize import nnls

    around = 2.0 * np.pi * np.arange(CONE_EDGES) / CONE_EDGES
    edges = np.column_stack([friction * np.cos(around), friction * np.sin(around), np.ones(CONE_EDGES)])
    directions = np.tile(edges, (len(points), 1))
    arms = np.repeat(points - about, CONE_EDGES, axis=0)
    columns = np.hstack([directions, np.cross(arms, directions)]).T
    # Scaled to the wrench, so that EVENNESS means the same for a mouse and an elephant.
    scale = max(float(np.linalg.norm(wrench[:3])), 1.0)
    stacked = np.vstack([columns, EVENNESS * np.eye(columns.shape[1])])
    found, _ = nnls(stacked, np.concatenate([wrench / scale, np.zeros(columns.shape[1])]))
    forces = (found[:, None] * directions).reshape(len(points), CONE_EDGES, 3).sum(axis=1) * scale
    bears = found > 0.0
    active = columns[:, bears]
    # The answer on the edges that bear is that of linear least squares with EVENNESS.
    solved = np.linalg.solve(active.T @ active + EVENNESS**2 * np.eye(active.shape[1]), active.T)
    split = np.zeros((len(points), 3, 6))
    np.add.at(split, np.flatnonzero(bears) // CONE_EDGES, directions[bears][:, :, None] * solved[:, None, :])
    return GroundForces(forces, wrench - columns @ (found * scale), split.reshape(-1, 6))
