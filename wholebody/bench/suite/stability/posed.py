"""Hard problems that are solved once: singular postures, goals out of reach, wrong starts, contact, loops, numbers."""

from __future__ import annotations

from functools import partial
from math import inf, nan

import numpy as np
import pinocchio as pin

from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.stability.bodies import Builder, human_arm, planar_arm, sliding_tool, spatial_arm, turned
from wholebody.bench.suite.stability.case import FRAME, Nonsense, Posed, asks
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Box, Sphere
from wholebody.methods.solve import as_method
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Hold, Orientation, Point
from wholebody.tracking.drag import Drag

LENGTHS, RADIUS = (0.5, 0.4, 0.3), 0.03  # m: of the links of an arm
BENT = np.array([-0.6, 0.8, 0.5])


@asks("straight-arm")
def straight_arm() -> Posed:
    """An arm bent at the start."""
    scene = Scene(planar_arm(LENGTHS))
    return Posed(Problem(scene, BENT, goals=[Point("tip", (sum(LENGTHS) - 1e-6, 0.0, 0.0))]))


@asks("collinear-start")
def collinear_start() -> Posed:
    """A straight arm, and a goal at half its length."""
    return Posed(Problem(Scene(planar_arm(LENGTHS)), np.zeros(3), goals=[Point("tip", (0.6, 0.0, 0.0))]))


@asks("goal-on-axis")
def on_the_axis() -> Posed:
    """An arm that reaches forward."""
    scene = Scene(spatial_arm())
    start = np.array([0.7, 0.9, 0.6, 0.2, 0.4, 0.0])
    return Posed(Problem(scene, start, goals=[Point("tip", (0.0, 0.0, 0.95))]))


@asks("goal-at-shoulder")
def at_the_shoulder() -> Posed:
    """A person with the arm forward."""
    figure = human_arm(clavicle=False)
    scene, start = Scene(figure), figure.posture("arms_forward")
    shoulder = scene.state(start).frame(figure.frame_id("right_shoulder_flexion")).translation.copy()
    return Posed(Problem(scene, start, goals=[Point("right_index_tip", shoulder)]))


@asks("gimbal")
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
    return Posed(Problem(Scene(planar_arm(LENGTHS)), BENT, goals=[Point("tip", (sum(LENGTHS) + by) * way)]))


asks("out-by-1-mm")(partial(_beyond, 1e-3))


asks("out-by-1-m")(partial(_beyond, 1.0))


@asks("inside-obstacle")
def inside_an_obstacle() -> Posed:
    """A box of 20 cm before an arm."""
    scene = Scene(planar_arm(LENGTHS)).add(Box((0.2, 0.4, 0.2)), name="box", at=(0.75, 0.0, 0.3))
    return Posed(Problem(scene, np.array([0.3, 0.8, 0.5]), goals=[Point("tip", (0.75, 0.0, 0.3))]))


@asks("conflict")
def conflict() -> Posed:
    """Two goals of equal weight within reach."""
    goals = [Point("tip", (0.7, 0.0, 0.3)), Point("tip", (0.7, 0.0, 0.5))]
    return Posed(Problem(Scene(planar_arm(LENGTHS)), BENT, goals=goals))


@asks("behind-the-back")
def behind_the_back() -> Posed:
    """A person with the arm forward."""
    figure = human_arm()
    goal = Point("right_index_tip", (-0.154, -0.0056, 1.0116))
    return Posed(Problem(Scene(figure), figure.posture("arms_forward"), goals=[goal]))


@asks("long-way-round")
def the_long_way_round() -> Posed:
    """A stiff arm of two joints, the first one near its limit of 160 degrees either way."""
    limit = np.radians(160.0)
    scene = Scene(planar_arm((0.5, 0.4), limits=(-limit, limit)))
    goal = scene.state(np.array([-np.radians(155.0), 0.4])).frame(scene.figure.frame_id("tip")).translation.copy()
    return Posed(Problem(scene, np.array([np.radians(155.0), 0.4]), goals=[Point("tip", goal)]))


