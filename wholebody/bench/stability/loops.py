"""Equations that depend on each other, contradict each other, or all share one unknown."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.bench.stability.bodies import Builder, planar_arm
from wholebody.bench.stability.case import HardCase, Kind, Posed
from wholebody.figures.figure import Figure
from wholebody.problem import Problem
from wholebody.scene import Scene
from wholebody.tasks import Hold, Point

GROUP = "Loops and shared joints"
BAR = np.array([-1.0, 1.1, 0.9, 0.3])
ARMS = 12


def _four_bar() -> tuple[Figure, Array]:
    return planar_arm((0.3, 0.5, 0.4, 0.1), 0.02), BAR


class RedundantLoop(HardCase):
    """A four-bar linkage closed twice."""

    name, group, title = "redundant-loop", GROUP, "Redundant loop"
    why = (
        "A linkage in a plane is closed by holding its last link: six equations, of which three say the same as the "
        "plane, and all of them twice. The Jacobian has twelve rows of rank three: normal equations without care are "
        "singular."
    )
    acceptable = "Solved: one degree of freedom is left and the goal lies on its way. Or a clear refusal."

    def question(self) -> Posed:
        """The crank's end is to go where it is after a turn that the loop allows."""
        figure, start = _four_bar()
        scene = Scene(figure)
        crank = BAR[0] + 0.3
        target = 0.3 * np.array([np.cos(crank), 0.0, -np.sin(crank)])
        goal = Point("turn1_link", target, offset=(0.3, 0.0, 0.0))
        return Posed(Problem(scene, start, goals=[goal], constraints=[Hold("tip"), Hold("tip")]))

    def accepts(self, kind: Kind, miss: float) -> bool:
        """Methods without equations for loops may refuse."""
        return kind in ("solved", "refusal")


class InconsistentLoop(HardCase):
    """A linkage whose end is held at two places."""

    name, group, title = "inconsistent-loop", GROUP, "Inconsistent loop"
    why = "The end of a chain is held at two places 5 cm apart. No posture keeps both: a hard equality has no solution."
    acceptable = "An honest answer that says so (the least that can be missed is 25 mm), or a clear refusal."
    expected, best, can_hold = "honest", None, False

    def question(self) -> Posed:
        """Both places are within reach."""
        figure, start = _four_bar()
        scene = Scene(figure)
        tip = scene.state(start).frame(figure.frame_id("tip")).translation.copy()
        holds = [Hold("tip", tip + (0.0, 0.0, step), orientation=False) for step in (0.025, -0.025)]
        goal = Point("turn1_link", scene.state(start).frame(figure.frame_id("turn2_link")).translation.copy(),
                     offset=(0.3, 0.0, 0.0))  # fmt: skip
        return Posed(Problem(scene, start, goals=[goal], constraints=holds))

    def accepts(self, kind: Kind, miss: float) -> bool:
        """Whatever says that it cannot be."""
        return kind in ("honest", "refusal")


class DenseColumn(HardCase):
    """Many arms on one hub."""

    name, group, title = "dense-column", GROUP, "Dense column"
    why = (
        "Twelve arms share one hub, and each has a goal. Every goal depends on the hub: its columns of the Jacobian "
        "are full, and the normal equations of a sparse method fill up with them."
    )
    acceptable = "Solved: all goals were taken from one posture."

    def question(self) -> Posed:
        """A hub that slides and turns."""
        figure = _star()
        scene = Scene(figure)
        start = np.array([0.0, 0.0, 0.0] + [0.4, 0.8] * ARMS)
        witness = start + np.array([0.15, 0.1, 0.4] + [0.2, -0.4] * ARMS)
        state = scene.state(witness)
        goals = [
            Point(f"tip{k}", state.frame(figure.frame_id(f"tip{k}")).translation.copy()) for k in range(1, ARMS + 1)
        ]
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


CASES = (RedundantLoop, InconsistentLoop, DenseColumn)
