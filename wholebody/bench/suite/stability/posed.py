"""Hard problems that are solved once: singular postures, goals out of reach, wrong starts, and contact itself."""

from __future__ import annotations

from functools import partial

import numpy as np
import pinocchio as pin

from wholebody.bench.suite.stability.bodies import human_arm, planar_arm, sliding_tool, spatial_arm, turned
from wholebody.bench.suite.stability.case import Group, Posed
from wholebody.geometry.shapes import Box, Sphere
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Orientation, Point

SINGULAR = Group("Singular postures")
OUT_OF_REACH = Group("Goals out of reach")
STARTS = Group("Starts that are wrong")
CONTACT = Group("Contact")

LENGTHS = (0.5, 0.4, 0.3)
REACH = sum(LENGTHS)
BENT = np.array([-0.6, 0.8, 0.5])
RADIUS = 0.03
ABOVE_BLOCK = "Solved: the goal is 10 cm above the block. Less good: an honest answer no deeper than the start."
DOWN = np.array([0.5, 0.5, 0.57])  # of an arm whose last link is straight down
BACK = (-0.154, -0.0056, 1.0116)  # m: place of the fingertip in a witness posture behind the back
TIP_DOWN = np.arccos(1.0 / np.sqrt(3.0))  # rad: by which a cube's diagonal leans from its face's normal


@SINGULAR.case(
    "straight-arm",
    "Straight-arm singularity",
    why="The goal is a micrometre short of full stretch. Where the arm is straight no joint moves the tip along it, so "
    "the last stretch is quadratic in the joints: 1 µm of reach is a bend of 2 mrad, and a method that inverts the "
    "Jacobian asks for enormous steps.",
    acceptable="Solved: the goal can be reached.",
)
def straight_arm() -> Posed:
    """An arm bent at the start."""
    scene = Scene(planar_arm(LENGTHS))
    return Posed(Problem(scene, BENT, goals=[Point("tip", (sum(LENGTHS) - 1e-6, 0.0, 0.0))]))


@SINGULAR.case(
    "collinear-start",
    "CCD's collinear start",
    why="The arm is straight and the goal lies on its line, nearer to the shoulder. Every joint's gradient is exactly "
    "zero: coordinate descent does not move, and Gauss-Newton steps are zero too, although half the workspace "
    "leads to the goal.",
    acceptable="Solved: any bend away from the line leads there.",
)
def collinear_start() -> Posed:
    """A straight arm, and a goal at half its length."""
    return Posed(Problem(Scene(planar_arm(LENGTHS)), np.zeros(3), goals=[Point("tip", (0.6, 0.0, 0.0))]))


@SINGULAR.case(
    "goal-on-axis",
    "Goal on a joint's axis",
    why="The goal is straight above the base, on the axis about which the whole arm turns. At the goal that joint "
    "moves nothing, and near it a small sideways error asks for a large turn.",
    acceptable="Solved: shoulder and elbow alone can reach it.",
)
def on_the_axis() -> Posed:
    """An arm that reaches forward."""
    scene = Scene(spatial_arm())
    start = np.array([0.7, 0.9, 0.6, 0.2, 0.4, 0.0])
    return Posed(Problem(scene, start, goals=[Point("tip", (0.0, 0.0, 0.95))]))


@SINGULAR.case(
    "goal-at-shoulder",
    "Goal at the shoulder",
    why="A fingertip is asked into the middle of its own shoulder, which stays where it is. The direction from the "
    "joint to the goal has no length, and the body is in the way.",
    acceptable="An honest best effort: nothing can be there; near the best known answer and outside the body.",
    expected="honest",
    best=None,
    near=0.01,
)
def at_the_shoulder() -> Posed:
    """A person with the arm forward."""
    figure = human_arm(clavicle=False)
    scene, start = Scene(figure), figure.posture("arms_forward")
    shoulder = scene.state(start).frame(figure.frame_id("right_shoulder_flexion")).translation.copy()
    return Posed(Problem(scene, start, goals=[Point("right_index_tip", shoulder)]))


