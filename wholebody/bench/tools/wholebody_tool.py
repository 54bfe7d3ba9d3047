"""Our own step: that of a tracker of `QP` with one of its QP solvers."""

from __future__ import annotations

import numpy as np

import wholebody as wb
from wholebody.arrays import Array
from wholebody.bench.tools.base import Tool
from wholebody.bench.track import CLEARANCE, DT, JOINT_SPEED, ROOT_SPEED, ROOT_TURN, Track
from wholebody.figures.state import State, Wrench
from wholebody.tasks.base import Goal, Surroundings, filled


class MovingPoint(Goal):
    """The origin of a frame at a place that moves: write the place into `target`, shape (3,)."""

    def __init__(self, frame: str, target: Array) -> None:
        """Name the frame; the array is kept, not copied."""
        self.frame, self.target = frame, target
        self._id = self._joint = 0

    def resolve(self, scene: Surroundings, start: Array) -> MovingPoint:
        """Find the frame."""
        index = scene.figure.frame_id(self.frame)
        return filled(self, _id=index, _joint=int(scene.model.frames[index].parentJoint))

    def error(self, state: State) -> Array:
        """(3,) from the target to the frame [m]."""
        return np.asarray(state.frame(self._id).translation - self.target)

    def jacobian(self, state: State) -> Wrench:
        """Three forces along the world's axes, through the frame's origin."""
        x, y, z = state.frame(self._id).translation
        rows = np.array([[1.0, 0.0, 0.0, 0.0, z, -y], [0.0, 1.0, 0.0, -z, 0.0, x], [0.0, 0.0, 1.0, y, -x, 0.0]])
        return Wrench(rows, self._joint)


class WholebodyTool(Tool):
    """One program a step, with the workspace of the step before."""

    def __init__(self, track: Track, solver: str) -> None:
        """State the problem; the target is moved afterwards."""
        self.name = f"wholebody/{solver}"
        self._target = np.array(track.targets[0])
        self.problem = wb.Problem(
            track.scene,
            track.start,
            goals=[MovingPoint(track.tip, self._target)],
            constraints=[
                *(wb.Hold(foot) for foot in track.feet),
                wb.StepLimit(JOINT_SPEED, root_velocity=ROOT_SPEED, root_turn=ROOT_TURN),
            ],
            measures=[wb.Displacement()],
            clearance=CLEARANCE,
        )
        self._tracker = wb.QP(solver=solver).tracker(self.problem, DT)
        self._q = np.array(track.start)
        self._told: list[tuple[int, bool, int]] = []

    def reset(self, q: Array) -> None:
        """Go to a posture."""
        self._q = np.array(q)
        self._told.clear()

    def step(self, target: Array) -> None:
        """Move one step."""
        self._target[:] = target
        step = self._tracker.step(self._q)
        self._q = step.q
        self._told.append((step.rows, step.exact, step.iterations))

    def posture(self) -> Array:
        """Where it is."""
        return np.array(self._q)

    def remarks(self) -> dict[str, float]:
        """Mean number of contact rows, and shares of steps that were closed exactly, and without the solver."""
        rows, exact, iterations = zip(*self._told, strict=True)
        return {
            "rows": float(np.mean(rows)),
            "exact": float(np.mean(exact)),
            "at_once": float(np.mean(np.array(iterations) == 0)),
        }