def _inside(depth: float) -> Posed:
    """An arm whose last link begins in a block that is far wider than the link is deep in it."""
    figure, down = planar_arm((0.5, 0.4, 0.4), RADIUS, base=(0.0, 0.0, 0.9)), np.array([0.5, 0.5, 0.57])
    scene = Scene(figure)
    tip = scene.state(down).frame(figure.frame_id("tip")).translation.copy()
    top = tip[2] - RADIUS + depth
    scene.add(Box((1.0, 0.8, 0.8)), name="block", at=(tip[0], 0.0, top - 0.4))
    return Posed(Problem(scene, down, goals=[Point("tip", (tip[0], 0.0, top + 0.1))]))


asks("start-1-mm-inside")(partial(_inside, 1e-3))


asks("start-5-cm-inside")(partial(_inside, 0.05))


asks("start-30-cm-inside")(partial(_inside, 0.3))


@asks("cancelling-normals")
def cancelling() -> Posed:
    """The goal keeps the fork where it is, so that nothing but the contact moves it."""
    prong = Box((0.30, 0.12, 0.06))
    handle = (Box((0.06, 0.12, 0.18)), pin.SE3(np.eye(3), np.array([-0.33, 0.0, 0.0])))
    prongs = [(prong, pin.SE3(np.eye(3), np.array([-0.15, 0.0, z]))) for z in (0.06, -0.06)]
    scene = Scene(sliding_tool(handle, *prongs))
    scene.add(Box((1.0, 1.0, 0.09)), name="plate", at=(0.38, 0.0, 0.5))
    start = np.array([0.0, 0.0, 0.5])
    return Posed(Problem(scene, start, goals=[Point("tool", (0.0, 0.0, 0.5))]))


@asks("coincident-centres")
def coincident() -> Posed:
    """Both of 5 cm."""
    scene = Scene(sliding_tool((Sphere(0.05), pin.SE3.Identity())))
    scene.add(Sphere(0.05), name="ball", at=(0.0, 0.0, 0.5))
    start = np.array([0.0, 0.0, 0.5])
    return Posed(Problem(scene, start, goals=[Point("tool", (0.0, 0.0, 0.5))]))


@asks("out-of-limits")
def out_of_limits() -> Posed:
    """An arm of six joints."""
    start = np.array([3.4, 0.5, 0.9, 0.0, 0.5, -3.4])
    return Posed(Problem(Scene(spatial_arm()), start, goals=[Point("tip", (0.5, 0.2, 0.6))]))


