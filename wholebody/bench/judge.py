"""What the steps of a tool are judged by: the judge of all motions, and where the tip and the feet are.

No tool's own distances are believed, ours included.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.bench.track import CLEARANCE, DT, JOINT_SPEED, ROOT_SPEED, ROOT_TURN, WITHIN, Track
from wholebody.motion_assessment import limit_violation, pairs_along, velocities

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
    scene, figure = track.scene, track.scene.figure
    feet, tip = [figure.frame_id(name) for name in track.feet], figure.frame_id(track.tip)
    state = scene.state(track.start)
    stood = [pin.SE3(state.frame(foot)) for foot in feet]
    least, near, touching, error, drift, turn = [], [], [], [], [0.0], [0.0]
    for pairs, target in zip(pairs_along(scene, postures), track.targets, strict=True):
        least.append(pairs.least)
        near.append(int((pairs.distance < WITHIN).sum()))
        touching.append(int((pairs.distance < CLEARANCE + TOUCHING).sum()))
        error.append(float(np.linalg.norm(pairs.state.frame(tip).translation - target)))
        for foot, there in zip(feet, stood, strict=True):
            moved = there.actInv(pairs.state.frame(foot))
            drift.append(float(np.linalg.norm(moved.translation)))
            turn.append(float(np.linalg.norm(pin.log3(moved.rotation))))
    whole = np.vstack([track.start, postures])
    speed = np.abs(velocities(scene.model, whole, DT)).max(axis=0)
    angles = np.vstack([track.start, whole])[:, figure.limits.idx_q]
    return Verdict(
        np.array(least), np.array(near), np.array(touching), np.array(error), max(drift), max(turn),
        limit_violation(figure, postures), float(speed[6:].max()) / JOINT_SPEED,
        max(float(speed[:3].max()) / ROOT_SPEED, float(speed[3:6].max()) / ROOT_TURN),
        float(np.abs(np.diff(angles, 2, axis=0)).mean()) / DT**2,
    )  # fmt: skip
