"""Equations that depend on each other or contradict each other, and numbers at the ends of their range."""

from __future__ import annotations

from functools import partial

import numpy as np
import pinocchio as pin

from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.stability.bodies import Builder, planar_arm, spatial_arm
from wholebody.bench.suite.stability.case import FRAME, Group, Nonsense, Posed
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Box
from wholebody.methods.solve import as_method
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Hold, Point
from wholebody.tracking.drag import Drag

LOOPS = Group("Loops and shared joints")
NUMBERS = Group("Numbers")

BAR = np.array([-1.0, 1.1, 0.9, 0.3])
"""Start of a four-bar linkage, an arm in a plane whose tip is held."""

ARMS = 12
BENT = np.array([-0.6, 0.8, 0.5])
NAN, INFINITE = float("nan"), float("inf")


@LOOPS.case(
    "redundant-loop",
    "Redundant loop",
    why="A linkage in a plane is closed by holding its last link: six equations, of which three say the same as the "
    "plane, and all of them twice. The Jacobian has twelve rows of rank three: normal equations without care are "
    "singular.",
    acceptable="Solved: one degree of freedom is left and the goal lies on its way. Or a clear refusal.",
    also=("refusal",),
)
def redundant_loop() -> Posed:
    """The crank's end is to go where it is after a turn that the loop allows."""
    figure, start = planar_arm((0.3, 0.5, 0.4, 0.1), 0.02), BAR
    scene = Scene(figure)
    crank = BAR[0] + 0.3
    target = 0.3 * np.array([np.cos(crank), 0.0, -np.sin(crank)])
    goal = Point("turn1_link", target, offset=(0.3, 0.0, 0.0))
    return Posed(Problem(scene, start, goals=[goal], constraints=[Hold("tip"), Hold("tip")]))


@LOOPS.case(
    "inconsistent-loop",
    "Inconsistent loop",
    why="The end of a chain is held at two places 5 cm apart. No posture keeps both: a hard equality has no solution.",
    acceptable="An honest answer that says so (the least that can be missed is 25 mm), or a clear refusal.",
    expected="honest",
    best=None,
    can_hold=False,
    also=("refusal",),
    near=np.inf,
)
def inconsistent_loop() -> Posed:
    """Both places are within reach."""
    figure, start = planar_arm((0.3, 0.5, 0.4, 0.1), 0.02), BAR
    scene = Scene(figure)
    tip = scene.state(start).frame(figure.frame_id("tip")).translation.copy()
    holds = [Hold("tip", tip + (0.0, 0.0, step), orientation=False) for step in (0.025, -0.025)]
    goal = Point("turn1_link", scene.state(start).frame(figure.frame_id("turn2_link")).translation.copy(),
                 offset=(0.3, 0.0, 0.0))  # fmt: skip
    return Posed(Problem(scene, start, goals=[goal], constraints=holds))


@LOOPS.case(
    "dense-column",
    "Dense column",
    why="Twelve arms share one hub, and each has a goal. Every goal depends on the hub: its columns of the Jacobian "
    "are full, and the normal equations of a sparse method fill up with them.",
    acceptable="Solved: all goals were taken from one posture.",
)
def dense_column() -> Posed:
    """A hub that slides and turns."""
    figure = _star()
    scene = Scene(figure)
    start = np.array([0.0, 0.0, 0.0] + [0.4, 0.8] * ARMS)
    witness = start + np.array([0.15, 0.1, 0.4] + [0.2, -0.4] * ARMS)
    state = scene.state(witness)
    goals = [Point(f"tip{k}", state.frame(figure.frame_id(f"tip{k}")).translation.copy()) for k in range(1, ARMS + 1)]
    return Posed(Problem(scene, start, goals=goals))


def _star() -> Figure:
    builder = Builder("star of twelve arms")
    slide = builder.joint("px", "slide_x")
    slide = builder.joint("pz", "slide_z", parent=slide)
    hub = builder.joint("ry", "hub", parent=slide)
    for k in range(ARMS):
        angle = 2.0 * np.pi * k / ARMS
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