@asks("non-convex-corner")
def corner() -> Posed:
    """An arm over the corner."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3), RADIUS, base=(0.0, 0.0, 0.6)))
    scene.add(Box((2.0, 1.0, 0.2)), name="floor", at=(0.2, 0.0, -0.1))
    scene.add(Box((0.2, 1.0, 1.2)), name="wall", at=(0.9, 0.0, 0.6))
    goal = Point("tip", (0.8 - RADIUS - 1e-3, 0.0, RADIUS + 1e-3))
    return Posed(Problem(scene, np.array([-1.0, 1.6, 0.8]), goals=[goal]))


@asks("narrow-passage")
def narrow_passage() -> Posed:
    """A slot between two blocks, the arm above its mouth."""
    scene = Scene(planar_arm((0.4, 0.4, 0.3, 0.3), RADIUS))
    half = RADIUS + 1e-3
    for name, side in (("upper block", 1.0), ("lower block", -1.0)):
        scene.add(Box((0.3, 0.4, 0.3)), name=name, at=(0.95, 0.0, 0.1 + side * (half + 0.15)))
    start = np.array([-1.2, 1.4, 0.9, 0.4])
    return Posed(Problem(scene, start, goals=[Point("tip", (1.0, 0.0, 0.1))]))


@asks("edge-on-edge")
def edge_on_edge() -> Posed:
    """A box turned on its edge above one turned on the other; it may slide but not turn."""
    scene = Scene(sliding_tool((Box((0.6, 0.2, 0.2)), turned("x", np.pi / 4))))
    scene.add(Box((0.2, 0.6, 0.2)), name="ridge", at=turned("y", np.pi / 4, (0.0, 0.0, 0.3)))
    touching = 0.3 + 2.0 * 0.1 * np.sqrt(2.0)
    start = np.array([0.02, 0.01, touching + 0.1])
    return Posed(Problem(scene, start, goals=[Point("tool", (0.02, 0.01, touching - 0.05))]))


@asks("vertex-on-vertex")
def vertex_on_vertex() -> Posed:
    """Both cubes of 20 cm, tip to tip."""
    leans = np.arccos(1.0 / np.sqrt(3.0))  # rad: a cube's diagonal from the normal of a face
    stand = pin.SE3(pin.utils.rotate("y", np.pi / 2 - leans) @ turned("x", np.pi / 4).rotation, np.zeros(3))
    scene = Scene(sliding_tool((Box((0.2, 0.2, 0.2)), stand)))
    half = 0.1 * np.sqrt(3.0)
    scene.add(Box((0.2, 0.2, 0.2)), name="cube", at=pin.SE3(stand.rotation, np.array([0.0, 0.0, 0.5])))
    start = np.array([0.0, 0.0, 0.5 + 2.0 * half + 1e-4])
    return Posed(Problem(scene, start, goals=[Point("tool", (0.0, 0.0, 0.5 - 2.0 * half - 0.05))]))


BAR = np.array([-1.0, 1.1, 0.9, 0.3])
"""Start of a four-bar linkage, an arm in a plane whose tip is held."""


@asks("redundant-loop")
def redundant_loop() -> Posed:
    """The crank's end is to go where it is after a turn that the loop allows."""
    figure, start = planar_arm((0.3, 0.5, 0.4, 0.1), 0.02), BAR
    scene = Scene(figure)
    crank = BAR[0] + 0.3
    target = 0.3 * np.array([np.cos(crank), 0.0, -np.sin(crank)])
    goal = Point("turn1_link", target, offset=(0.3, 0.0, 0.0))
    return Posed(Problem(scene, start, goals=[goal], constraints=[Hold("tip"), Hold("tip")]))


@asks("inconsistent-loop")
def inconsistent_loop() -> Posed:
    """Both places are within reach."""
    figure, start = planar_arm((0.3, 0.5, 0.4, 0.1), 0.02), BAR
    scene = Scene(figure)
    tip = scene.state(start).frame(figure.frame_id("tip")).translation.copy()
    holds = [Hold("tip", tip + (0.0, 0.0, step), orientation=False) for step in (0.025, -0.025)]
    goal = Point("turn1_link", scene.state(start).frame(figure.frame_id("turn2_link")).translation.copy(),
                 offset=(0.3, 0.0, 0.0))  # fmt: skip
    return Posed(Problem(scene, start, goals=[goal], constraints=holds))


@asks("dense-column")
def dense_column() -> Posed:
    """A hub that slides and turns."""
    figure = _star()
    scene = Scene(figure)
    start = np.array([0.0, 0.0, 0.0] + [0.4, 0.8] * 12)
    witness = start + np.array([0.15, 0.1, 0.4] + [0.2, -0.4] * 12)
    state = scene.state(witness)
    goals = [Point(f"tip{k}", state.frame(figure.frame_id(f"tip{k}")).translation.copy()) for k in range(1, 13)]
    return Posed(Problem(scene, start, goals=goals))


def _star() -> Figure:
    builder = Builder("star of twelve arms")
    slide = builder.joint("px", "slide_x")
    slide = builder.joint("pz", "slide_z", parent=slide)
    hub = builder.joint("ry", "hub", parent=slide)
    for k in range(12):
        angle = 2.0 * np.pi * k / 12
        rim = 0.15 * np.array([np.cos(angle), 0.0, -np.sin(angle)])
        upper = builder.joint("ry", f"upper{k + 1}", parent=hub, at=rim)
        builder.model.jointPlacements[upper] = pin.SE3(pin.utils.rotate("y", angle), rim)
        builder.rod(upper, (0.2, 0.0, 0.0), 0.01)
        lower = builder.joint("ry", f"lower{k + 1}", parent=upper, at=(0.2, 0.0, 0.0))
        builder.rod(lower, (0.2, 0.0, 0.0), 0.01)
        builder.frame(lower, f"tip{k + 1}", (0.2, 0.0, 0.0))
    return builder.figure(pairs=False)


