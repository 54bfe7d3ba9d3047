"""Retargeting frame by frame by mink, as GMR does it: targets of frames, two stages of weights, no contact.

The stages, weights, damping and the end of the iteration are those of General Motion Retargeting (Araujo and others,
Retargeting Matters, 2025; `motion_retarget.py` and `bvh_to_g1.json` of github.com/YanjieZe/GMR). There each skeleton
and robot has a table of rotations and lengths; here both come from the rest postures, as for `wb.retarget`.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.base.errors import MissingPackageError
from wholebody.bench.suite.adapters.mink import Order
from wholebody.bench.suite.adapters.urdf import mjcf, own_frame
from wholebody.figures.figure import Figure
from wholebody.motion.retarget_targets import LIMBS, rest_axes, standing_places
from wholebody.motion.roles import ROWS, Roles
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.structure import upright
from wholebody.scene.scene import Scene

# weights of place and orientation, of the first and of the second stage
WEIGHTS = {
    "pelvis": ((0.0, 10.0), (100.0, 5.0)), "chest": ((0.0, 100.0), (0.0, 10.0)), "hip": ((0.0, 10.0), (10.0, 5.0)),
    "knee": ((0.0, 10.0), (10.0, 5.0)), "ankle": ((50.0, 10.0), (50.0, 10.0)), "shoulder": ((0.0, 100.0), (5.0, 100.0)),
    "elbow": ((0.0, 10.0), (10.0, 5.0)), "wrist": ((0.0, 10.0), (10.0, 5.0)),
}  # fmt: skip
DAMPING, MOST, GAIN = 0.5, 10, 1e-3  # of a step; steps more than one; by which the error falls in each of them
FIRST = 20  # times that the first frame is followed before the motion begins, so that its way there is not judged


class MinkRetargeting:
    """Postures of a figure that follow a skeleton."""

    def __init__(self, motion: SkeletonMotion, figure: Figure, roles: Roles) -> None:
        """Make the model, the tasks and the targets of all frames."""
        try:
            import mink
            import mujoco
        except ImportError:
            raise MissingPackageError("mink is not installed; install: pip install 'wholebody[compare]'") from None
        self._mink = mink
        roles_used = [role for role in roles.frames if role.split("_")[-1] in WEIGHTS and role in roles.joints]
        segments = {row["role"]: row["wholebody"] for row in ROWS}  # which carry limbs of a person
        self._turned = {
            role: segments[role] if segments[role] in figure.segments else roles.turns[role] for role in roles_used
        }
        sites = {f"{role} at": own_frame(figure, roles.frames[role]) for role in roles_used}
        sites |= {f"{role} turned": own_frame(figure, self._turned[role]) for role in roles_used}
        model = mujoco.MjModel.from_xml_string(mjcf(Scene(figure), sites))
        self._order, self._dt, self._configuration = Order(figure, model), model.opt.timestep, mink.Configuration(model)
        self._targets = _targets(motion, figure, roles, self._turned)
        self._stages = [self._tasks(roles_used, stage) for stage in (0, 1)]
        start = upright(figure).copy()
        if figure.root == "free":
            start[:7] = pin.SE3ToXYZQUAT(pin.SE3(self._targets["pelvis"][1][0], self._targets["pelvis"][0][0]))
        self._configuration.update(self._order.theirs(start))
        for _ in range(FIRST):
            self.frame(0)

    def _tasks(self, used: list[str], stage: int) -> list[tuple[str, str, object]]:
        made = []
        for role in used:
            at, turn = WEIGHTS[role.split("_")[-1]][stage]
            for kind, place, turned in (("at", at, 0.0), ("turned", 0.0, turn)):
                if place or turned:
                    task = self._mink.FrameTask(
                        f"{role} {kind}", "site", position_cost=place, orientation_cost=turned, lm_damping=1.0
                    )
                    made.append((role, kind, task))
        return made

    def frame(self, number: int) -> Array:
        """The posture (nq,) of a frame, from that of the frame before."""
        for stage in self._stages:
            tasks = [task for _, _, task in stage]
            for role, _, task in stage:
                place, turn = (values[number] for values in self._targets[role])
                rotation = self._mink.SO3.from_matrix(turn)
                task.set_target(self._mink.SE3.from_rotation_and_translation(rotation, place))  # type: ignore[attr-defined]
            before = self._error(tasks)
            for _ in range(1 + MOST):
                step = self._mink.solve_ik(self._configuration, tasks, self._dt, "daqp", DAMPING)
                self._configuration.integrate_inplace(step, self._dt)
                after = self._error(tasks)
                if before - after <= GAIN:
                    break
                before = after
        return self._order.ours(np.array(self._configuration.q))

    def _error(self, tasks: list[object]) -> float:
        errors = [task.compute_error(self._configuration) for task in tasks]  # type: ignore[attr-defined]
        return float(np.linalg.norm(np.concatenate(errors)))


def _targets(
    motion: SkeletonMotion, figure: Figure, roles: Roles, used: dict[str, str]
) -> dict[str, tuple[Array, Array]]:
    """Places (n, 3) and orientations (n, 3, 3) of the parts: those of the skeleton, limbs as long as the figure's."""
    own, turned, lowest = standing_places(figure, with_values(roles, turns=used))
    joints = {role: motion.names.index(name) for role, name in roles.joints.items()}
    axes, rest = rest_axes(motion, roles), motion.rest()
    axes = np.eye(3) if axes is None else axes
    scales = {limb[0]: _length(own, limb) / max(_length({r: rest[k] for r, k in joints.items()}, limb), 1e-9)
              for limb in LIMBS}  # fmt: skip
    legs = scales["hip"]
    root = motion.positions[:, joints["pelvis"]]
    found = {}
    for role in used:
        arm = role.split("_")[-1] in ("shoulder", "elbow", "wrist")
        scale = scales["shoulder"] if arm else legs
        places = legs * root + scale * (motion.positions[:, joints[role]] - root)
        turns = motion.rotations[:, joints[role]] @ axes @ _rest_turn(role, own, rest @ axes, joints) @ turned[role]
        found[role] = (places, turns)
    if {"left_hip", "right_hip"} <= found.keys():  # a figure's pelvis may be elsewhere above its hips
        hips = 0.5 * (found["left_hip"][0] + found["right_hip"][0])
        above = own["pelvis"] - 0.5 * (own["left_hip"] + own["right_hip"])
        found["pelvis"] = (hips + motion.rotations[:, joints["pelvis"]] @ axes @ above, found["pelvis"][1])
    if "left_ankle" in found:  # the ankles are as high above the floor as where the figure stands
        low = min(float(np.percentile(found[role][0][:, 2], 2.0)) for role in ("left_ankle", "right_ankle"))
        for places, _ in found.values():
            places[:, 2] += own["left_ankle"][2] - lowest - low
    return found


def _rest_turn(role: str, own: dict[str, Array], rest: Array, joints: dict[str, int]) -> Array:
    """(3, 3) from the direction of a limb where the figure stands to that in the skeleton's rest posture."""
    for limb in LIMBS:
        for start, end in pairwise(limb[:3]):
            side = role.split("_")[0]
            first, last = f"{side}_{start}", f"{side}_{end}"
            mine = role == first or (role == last and end == limb[2] and limb[0] == "shoulder")
            if mine and {first, last} <= own.keys() & joints.keys():
                ways = own[last] - own[first], rest[joints[last]] - rest[joints[first]]
                found: Array = pin.Quaternion.FromTwoVectors(*ways).toRotationMatrix()
                return found
    return np.eye(3)


def _length(places: dict[str, Array], limb: tuple[str, ...]) -> float:
    """Metres of the first two bones of a limb of the left side."""
    known = [places[f"left_{part}"] for part in limb[:3] if f"left_{part}" in places]
    return float(sum(np.linalg.norm(last - first) for first, last in pairwise(known)))
