"""mink: `solve_ik` with FrameTask, PostureTask and its limits on a MuJoCo model; the QPs are solved by DAQP."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from wholebody.arrays import Array
from wholebody.bench.tools.base import POSTURE_COST, REACH_COST, Tool
from wholebody.bench.tools.mjcf import ROOT, mjcf
from wholebody.bench.track import CLEARANCE, DT, JOINT_SPEED, ROOT_SPEED, ROOT_TURN, WITHIN, Track

COLLISION_GAIN = 0.5 * DT  # half of what is free of a gap may be used up in one step; see `differences`


class MinkTool(Tool):
    """One `solve_ik` and `integrate_inplace` a step."""

    name = "mink"
    differences: ClassVar[tuple[str, ...]] = (
        "mink bounds a displacement by gain × gap ÷ dt, which is a velocity; its gain is given here times dt, so that "
        "half of a gap may be used up in a step, as its documentation means it (as written, it stops only inside)",
        "mink drops pairs of a body and its parent body, and the root against all that is fixed to the world",
    )

    def __init__(self, track: Track) -> None:
        """Set the model and the tasks up."""
        import mink
        import mujoco

        self._mink = mink
        model = self._mujoco_model = mujoco.MjModel.from_xml_string(mjcf(track.scene, (track.tip, *track.feet)))
        figure = track.scene.figure
        self._order = [(int(model.joint(name).qposadr[0]), figure.model.joints[figure.joint_id(name)].idx_q)
                       for name in figure.joints]  # fmt: skip
        self._size = figure.model.nq
        self.reset(track.start)
        self._reach = self._task(track.tip, REACH_COST, 0.0)
        self._at = np.eye(4)
        posture = mink.PostureTask(model, cost=POSTURE_COST)
        posture.set_target(self._configuration.q)
        self._tasks = [self._reach, posture]
        self._feet = [self._task(foot, 1.0, 1.0) for foot in track.feet]
        for task in self._feet:
            task.set_target_from_configuration(self._configuration)
        geometry = track.scene.geometry
        names = [piece.name for piece in geometry.geometryObjects]
        apart = mink.CollisionAvoidanceLimit(
            model,
            [([names[pair.first]], [names[pair.second]]) for pair in geometry.collisionPairs],
            gain=COLLISION_GAIN,
            minimum_distance_from_collisions=CLEARANCE,
            collision_detection_distance=WITHIN,
        )
        self.pairs = len(apart.geom_id_pairs)
        self._limits = [
            mink.ConfigurationLimit(model),
            mink.VelocityLimit(model, dict.fromkeys(figure.joints, JOINT_SPEED)),
            mink.FreeJointVelocityLimit(model, ROOT_SPEED, ROOT_TURN, joint_name=ROOT),
            apart,
        ]

    def _task(self, frame: str, position: float, orientation: float) -> Any:
        return self._mink.FrameTask(frame, "site", position_cost=position, orientation_cost=orientation)

    def reset(self, q: Array) -> None:
        """Go to a posture."""
        there = np.zeros(self._mujoco_model.nq)
        there[:3], there[3], there[4:7] = q[:3], q[6], q[3:6]
        for theirs, ours in self._order:
            there[theirs] = q[ours]
        self._configuration = self._mink.Configuration(self._mujoco_model, q=there)
        self.failures = 0

    def step(self, target: Array) -> None:
        """Move one step."""
        self._reach.set_target(self._mink.SE3.from_translation(target))
        try:
            velocity = self._mink.solve_ik(
                self._configuration, self._tasks, DT, solver="daqp", damping=POSTURE_COST**2,
                limits=self._limits, constraints=self._feet,
            )  # fmt: skip
        except self._mink.NoSolutionFound:
            self.failures += 1
            return
        self._configuration.integrate_inplace(velocity, DT)

    def posture(self) -> Array:
        """Where it is."""
        there = self._configuration.q
        q = np.empty(self._size)
        q[:3], q[3:6], q[6] = there[:3], there[4:7], there[3]
        for theirs, ours in self._order:
            q[ours] = there[theirs]
        return q

    def remarks(self) -> dict[str, float]:
        """How many pairs it looks at."""
        return {"pairs": float(self.pairs)}
