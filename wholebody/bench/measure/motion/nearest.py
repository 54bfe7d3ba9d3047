"""How near to the original the frames of a clip can be, each for itself: what no smooth motion on that side is below.

From the answers of some methods every frame is brought to the least squared deviation of its joints that contacts,
limits and what is held let it have. The frames before and after do not count, nor do the motions between them. It is a
local least: each answer keeps its side of what is in the way, and the nearest of them is taken.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from wholebody.base.arrays import Array
from wholebody.motion.clip import Clip
from wholebody.motion.frame_terms import Given, frame_terms
from wholebody.motion.measures import deviation
from wholebody.motion.trajectory.banded_qp import banded_solver
from wholebody.motion.trajectory.deviations import Chart, Objective
from wholebody.motion.trajectory.nodes import NodeEvaluator
from wholebody.motion.trajectory.program import Limits
from wholebody.motion.trajectory.sqp import MET, WindowProgram
from wholebody.scene.scene import Scene

ROOT = 0.01  # weight of a free root: the deviation that is compared is of the other joints
STEPS = 60  # of one answer
RADIUS, LARGEST = 0.03, 0.1  # rad, m: a frame is to stay on its side


def nearest(clip: Clip, scene: Scene, constraints: Iterable[Given], answers: Iterable[Clip]) -> Clip | None:
    """The clip of frames that are nearest to the original, each for itself; None where no answer leads to one.

    Args:
        clip: the original.
        scene: its figure and things.
        constraints: what is held, as for `avoid`.
        answers: clips of as many frames to begin with.
    """
    found = list[Clip]()
    with scene.borrow() as workspace:
        terms = frame_terms(scene, clip.q, clip.dt, constraints)
        chart = Chart(workspace.model, np.array(clip.q))
        held = [terms.held(frame) for frame in range(len(clip))]
        evaluator = NodeEvaluator(workspace, chart, held, 0.0)
        weights = np.ones(workspace.model.nv)
        weights[: 6 if clip.figure.root == "free" else 0] = ROOT
        objective = Objective(len(clip), weights, 0.0, clip.dt, (False, False))
        bounds = chart.bounds(clip.figure.limits)
        fast: Array = np.full((len(clip) - 1, workspace.model.nv), np.inf)  # speeds have no limits
        limits = Limits(*bounds, -fast, fast)
        for answer in answers:
            program = WindowProgram(evaluator, objective, limits, banded_solver(None)[1], STEPS)
            x = np.array([chart.deviation(frame, q) for frame, q in enumerate(answer.q)])
            x = np.clip(x, *bounds)
            ended = program.run(x, lambda number, worst: False, RADIUS, LARGEST)
            if ended.worst <= 5.0 * MET:
                found.append(clip.with_q(chart.postures(ended.x)))
    return min(found, key=lambda each: deviation(clip, each).angle, default=None)
