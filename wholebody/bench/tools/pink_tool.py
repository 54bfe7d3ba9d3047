"""pink: `solve_ik` with FrameTask, PostureTask, its limits and SelfCollisionBarrier; the QPs are solved by DAQP."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.bench.tools.base import POSTURE_COST, REACH_COST, Tool
from wholebody.bench.track import CLEARANCE, DT, JOINT_SPEED, ROOT_SPEED, ROOT_TURN, Track

NEAREST = 20  # pairs that its barrier looks at; it gets slower with more, and loses contacts with fewer
BARRIER_GAIN = 0.5 / DT  # 1/s: half of what is free of a gap may be used up in one step


class PinkTool(Tool):
    """One `solve_ik` and `integrate_inplace` a step."""

    name = "pink"
    differences: ClassVar[tuple[str, ...]] = (
        f"pink's barrier takes the {NEAREST} nearest pairs, whatever their distance, not all within a distance",
    )

    def __init__(self, track: Track) -> None:
        """Set the tasks up."""
        import pink
        from pink.barriers import SelfCollisionBarrier
        from pink.limits import FloatingBaseVelocityLimit
        from pink.tasks import FrameTask, PostureTask

        self._pink, self._scene = pink, track.scene
        self._model = track.scene.model.copy()
        self._model.velocityLimit = np.full(self._model.nv, JOINT_SPEED)
        self._model.floating_base_velocity_limit = FloatingBaseVelocityLimit(self._model, None, ROOT_SPEED, ROOT_TURN)
        self._solvers_failure = pink.exceptions.NoSolutionFound
        self.reset(track.start)
        self._reach = FrameTask(track.tip, position_cost=REACH_COST, orientation_cost=0.0)
        self._at = pin.SE3.Identity()
        posture = PostureTask(cost=POSTURE_COST)
        posture.set_target(track.start)
        self._tasks = [self._reach, posture]
        self._feet = [FrameTask(foot, position_cost=1.0, orientation_cost=1.0) for foot in track.feet]
        for task in self._feet:
            task.set_target_from_configuration(self._configuration)
        self._barrier = SelfCollisionBarrier(n_collision_pairs=NEAREST, gain=BARRIER_GAIN, d_min=CLEARANCE)

    def reset(self, q: Array) -> None:
        """Go to a posture."""
        self._configuration = self._pink.Configuration(
            self._model, self._model.createData(), np.array(q), collision_model=self._scene.geometry
        )
        self.failures = 0

    def step(self, target: Array) -> None:
        """Move one step."""
        self._at.translation = target
        self._reach.set_target(self._at)
        try:
            velocity = self._pink.solve_ik(
                self._configuration, self._tasks, DT, solver="daqp", damping=POSTURE_COST**2,
                barriers=[self._barrier], constraints=self._feet, safety_break=False,
            )  # fmt: skip
        except self._solvers_failure:
            self.failures += 1
            return
        self._configuration.integrate_inplace(velocity, DT)

    def posture(self) -> Array:
        """Where it is."""
        return np.array(self._configuration.q)
