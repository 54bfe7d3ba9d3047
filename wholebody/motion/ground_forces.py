"""Forces of the ground on feet that stand: the split of a wrench over their soles, with friction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array

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