@SINGULAR.case(
    "gimbal",
    "Gimbal posture",
    why="The wrist is straight, which makes its first and its third axis one. The hand is to "
    "turn about the direction that has been lost: at first no joint does that, and the way there is a detour.",
    acceptable="Solved: another combination of the three joints has this orientation.",
)
def gimbal() -> Posed:
    """Roll, pitch and hand of an arm with the pitch at zero: roll and hand are one axis."""
    scene = Scene(spatial_arm())
    start = np.array([0.0, 0.8, 0.7, 0.0, 0.0, 0.0])
    now = scene.state(start).frame(scene.figure.frame_id("tip")).copy()
    wanted = pin.Quaternion(now.rotation @ pin.utils.rotate("x", 0.5))
    goals = [Point("tip", now.translation.copy()), Orientation("tip", wanted.coeffs().copy())]
    return Posed(Problem(scene, start, goals=goals))


def _beyond(by: float) -> Posed:
    """A bent arm, and a goal beyond full stretch in another direction."""
    way = np.array([np.cos(0.7), 0.0, np.sin(0.7)])
    return Posed(Problem(Scene(planar_arm(LENGTHS)), BENT, goals=[Point("tip", (REACH + by) * way)]))


OUT_OF_REACH.case(
    "out-by-1-mm",
    "Out of reach by 1 mm",
    why="The goal is 1 mm beyond full stretch: the nearest posture is singular, the error cannot vanish, and it is so "
    "small that a careless test calls it solved.",
    acceptable="An honest best effort: the arm straight towards the goal, 1 mm left.",
    expected="honest",
    best=1e-3,
)(partial(_beyond, 1e-3))


OUT_OF_REACH.case(
    "out-by-1-m",
    "Out of reach by 1 m",
    why="The goal is 1 m beyond full stretch. The pull never ends: steps that follow it fully thrash from limit to "
    "limit, and every method is at a singular posture where it should come to rest.",
    acceptable="An honest best effort: the arm straight towards the goal, 1 m left.",
    expected="honest",
    best=1.0,
)(partial(_beyond, 1.0))


@OUT_OF_REACH.case(
    "inside-obstacle",
    "Goal inside an obstacle",
    why="The goal is in the middle of a box: what pulls and what pushes balance, and a soft contact gives way.",
    acceptable="An honest best effort: the tip at the box, outside of it.",
    expected="honest",
    best=None,
    near=0.005,
)
def inside_an_obstacle() -> Posed:
    """A box of 20 cm before an arm."""
    scene = Scene(planar_arm(LENGTHS)).add(Box((0.2, 0.4, 0.2)), name="box", at=(0.75, 0.0, 0.3))
    return Posed(Problem(scene, np.array([0.3, 0.8, 0.5]), goals=[Point("tip", (0.75, 0.0, 0.3))]))


@OUT_OF_REACH.case(
    "conflict",
    "Two goals that conflict",
    why="One fingertip is asked to two places 20 cm apart. Both goals can be met alone; together they have no answer.",
    acceptable="An honest best effort: half way, 10 cm from each.",
    expected="honest",
    best=0.1,
    near=1e-3,
)
def conflict() -> Posed:
    """Two goals of equal weight within reach."""
    goals = [Point("tip", (0.7, 0.0, 0.3)), Point("tip", (0.7, 0.0, 0.5))]
    return Posed(Problem(Scene(planar_arm(LENGTHS)), BENT, goals=goals))


@OUT_OF_REACH.case(
    "behind-the-back",
    "Behind the back, with limits in between",
    why="The hand begins in front and is to go to the small of the back. The straight way leads through the trunk and "
    "ends at limits of the shoulder; the way round leads away from the goal first.",
    acceptable="Solved: the place was taken from a posture without overlap within all limits.",
)
def behind_the_back() -> Posed:
    """A person with the arm forward."""
    figure = human_arm()
    goal = Point("right_index_tip", BACK)
    return Posed(Problem(Scene(figure), figure.posture("arms_forward"), goals=[goal]))


@OUT_OF_REACH.case(
    "long-way-round",
    "The long way round a limit",
    why="The goal is 40 degrees further than the shoulder's limit lets it turn, and 320 degrees back the other way. "
    "Every step towards the goal presses against the limit.",
    acceptable="Solved: within the limits on the other side.",
)
def the_long_way_round() -> Posed:
    """A stiff arm of two joints, the first one near its limit of 160 degrees either way."""
    limit = np.radians(160.0)
    scene = Scene(planar_arm((0.5, 0.4), limits=(-limit, limit)))
    goal = scene.state(np.array([-np.radians(155.0), 0.4])).frame(scene.figure.frame_id("tip")).translation.copy()
    return Posed(Problem(scene, np.array([np.radians(155.0), 0.4]), goals=[Point("tip", goal)]))


