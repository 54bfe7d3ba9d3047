"""Seated dimensions of the drawn surface: `python -m tests.audits.seated_surface [COUNT] [SEED]`.

COUNT women and men of `wb.people` sit upright with right angles at hips, knees and elbows. Flat planes touch the drawn
surface where an anthropometer's do (ANSUR II: Gordon et al. 2014), over the seat and the floor on which the pieces
rest. Prints by how much the surface differs from what the person was built from. It has cloth and hair, and soft parts
that a seat compresses: "under the seat" is how far it is drawn in the seat.
"""

from __future__ import annotations

import sys
from math import radians

import numpy as np
import pinocchio as pin

import wholebody as wb
from tests.measuring import measure
from wholebody.base.arrays import Array
from wholebody.figures.surface.making import halfway
from wholebody.figures.surface.surface import surface_of

RIGHT_ANGLES = {
    f"{side}_{joint}": radians(90.0)
    for side in ("left", "right")
    for joint in ("hip_flexion", "knee_flexion", "elbow_flexion")
}


def seated(figure: wb.Figure) -> tuple[dict[str, Array], dict[str, Array]]:
    """Vertices (n, 3) of the surface by segment, and places (3,) of frames, in the seated posture."""
    data, surface = figure.model.createData(), surface_of(figure)
    assert surface is not None
    q = figure.with_joints(pin.neutral(figure.model), RIGHT_ANGLES)
    pin.framesForwardKinematics(figure.model, data, q)
    bones = [
        data.oMi[figure.model.getJointId(name)].homogeneous @ at for name, at in surface.attached(figure, np.eye(4))
    ]
    for number, first, second in surface.halves:
        bones[number] = halfway(bones[first], bones[second])
    moves = np.array([now @ np.linalg.inv(bone.bind) for now, bone in zip(bones, surface.bones, strict=True)])
    parts: dict[str, list[Array]] = {}
    for patch in surface.patches:
        points = np.column_stack((patch.vertices, np.ones(len(patch.vertices))))
        moved = np.einsum("nkij,nj,nk->ni", moves[patch.bones], points, patch.weights)[:, :3]
        parts.setdefault(patch.segment, []).append(moved)
    frames = {name: np.array(data.oMf[figure.frame_id(name)].translation) for name in figure.frames}
    return {name: np.concatenate(some) for name, some in parts.items()}, frames


def differences(figure: wb.Figure) -> dict[str, float]:
    """How much larger each seated dimension of the surface is than that of the person who was built, mm."""
    built = measure(figure)
    parts, frames = seated(figure)
    floor, knee, hip, elbow = (frames[f"left_{name}"] for name in ("sole", "knee", "hip", "elbow"))
    seat = floor[2] + built["popliteal_height"]
    every, thigh = np.concatenate([*parts.values()]), parts["left_thigh"]
    leg = np.concatenate([parts["left_thigh"], parts["left_shank"]])
    trunk = np.concatenate([parts[name] for name in ("pelvis", "left_thigh", "right_thigh")])
    arm = np.concatenate([parts["left_upper_arm"], parts["left_forearm"]])
    buttock = trunk[trunk[:, 2] < hip[2] + 0.1][:, 0].min()
    shank = parts["left_shank"]
    calf = shank[(shank[:, 2] < seat) & (shank[:, 2] > seat - 0.03)]  # below the seat's front edge
    found = {
        "sitting_height": every[:, 2].max() - seat,
        "eye_height_sitting": frames["gaze"][2] - seat,
        "knee_height_sitting": leg[abs(leg[:, 0] - knee[0]) < 0.05][:, 2].max() - floor[2],
        "popliteal_height": trunk[trunk[:, 0] > knee[0] - 0.1][:, 2].min() - floor[2],  # the thigh over the front edge
        "buttock_knee_length": leg[leg[:, 2] > knee[2] - 0.12][:, 0].max() - buttock,
        "buttock_popliteal_length": calf[:, 0].min() - buttock,
        "elbow_rest_height": arm[abs(arm[:, 0] - elbow[0]) < 0.06][:, 2].min() - seat,
        "thigh_clearance": thigh[thigh[:, 0] < knee[0] - 0.1][:, 2].max() - seat,
    }
    off = {name: float(value - built[name]) for name, value in found.items()}
    off["under the seat"] = float(seat - trunk[:, 2][trunk[:, 0] < knee[0] - 0.1].min())
    return {name: 1000.0 * value for name, value in off.items()}


def main(count: int = 20, seed: int = 0) -> None:
    """Measure and print."""
    for sex in ("female", "male"):
        people = wb.people(count, sex, seed=seed)
        rows = [differences(wb.load("human", **person)) for person in people.values()]
        for name in rows[0]:
            off = np.array([row[name] for row in rows])
            spread = f"bias {off.mean():+6.1f}  RMSE {np.sqrt((off**2).mean()):5.1f}  SD {off.std():4.1f} mm"
            sys.stdout.write(f"{sex:6}  {name:24}  {spread}\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
