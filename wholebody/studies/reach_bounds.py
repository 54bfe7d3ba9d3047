"""Places that a frame provably cannot reach: by the lengths of its limbs from what is held."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.methods.simplification.reach import Balls, Reach, held_balls
from wholebody.problem import Problem

SLACK = 1e-6  # m: for rounding: a place that is out of reach by no more may be reached


def reach_balls(problem: Problem, frame: str, offset: Array) -> tuple[Array, Array]:
    """Balls in the world that contain a point of a frame in every posture within limits and holds.

    Args:
        problem: whose holds, bounds and limits count.
        frame: name of the frame.
        offset: (3,) the point, in the frame's axes.

    Returns:
        Centres (k, 3) and radii (k,), metres; none where nothing bounds the point.
    """
    figure, model = problem.scene.figure, problem.scene.model
    held = model.frames[figure.frame_id(frame)]
    point = (held.placement.act(offset))[None]
    joint = np.array([held.parentJoint], dtype=np.intp)
    state = State(model).update(problem.start)
    stuck = np.zeros(model.nv, dtype=bool)
    for bound in problem.bounds:
        low, high = bound.bounds(state, None)
        stuck |= (low == 0.0) & (high == 0.0)
    resting = Balls(point, np.zeros(1), np.zeros(1, dtype=np.intp))
    reach = Reach(model, problem.start, resting, joint, np.flatnonzero(stuck).tolist())
    found = [reach.seen_from(0), *held_balls(figure, reach, problem.constraints)]
    center = np.concatenate([balls.center for balls in found])
    radius = np.concatenate([balls.radius for balls in found])
    bounded = np.isfinite(radius)
    return center[bounded], radius[bounded]


def distance_beyond(places: Array, center: Array, radius: Array) -> Array:
    """By how much (n,) places are at least out of reach, metres."""
    least = np.zeros(len(places))
    for middle, size in zip(center, radius, strict=True):
        least = np.maximum(least, np.linalg.norm(places - middle, axis=1) - size)
    return least
