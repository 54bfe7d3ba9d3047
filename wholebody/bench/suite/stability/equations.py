"""Equations that depend on each other or contradict each other, and numbers at the ends of their range."""

from __future__ import annotations

from functools import partial
from math import inf, nan

import numpy as np
import pinocchio as pin

from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.stability.bodies import Builder, planar_arm, spatial_arm
from wholebody.bench.suite.stability.case import FRAME, Nonsense, Posed, asks
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Box
from wholebody.methods.solve import as_method
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Hold, Point
from wholebody.tracking.drag import Drag

BAR = np.array([-1.0, 1.1, 0.9, 0.3])
"""Start of a four-bar linkage, an arm in a plane whose tip is held."""

BENT = np.array([-0.6, 0.8, 0.5])


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