NUMBERS.case(
    "1-cm-scale",
    "An arm of 1 cm",
    why="Everything is a hundredth of the usual size: a tolerance of 0.1 mm is a whole link, and damping, trust "
    "regions and contact distances in metres are as large as the arm.",
    acceptable="Solved to 10 µm.",
    tolerance=1e-5,
)(partial(_scaled, 0.01))


NUMBERS.case(
    "100-m-scale",
    "An arm of 100 m",
    why="Everything is a hundred times the usual size: 0.1 mm is a millionth of the arm, steps bounded to centimetres "
    "never arrive, and contact queries within centimetres see nothing.",
    acceptable="Solved to 0.1 mm.",
)(partial(_scaled, 100.0))


@NUMBERS.case(
    "goal-1e-12-away",
    "A goal 1e-12 m away",
    why="The goal is a picometre from where the tip is: differences drown in rounding, lengths divide by nearly "
    "nothing.",
    acceptable="Solved at once.",
)
def tiny_difference() -> Posed:
    """From a bent arm."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3)))
    tip = scene.state(BENT).frame(scene.figure.frame_id("tip")).translation.copy()
    return Posed(Problem(scene, BENT, goals=[Point("tip", tip + (1e-12, 0.0, 0.0))]))


@NUMBERS.case(
    "weight-1e-12",
    "A goal of weight 1e-12",
    why="The only goal has the weight 1e-12: where goals are costs beside others, it is lost among tolerances.",
    acceptable="Solved: a goal is met if it can be, whatever its weight.",
)
def tiny_weight() -> Posed:
    """Within easy reach."""
    scene = Scene(planar_arm((0.5, 0.4, 0.3)))
    return Posed(Problem(scene, BENT, goals=[Point("tip", (0.7, 0.0, 0.5), weight=1e-12)]))


@NUMBERS.case(
    "not-a-number",
    "NaN and infinity",
    why="NaN passes every comparison: a check like `error > tolerance` lets it through, and it comes out of the method "
    "as a posture of NaN or an endless loop.",
    acceptable="A clear refusal of each: an InputError that says where and how to correct it.",
    expected="refusal",
    best=None,
)
def not_numbers() -> Nonsense:
    """A start, a goal, a goal in the middle of a drag, a thing's place, and the method's own tolerance."""
    return Nonsense(
        {
            "NaN in the start": lambda adapter: _solve(adapter, start=NAN),
            "NaN in a goal": lambda adapter: _solve(adapter, goal=NAN),
            "infinity in a goal": lambda adapter: _solve(adapter, goal=INFINITE),
            "NaN in a thing's place": lambda adapter: _solve(adapter, box=NAN),
            "NaN in a drag": lambda adapter: Drag(_reach(), adapter.make(1e-5, None)).to((NAN, 0.0, 0.5)),
            "NaN in where a drag is": _step_from_nowhere,
            "NaN as tolerance": lambda adapter: adapter.make(NAN, None).solve(_reach()),
        }
    )


@NUMBERS.case(
    "two-iterations",
    "A budget of two iterations",
    why="The method may take two iterations for a reach across a table: it is stopped anywhere, and has to know it.",
    acceptable="An honest answer of what was reached, outside of the table and within limits.",
    expected="honest",
    near=np.inf,
    also=("solved", "refusal"),
)
def few_iterations() -> Posed:
    """An arm of six joints over a table."""
    return Posed(_across(), iterations=2)


@NUMBERS.case(
    "qp-iteration-limit",
    "A QP that hits its iteration limit",
    why="OSQP may take five iterations for each quadratic program, and everything that would finish its answer exactly "
    "is taken away: every step is built on an answer that is none. Methods without such programs get one iteration.",
    acceptable="An honest answer, outside of the table and within limits; or solved all the same.",
    expected="honest",
    near=np.inf,
    also=("solved", "refusal"),
)
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
    return as_method(adapter.make(1e-5, None)).tracker(_reach(), FRAME).step(np.array([-0.6, NAN, 0.5]))


def _across() -> Problem:
    scene = Scene(spatial_arm()).add(Box((0.5, 0.8, 0.1)), name="table", at=(0.55, 0.0, 0.35))
    start = np.array([-0.9, 0.5, 0.9, 0.0, 0.5, 0.0])
    return Problem(scene, start, goals=[Point("tip", (0.55, 0.35, 0.45))])
