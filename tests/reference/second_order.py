"""Array code for how long planes keep the pieces of a pair apart: what `keep_apart` of the package must find."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.geometry.continuous.motion_bounds import MotionBounds
from wholebody.geometry.continuous.sweep import Sweep


def curvature(bounds: MotionBounds, first: int, second: int, gap: float) -> float:
    """Largest acceleration of a point of the first piece relative to the second, metres per squared duration."""
    a, b = bounds.carries[bounds.joint[first]], bounds.carries[bounds.joint[second]]
    near, far = a & ~b, b & ~a
    turn = bounds.turn * (near | far)
    speed = bounds.speed[first] * near + bounds.speed[second] * far
    across = max(gap, 0.0) + float(speed.sum()) + 2.0 * float(bounds.reach[first])
    speed = speed + bounds.turn * far * across
    return float((speed * (2.0 * turn.sum() - turn)).sum())


def stays_above(sweep: Sweep, first: int, second: int, row: Array, level: float) -> float:
    """Share of the motion for which a plane between the pair, fixed to either piece, keeps them above `level`."""
    best, normal = 0.0, row[1:4]
    if not normal @ normal > 0.25:
        return best
    for points, plane, out in ((first, second, -normal), (second, first, normal)):
        if len(sweep._table.swept[points].points):
            best = max(best, _planes_keep(sweep, points, plane, _planes(sweep, plane, out), float(row[0]), level))
    return best


def _planes(sweep: Sweep, piece: int, normal: Array) -> Array:
    """Directions (k, 3) in which to bound a piece: a normal of coal's, and that of the face nearest to it."""
    swept, rotation = sweep._table.swept[piece], sweep._distances.data.oMg[piece].rotation
    if not len(swept.faces):
        return normal[None]
    faces = swept.faces[:, :3] @ rotation.T
    face = faces[int(np.argmax(faces @ normal))]
    return face[None] if np.isinf(swept.reach) else np.array([face, normal])


def _planes_keep(sweep: Sweep, points: int, plane: int, normals: Array, distance: float, level: float) -> float:
    """Time until a swept point of `points` can reach `level` above supporting planes (k, 3) of `plane`."""
    swept, base = sweep._table.swept[points], sweep._table.swept[plane]
    at, below = sweep._distances.data.oMg[points], sweep._distances.data.oMg[plane]
    if np.isinf(base.reach):
        heights = base.faces[0, 3] + normals @ below.translation
    elif len(base.points):
        heights = (base.points @ below.rotation.T @ normals.T).max(axis=0) + normals @ below.translation
    else:  # an ellipsoid
        heights = np.linalg.norm(normals @ below.rotation * base.half, axis=1) + normals @ below.translation
    corners = swept.points @ at.rotation.T + at.translation
    room = corners @ normals.T - (heights + swept.radius + base.radius + level)
    above = room.min(axis=0) > 0.0
    if not above.any():
        return 0.0
    room = room[:, above]
    rate = (_velocities(sweep, points, corners) - _velocities(sweep, plane, corners)) @ normals[above].T
    bend = curvature(sweep._bounds, points, plane, distance)
    if bend <= 0.0:
        times = np.where(rate < 0.0, room / np.maximum(-rate, 1e-300), np.inf)
    else:
        times = (rate + np.sqrt(rate * rate + 2.0 * bend * room)) / bend
    return float(times.min(axis=0).max())


def _velocities(sweep: Sweep, piece: int, places: Array) -> Array:
    """Velocities (k, 3) of points at `places` that move with the piece's body."""
    joint = int(sweep._bounds.joint[piece])
    if joint == 0:
        return np.zeros_like(places)
    motion = sweep._data.oMi[joint].act(sweep._data.v[joint])
    return np.asarray(motion.linear + places @ pin.skew(motion.angular).T)
