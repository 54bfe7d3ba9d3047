"""What a sequence of postures is judged by: coal asked for every pair, Pinocchio for every frame, nothing else shared.

No tool's own distances are believed, ours included.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.bench.track import CLEARANCE, DT, JOINT_SPEED, ROOT_SPEED, ROOT_TURN, WITHIN, Track

TOUCHING = 1e-3  # m: a pair nearer than the clearance and this is in contact


class Verdict(NamedTuple):
    """What came of one run.

    Attributes:
        least_distance: (steps,) least signed distance of all pairs after each step [m].
        near: (steps,) pairs nearer than `WITHIN`.
        touching: (steps,) pairs at the clearance or nearer, to 1 mm.
        error: (steps,) distance of the fingertip from its target [m].
        foot_drift: greatest distance of a foot from where it began [m].
        foot_turn: greatest angle of a foot from how it began [rad].
        limit_violation: how far the worst joint was out of its limits [rad].
        fastest_joint: greatest step of a joint, as a share of what the speed bound allows.
        fastest_root: the same for the root, in its place and its orientation.
        acceleration: mean of all joints' absolute accelerations [rad/s^2]; high where a tool trembles.
    """

    least_distance: Array
    near: Array
    touching: Array
    error: Array
    foot_drift: float
    foot_turn: float
    limit_violation: float
    fastest_joint: float
    fastest_root: float
    acceleration: float


def judge(track: Track, postures: Array) -> Verdict:
    """Judge the postures (steps, nq) that a tool went through.

    Raises:
        ValueError: a posture is not finite.
    """
    if not np.isfinite(postures).all():
        raise ValueError("a tool went to a posture that is not finite")
    model, geometry, limits = track.scene.model, track.scene.geometry, track.scene.figure.limits
    data, placed = model.createData(), pin.GeometryData(geometry)
    pin.framesForwardKinematics(model, data, track.start)
    feet = [track.scene.figure.frame_id(name) for name in track.feet]
    stood = [pin.SE3(data.oMf[foot]) for foot in feet]
    tip = track.scene.figure.frame_id(track.tip)
    least, near, touching, error = [], [], [], []
    drift = turn = violation = fast_joint = fast_root = 0.0
    before = track.start
    angles = np.vstack([track.start, track.start, postures])[:, limits.idx_q]
    for q, target in zip(postures, track.targets, strict=True):
        pin.framesForwardKinematics(model, data, q)
        pin.updateGeometryPlacements(model, data, geometry, placed)
        distance = all_distances(geometry, placed)
        least.append(distance.min())
        near.append(int((distance < WITHIN).sum()))
        touching.append(int((distance < CLEARANCE + TOUCHING).sum()))
        error.append(float(np.linalg.norm(data.oMf[tip].translation - target)))
        for foot, there in zip(feet, stood, strict=True):
            moved = there.actInv(data.oMf[foot])
            drift = max(drift, float(np.linalg.norm(moved.translation)))
            turn = max(turn, float(np.linalg.norm(pin.log3(moved.rotation))))
        value = q[limits.idx_q]
        violation = max(violation, float(np.maximum(limits.lower - value, value - limits.upper).max(initial=0.0)))
        step = np.abs(pin.difference(model, before, q)) / DT
        fast_joint = max(fast_joint, float(step[6:].max()) / JOINT_SPEED)
        fast_root = max(fast_root, float(step[:3].max()) / ROOT_SPEED, float(step[3:6].max()) / ROOT_TURN)
        before = q
    return Verdict(
        np.array(least), np.array(near), np.array(touching), np.array(error),
        drift, turn, violation, fast_joint, fast_root, float(np.abs(np.diff(angles, 2, axis=0)).mean()) / DT**2,
    )  # fmt: skip


def all_distances(geometry: Any, placed: Any) -> Array:
    """Signed distance (pairs,) of every pair, one call of coal for each [m]."""
    shapes = [piece.geometry for piece in geometry.geometryObjects]
    places = [coal.Transform3s(place.rotation, place.translation) for place in placed.oMg]
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    found = np.empty(len(geometry.collisionPairs))
    for number, pair in enumerate(geometry.collisionPairs):
        result.clear()
        found[number] = coal.distance(
            shapes[pair.first], places[pair.first], shapes[pair.second], places[pair.second], request, result
        )
    return found