def _inside(depth: float) -> Posed:
    """An arm whose last link begins in a block that is far wider than the link is deep in it."""
    figure = planar_arm((0.5, 0.4, 0.4), RADIUS, base=(0.0, 0.0, 0.9))
    scene = Scene(figure)
    tip = scene.state(DOWN).frame(figure.frame_id("tip")).translation.copy()
    top = tip[2] - RADIUS + depth
    scene.add(Box((1.0, 0.8, 0.8)), name="block", at=(tip[0], 0.0, top - 0.4))
    return Posed(Problem(scene, DOWN, goals=[Point("tip", (tip[0], 0.0, top + 0.1))]))


STARTS.case(
    "start-1-mm-inside",
    "Start 1 mm inside",
    why="The tip begins 1 mm inside a block: methods that take only feasible starts give up, and barriers are "
    "infinite.",
    acceptable=ABOVE_BLOCK,
)(partial(_inside, 1e-3))


STARTS.case(
    "start-5-cm-inside",
    "Start 5 cm inside",
    why="The tip begins 5 cm inside a block, more than its own radius: the nearest surface is no longer the one "
    "beside it.",
    acceptable=ABOVE_BLOCK,
)(partial(_inside, 0.05))


STARTS.case(
    "start-30-cm-inside",
    "Start 30 cm inside",
    why="Most of the last link begins inside a block. Linearised contacts are trusted over a few centimetres, and the "
    "way out is longer.",
    acceptable=ABOVE_BLOCK,
)(partial(_inside, 0.3))


@STARTS.case(
    "cancelling-normals",
    "Convex pieces whose normals cancel",
    why="A fork is pushed over a plate that is thicker than its gap. Each prong overlaps the plate from its own side; "
    "the two normals are opposed and add up to nothing (figure 4b of Schmidl and Lin's paper), although the fork "
    "only has to be pulled back.",
    acceptable="An honest best effort: the fork pulled back by its 12 cm, off the plate.",
    expected="honest",
    best=0.12,
    near=0.002,
)
def cancelling() -> Posed:
    """The goal keeps the fork where it is, so that nothing but the contact moves it."""
    prong = Box((0.30, 0.12, 0.06))
    handle = (Box((0.06, 0.12, 0.18)), pin.SE3(np.eye(3), np.array([-0.33, 0.0, 0.0])))
    prongs = [(prong, pin.SE3(np.eye(3), np.array([-0.15, 0.0, z]))) for z in (0.06, -0.06)]
    scene = Scene(sliding_tool(handle, *prongs))
    scene.add(Box((1.0, 1.0, 0.09)), name="plate", at=(0.38, 0.0, 0.5))
    start = np.array([0.0, 0.0, 0.5])
    return Posed(Problem(scene, start, goals=[Point("tool", (0.0, 0.0, 0.5))]))


@STARTS.case(
    "coincident-centres",
    "Coincident centres",
    why="A ball begins exactly in the middle of another one, and its goal is there. Every way out is as good as any "
    "other: the normal is zero divided by zero.",
    acceptable="An honest best effort: the balls touching, 10 cm from middle to middle, in any direction.",
    expected="honest",
    best=0.1,
    near=0.001,
)
def coincident() -> Posed:
    """Both of 5 cm."""
    scene = Scene(sliding_tool((Sphere(0.05), pin.SE3.Identity())))
    scene.add(Sphere(0.05), name="ball", at=(0.0, 0.0, 0.5))
    start = np.array([0.0, 0.0, 0.5])
    return Posed(Problem(scene, start, goals=[Point("tool", (0.0, 0.0, 0.5))]))


@STARTS.case(
    "out-of-limits",
    "Start out of limits",
    why="Two joints begin 0.5 rad beyond their limits, as postures from a tracker or another model do. Bounds on the "
    "first step contradict each other where they are taken at their word.",
    acceptable="Solved, within all limits.",
)
def out_of_limits() -> Posed:
    """An arm of six joints."""
    start = np.array([3.4, 0.5, 0.9, 0.0, 0.5, -3.4])
    return Posed(Problem(Scene(spatial_arm()), start, goals=[Point("tip", (0.5, 0.2, 0.6))]))