def _scaled(size: float) -> Posed:
    """An arm that reaches over a box, all lengths times `size`."""
    scene = Scene(planar_arm(size * np.array([0.4, 0.3, 0.29]), size * 0.02))
    scene.add(Box((size * 0.1, size * 0.3, size * 0.4)), name="box", at=size * np.array([0.5, 0.0, 0.0]))
    goal = Point("tip", size * np.array([0.62, 0.0, 0.1]))
    return Posed(Problem(scene, np.array([-0.9, 0.3, 0.2]), goals=[goal]))


asks("1-cm-scale")(partial(_scaled, 0.01))


asks("100-m-scale")(partial(_scaled, 100.0))


@asks("goal-1e-12-away")
def tiny_difference() -> Posed:
    """From a bent arm."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3)))
    tip = scene.state(BENT).frame(scene.figure.frame_id("tip")).translation.copy()
    return Posed(Problem(scene, BENT, goals=[Point("tip", tip + (1e-12, 0.0, 0.0))]))


@asks("weight-1e-12")
def tiny_weight() -> Posed:
    """Within easy reach."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3)))
    return Posed(Problem(scene, BENT, goals=[Point("tip", (0.7, 0.0, 0.5), weight=1e-12)]))


@asks("not-a-number")
def not_numbers() -> Nonsense:
    """A start, a goal, a goal in the middle of a drag, a thing's place, and the method's own tolerance."""
    return Nonsense(
        {
            "NaN in the start": lambda adapter: _solve(adapter, start=nan),
            "NaN in a goal": lambda adapter: _solve(adapter, goal=nan),
            "infinity in a goal": lambda adapter: _solve(adapter, goal=inf),
            "NaN in a thing's place": lambda adapter: _solve(adapter, box=nan),
            "NaN in a drag": lambda adapter: Drag(_reach(), adapter.make(1e-5, None)).to((nan, 0.0, 0.5)),
            "NaN in where a drag is": _step_from_nowhere,
            "NaN as tolerance": lambda adapter: adapter.make(nan, None).solve(_reach()),
        }
    )


@asks("two-iterations")
def few_iterations() -> Posed:
    """An arm of six joints over a table."""
    return Posed(_across(), iterations=2)


@asks("qp-iteration-limit")
def qp_limit() -> Posed:
    """The same reach."""
    return Posed(_across(), hindered=True)


def _reach(start: float = 0.5, goal: float = 0.5, box: float = 0.0) -> Problem:
    scene = Scene(planar_arm((0.5, 0.4, 0.3)))
    scene.add(Box((0.1, 0.1, 0.1)), name="box", at=(0.9, 0.0, -0.8))
    problem = Problem(scene, np.array([-0.6, 0.8, start]), goals=[Point("tip", (0.7, 0.0, goal))])
    if box != 0.0:
        scene.move("box", at=(0.9, box, -0.8))
    return problem


def _solve(adapter: Adapter, **changed: float) -> object:
    return adapter.make(1e-5, None).solve(_reach(**changed))


def _step_from_nowhere(adapter: Adapter) -> object:
    return as_method(adapter.make(1e-5, None)).tracker(_reach(), FRAME).step(np.array([-0.6, nan, 0.5]))


def _across() -> Problem:
    scene = Scene(spatial_arm()).add(Box((0.5, 0.8, 0.1)), name="table", at=(0.55, 0.0, 0.35))
    start = np.array([-0.9, 0.5, 0.9, 0.0, 0.5, 0.0])
    return Problem(scene, start, goals=[Point("tip", (0.55, 0.35, 0.45))])
