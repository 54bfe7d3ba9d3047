"""Goals and things that move from frame to frame, slowly, fast, and by jumps."""

from __future__ import annotations

from functools import partial

import numpy as np

from wholebody.bench.suite.stability.bodies import planar_arm, spatial_arm
from wholebody.bench.suite.stability.case import FRAME, Frame, Group, Stream, still
from wholebody.geometry.shapes import Box, Sphere
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Point, StepLimit

STREAMS = Group("Goals and things that move", tolerance=1e-3)  # a moderate accuracy, as frames have it
OUTSIDE = "Solved in the end, and outside of the boulder in every frame and between them."
REST = 40  # frames at the end in which the goal rests
RADIUS = 0.03


@STREAMS.case(
    "thin-plate",
    "Thin plate crossed in one step",
    why="From one frame to the next the goal is behind a plate of 4 mm that the arm cannot go round. A step to the "
    "goal ends free of overlap: who looks only at where a step ends passes through.",
    acceptable="An honest best effort: the tip at the plate, on its side of it, in every frame and between them.",
    expected="honest",
    near=0.01,
    best=0.8 - (0.598 - RADIUS),
)
def thin_plate() -> Stream:
    """Thirty frames at rest before the plate would be too kind: it begins at once."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3), RADIUS))
    scene.add(Box((0.004, 3.0, 3.0)), name="plate", at=(0.6, 0.0, 0.0))
    start = np.array([-1.4, 1.5, 1.2])
    problem = Problem(scene, start, goals=[Point("tip", (0.4, 0.0, 0.0))])
    return Stream(problem, still((0.45, 0.0, 0.1), 3) + still((0.8, 0.0, 0.1), REST))


@STREAMS.case(
    "goal-jumps-1-m",
    "A goal that jumps 1 m between frames",
    why="The goal jumps by 1 m every 40 frames, over a block that stands between: the linearisation is worth nothing "
    "at that distance, and the way there counts.",
    acceptable="Solved in the end, and never inside of the block on the way. Less good: an honest answer beside it.",
)
def goal_jumps() -> Stream:
    """To the other side and back."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3), RADIUS))
    scene.add(Box((0.3, 1.0, 0.12)), name="block", at=(0.75, 0.0, 0.0))
    start = np.array([-0.9, 0.5, 0.3])
    problem = Problem(scene, start, goals=[Point("tip", (0.8, 0.0, 0.5))])
    sides = still((0.8, 0.0, 0.5), 5) + still((0.8, 0.0, -0.5), REST) + still((0.8, 0.0, 0.5), REST)
    return Stream(problem, sides)


@STREAMS.case(
    "wrong-active-set",
    "Warm start from the wrong active set",
    why="In a channel the goal is behind the floor in one frame and behind the ceiling in the next. The contacts and "
    "limits that held the last step are those that do not hold this one: a warm start is wrong every time.",
    acceptable="An honest answer in the channel, in every frame.",
    expected="honest",
    best=0.5 - (0.15 - RADIUS),
    near=np.inf,
)
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


for _dt, _name, _title, _why in (
    (
        1e-3, "dt-1-ms", "Frames of 1 ms",
        "The goal moves half a millimetre a frame: steps are smaller than tolerances, and errors of each step add up.",
    ),
    (
        1e-2, "dt-10-ms", "Frames of 10 ms",
        "The goal moves 5 mm a frame over a boulder, 5 cm below its surface: the usual case, for comparison.",
    ),
    (
        0.1, "dt-100-ms", "Frames of 100 ms",
        "The goal moves 5 cm a frame, as far as contacts are looked for: steps begin to cut through what is curved.",
    ),
    (
        1.0, "dt-1-s", "Frames of 1 s",
        "The goal moves 50 cm a frame and is past the boulder in two: nothing that was known in the last frame holds.",
    ),
):  # fmt: skip
    STREAMS.case(_name, _title, why=_why, acceptable=OUTSIDE)(partial(_interval, _dt))


@STREAMS.case(
    "speed-bound",
    "A goal faster than the joints may move",
    why="The problem bounds every joint to 1 rad/s, and the goal moves three times as fast. The bound has to hold in "
    "every frame, and the goal is caught up with when it rests.",
    acceptable="Solved in the end, and no joint faster than 1 rad/s. Or a clear refusal of the bound.",
    also=("refusal",),
)
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


STREAMS.case(
    "moving-obstacle",
    "Moving obstacle",
    why="A ball of 20 cm goes through where the forearm is, at 0.5 m/s; the goal stays. At the beginning of every "
    "frame the ball is 8 mm inside of an arm that did nothing wrong, and the arm has to give way before the "
    "frame ends.",
    acceptable="Solved in the end, and outside of the ball after every frame.",
)(partial(_ball, 0.5))


STREAMS.case(
    "fast-obstacle",
    "Fast obstacle",
    why="The same ball at 2 m/s: 33 mm a frame, about the radius of the forearm. One frame has to bring the arm "
    "farther than linearised contacts can be trusted.",
    acceptable="Solved in the end, and outside of the ball after every frame.",
)(partial(_ball, 2.0))
