"""Arrays that programs which train robots read from the npz of a clip, beside those that are read back here.

`root_pos`, `root_rot` (x, y, z, w) and `dof_pos` are those of GMR's files; `joint_pos`, `joint_vel` and the places and
velocities of bodies in the world (quaternions w, x, y, z) those of BeyondMimic and mjlab. Both have `fps`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.motion.clip import ROOT_SIZE
from wholebody.motion.files.base import Motion, steady

WXYZ = [3, 0, 1, 2]
"""Order of a quaternion x, y, z, w in files that begin with w."""


def robot_arrays(motion: Motion) -> dict[str, Any]:
    """The arrays by name; none for people, and robots without a free root or with joints of several values."""
    figure, q, dt = motion.figure, motion.q, motion.dt
    model = figure.model
    if figure.detail != "own" or figure.root != "free" or model.nq != ROOT_SIZE + len(figure.joints):
        return {}
    velocities = motion.velocities()
    names = [name for name in figure.frames if model.frames[figure.frame_id(name)].type == pin.FrameType.BODY]
    places, turns, moves = (np.empty((len(q), len(names), size)) for size in (3, 4, 6))
    data, frames = model.createData(), [figure.frame_id(name) for name in names]
    for k, posture in enumerate(q):
        pin.forwardKinematics(model, data, posture, velocities[k])
        pin.updateFramePlacements(model, data)
        for number, frame in enumerate(frames):
            places[k, number], turns[k, number] = np.split(pin.SE3ToXYZQUAT(data.oMf[frame]), [3])
            moves[k, number] = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED).vector
    return {
        "fps": np.array([1.0 / dt]),
        "root_pos": q[:, :3],
        "root_rot": q[:, 3:ROOT_SIZE],
        "dof_pos": q[:, ROOT_SIZE:],
        "joint_names": np.array(figure.joints, dtype=np.str_),
        "joint_pos": q[:, ROOT_SIZE:],
        "joint_vel": velocities[:, 6:],
        "body_names": np.array(names, dtype=np.str_),
        "body_pos_w": places,
        "body_quat_w": steady(turns)[..., WXYZ],
        "body_lin_vel_w": moves[..., :3],
        "body_ang_vel_w": moves[..., 3:],
    }