@CONTACT.case(
    "non-convex-corner",
    "Non-convex corner",
    why="The goal is in the inner corner of a floor and a wall, 1 mm from touching both. Two contacts hold the tip at "
    "once, their active set changes from step to step, and methods that leave one contact at a time go to and fro.",
    acceptable="Solved: there is 1 mm of room.",
)
def corner() -> Posed:
    """An arm over the corner."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3), RADIUS, base=(0.0, 0.0, 0.6)))
    scene.add(Box((2.0, 1.0, 0.2)), name="floor", at=(0.2, 0.0, -0.1))
    scene.add(Box((0.2, 1.0, 1.2)), name="wall", at=(0.9, 0.0, 0.6))
    goal = Point("tip", (0.8 - RADIUS - 1e-3, 0.0, RADIUS + 1e-3))
    return Posed(Problem(scene, np.array([-1.0, 1.6, 0.8]), goals=[goal]))


@CONTACT.case(
    "narrow-passage",
    "Passage 2 mm wider than the limb",
    why="The goal is 20 cm deep in a slot with 1 mm of room on either side. The last link has to be straight in line "
    "with the slot before it enters; nearly all postures near the goal overlap.",
    acceptable="Solved: the arm fits.",
)
def narrow_passage() -> Posed:
    """A slot between two blocks, the arm above its mouth."""
    scene = Scene(planar_arm((0.4, 0.4, 0.3, 0.3), RADIUS))
    half = RADIUS + 1e-3
    for name, side in (("upper block", 1.0), ("lower block", -1.0)):
        scene.add(Box((0.3, 0.4, 0.3)), name=name, at=(0.95, 0.0, 0.1 + side * (half + 0.15)))
    start = np.array([-1.2, 1.4, 0.9, 0.4])
    return Posed(Problem(scene, start, goals=[Point("tip", (1.0, 0.0, 0.1))]))


@CONTACT.case(
    "edge-on-edge",
    "Edge on edge",
    why="Two boxes meet with crossing edges. The normal there is the cross product of the edges, no face has it, and a "
    "small motion along either edge moves the witness points far.",
    acceptable="An honest best effort: the edges in touch, 5 cm short of the goal.",
    expected="honest",
    best=0.05,
)
def edge_on_edge() -> Posed:
    """A box turned on its edge above one turned on the other; it may slide but not turn."""
    scene = Scene(sliding_tool((Box((0.6, 0.2, 0.2)), turned("x", np.pi / 4))))
    scene.add(Box((0.2, 0.6, 0.2)), name="ridge", at=turned("y", np.pi / 4, (0.0, 0.0, 0.3)))
    touching = 0.3 + 2.0 * 0.1 * np.sqrt(2.0)
    start = np.array([0.02, 0.01, touching + 0.1])
    return Posed(Problem(scene, start, goals=[Point("tool", (0.02, 0.01, touching - 0.05))]))


@CONTACT.case(
    "vertex-on-vertex",
    "Vertex on vertex",
    why="A cube stands tip on tip on another cube, and its goal is straight below, on the other side. The normal is "
    "any in a wide cone, it jumps with the slightest motion, and every sideways way is as good as its opposite.",
    acceptable="Solved: the goal is free. Less good: an honest answer that rests on the tip or beside it.",
)
def vertex_on_vertex() -> Posed:
    """Both cubes of 20 cm, tip to tip."""
    tilt = turned("x", np.pi / 4)
    stand = pin.SE3(pin.utils.rotate("y", np.pi / 2 - TIP_DOWN) @ tilt.rotation, np.zeros(3))
    scene = Scene(sliding_tool((Box((0.2, 0.2, 0.2)), stand)))
    half = 0.1 * np.sqrt(3.0)
    scene.add(Box((0.2, 0.2, 0.2)), name="cube", at=pin.SE3(stand.rotation, np.array([0.0, 0.0, 0.5])))
    start = np.array([0.0, 0.0, 0.5 + 2.0 * half + 1e-4])
    return Posed(Problem(scene, start, goals=[Point("tool", (0.0, 0.0, 0.5 - 2.0 * half - 0.05))]))
