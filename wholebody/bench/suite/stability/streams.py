"""Goals and things that move from frame to frame, slowly, fast, and by jumps."""

from __future__ import annotations

from functools import partial

import numpy as np

from wholebody.bench.suite.stability.bodies import planar_arm, spatial_arm
from wholebody.bench.suite.stability.case import FRAME, Frame, Stream, asks, still
from wholebody.geometry.shapes import Box, Sphere
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Point, StepLimit

REST, RADIUS = 40, 0.03  # frames at the end in which the goal rests; m


@asks("thin-plate")
def thin_plate() -> Stream:
    """Thirty frames at rest before the plate would be too kind: it begins at once."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3), RADIUS))
    scene.add(Box((0.004, 3.0, 3.0)), name="plate", at=(0.6, 0.0, 0.0))
    start = np.array([-1.4, 1.5, 1.2])
    problem = Problem(scene, start, goals=[Point("tip", (0.4, 0.0, 0.0))])
    return Stream(problem, still((0.45, 0.0, 0.1), 3) + still((0.8, 0.0, 0.1), REST))


@asks("goal-jumps-1-m")
def goal_jumps() -> Stream:
    """To the other side and back."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3), RADIUS))
    scene.add(Box((0.3, 1.0, 0.12)), name="block", at=(0.75, 0.0, 0.0))
    start = np.array([-0.9, 0.5, 0.3])
    problem = Problem(scene, start, goals=[Point("tip", (0.8, 0.0, 0.5))])
    sides = still((0.8, 0.0, 0.5), 5) + still((0.8, 0.0, -0.5), REST) + still((0.8, 0.0, 0.5), REST)
    return Stream(problem, sides)


@asks("wrong-active-set")
def wrong_active_set() -> Stream:
    """Forty changes of side."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3), RADIUS))
    for name, z in (("ceiling", 0.25), ("floor", -0.25)):
        scene.add(Box((3.0, 1.0, 0.2)), name=name, at=(0.5, 0.0, z))
    problem = Problem(scene, np.array([-0.1, 0.2, -0.1]), goals=[Point("tip", (1.0, 0.0, 0.0))])
    sides = tuple(Frame((1.0, 0.0, 0.5 if k % 2 else -0.5)) for k in range(REST))
    return Stream(problem, sides)


def _interval(dt: float) -> Stream:
    """The goal goes 5 cm below the boulder's top and comes to rest behind it."""
    scene = Scene(spatial_arm()).add(Sphere(0.15), name="boulder", at=(0.5, 0.0, 0.25))
    start = np.array([-0.7, 0.75, 1.15, 0.0, 0.3, 0.0])
    problem = Problem(scene, start, goals=[Point("tip", (0.5, -0.4, 0.35))])
    count = max(1, round(0.8 / (0.5 * dt)))
    # at 1 ms there are 1600 frames: a part of the way, over the top, shows the same
    steps = range(1, count + 1) if count <= 200 else range(count // 2 - 60, count // 2 + 60)
    way = tuple(Frame((0.5, -0.4 + 0.8 * k / count, 0.35)) for k in steps)
    lead = still(way[0].target, REST)
    ends = still((0.5, 0.4, 0.35) if count <= 200 else (0.5, 0.05, 0.45), REST)
    return Stream(problem, lead + way + ends, dt=dt)


for _dt, _name in ((1e-3, "dt-1-ms"), (1e-2, "dt-10-ms"), (0.1, "dt-100-ms"), (1.0, "dt-1-s")):
    asks(_name)(partial(_interval, _dt))


@asks("speed-bound")
def speed_bound() -> Stream:
    """Across the front in half a second."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3), RADIUS))
    start = np.array([-0.9, 0.5, 0.3])
    problem = Problem(scene, start, goals=[Point("tip", (0.8, 0.0, 0.5))], constraints=[StepLimit(1.0)])
    way = tuple(Frame((0.8, 0.0, 0.5 - k / 30)) for k in range(31))
    return Stream(problem, way + still((0.8, 0.0, -0.5), 4 * REST), speed=1.0)


def _ball(speed: float) -> Stream:
    """From one side to the other; the goal stays."""
    scene = Scene(spatial_arm()).add(Sphere(0.1), name="ball", at=(0.35, -0.6, 0.6))
    start = np.array([0.0, 0.5, 1.2, 0.0, 0.3, 0.0])
    goal = scene.state(start).frame(scene.figure.frame_id("tip")).translation.copy()
    target = (float(goal[0]), float(goal[1]), float(goal[2]))
    problem = Problem(scene, start, goals=[Point("tip", target)])
    way = np.arange(-0.6, 0.6, speed * FRAME)
    frames = tuple(Frame(target, {"ball": (0.35, float(y), 0.6)}) for y in way)
    return Stream(problem, frames + still(target, REST))


asks("moving-obstacle")(partial(_ball, 0.5))


asks("fast-obstacle")(partial(_ball, 2.0))
