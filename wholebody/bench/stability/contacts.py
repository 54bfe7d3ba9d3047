"""Places where contact itself is hard: corners, slots, edges and vertices."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.bench.stability.bodies import planar_arm, sliding_tool, turned
from wholebody.bench.stability.case import HardCase, Posed
from wholebody.geometry.shapes import Box
from wholebody.problem import Problem
from wholebody.scene import Scene
from wholebody.tasks import Point

GROUP = "Contact"
RADIUS = 0.03
TIP_DOWN = np.arccos(1.0 / np.sqrt(3.0))  # rad: by which a cube's diagonal leans from its face's normal


class Corner(HardCase):
    """The inner corner of a wall and a floor."""

    name, group, title = "non-convex-corner", GROUP, "Non-convex corner"
    why = (
        "The goal is in the inner corner of a floor and a wall, 1 mm from touching both. Two contacts hold the tip at "
        "once, their active set changes from step to step, and methods that leave one contact at a time go to and fro."
    )
    acceptable = "Solved: there is 1 mm of room."
    eye = (-0.6, -1.0, 0.6)

    def question(self) -> Posed:
        """An arm over the corner."""
        scene = Scene(planar_arm((0.5, 0.4, 0.3), RADIUS, base=(0.0, 0.0, 0.6)))
        scene.add(Box((2.0, 1.0, 0.2)), name="floor", at=(0.2, 0.0, -0.1))
        scene.add(Box((0.2, 1.0, 1.2)), name="wall", at=(0.9, 0.0, 0.6))
        goal = Point("tip", (0.8 - RADIUS - 1e-3, 0.0, RADIUS + 1e-3))
        return Posed(Problem(scene, np.array([-1.0, 1.6, 0.8]), goals=[goal]))


class NarrowPassage(HardCase):
    """A slot 2 mm wider than the limb."""

    name, group, title = "narrow-passage", GROUP, "Passage 2 mm wider than the limb"
    why = (
        "The goal is 20 cm deep in a slot with 1 mm of room on either side. The last link has to be straight in line "
        "with the slot before it enters; nearly all postures near the goal overlap."
    )
    acceptable = "Solved: the arm fits."
    see_through = ("upper block", "lower block")

    def question(self) -> Posed:
        """A slot between two blocks, the arm above its mouth."""
        scene = Scene(planar_arm((0.4, 0.4, 0.3, 0.3), RADIUS))
        half = RADIUS + 1e-3
        for name, side in (("upper block", 1.0), ("lower block", -1.0)):
            scene.add(Box((0.3, 0.4, 0.3)), name=name, at=(0.95, 0.0, 0.1 + side * (half + 0.15)))
        start = np.array([-1.2, 1.4, 0.9, 0.4])
        return Posed(Problem(scene, start, goals=[Point("tip", (1.0, 0.0, 0.1))]))


class EdgeOnEdge(HardCase):
    """A keel that comes down on a ridge."""

    name, group, title = "edge-on-edge", GROUP, "Edge on edge"
    why = (
        "Two boxes meet with crossing edges. The normal there is the cross product of the edges, no face has it, and a "
        "small motion along either edge moves the witness points far."
    )
    acceptable = "An honest best effort: the edges in touch, 5 cm short of the goal."
    expected, best = "honest", 0.05

    def question(self) -> Posed:
        """A box turned on its edge above one turned on the other; it may slide but not turn."""
        scene = Scene(sliding_tool((Box((0.6, 0.2, 0.2)), turned("x", np.pi / 4))))
        scene.add(Box((0.2, 0.6, 0.2)), name="ridge", at=turned("y", np.pi / 4, (0.0, 0.0, 0.3)))
        touching = 0.3 + 2.0 * 0.1 * np.sqrt(2.0)
        start = np.array([0.02, 0.01, touching + 0.1])
        return Posed(Problem(scene, start, goals=[Point("tool", (0.02, 0.01, touching - 0.05))]))


class VertexOnVertex(HardCase):
    """A cube that stands with its tip on another's."""

    name, group, title = "vertex-on-vertex", GROUP, "Vertex on vertex"
    why = (
        "A cube stands tip on tip on another cube, and its goal is straight below, on the other side. The normal is "
        "any in a wide cone, it jumps with the slightest motion, and every sideways way is as good as its opposite."
    )
    acceptable = "Solved: the goal is free. Less good: an honest answer that rests on the tip or beside it."

    def question(self) -> Posed:
        """Both cubes of 20 cm, tip to tip."""
        tilt = turned("x", np.pi / 4)
        stand = pin.SE3(pin.utils.rotate("y", np.pi / 2 - TIP_DOWN) @ tilt.rotation, np.zeros(3))
        scene = Scene(sliding_tool((Box((0.2, 0.2, 0.2)), stand)))
        half = 0.1 * np.sqrt(3.0)
        scene.add(Box((0.2, 0.2, 0.2)), name="cube", at=pin.SE3(stand.rotation, np.array([0.0, 0.0, 0.5])))
        start = np.array([0.0, 0.0, 0.5 + 2.0 * half + 1e-4])
        return Posed(Problem(scene, start, goals=[Point("tool", (0.0, 0.0, 0.5 - 2.0 * half - 0.05))]))


CASES = (Corner, NarrowPassage, EdgeOnEdge, VertexOnVertex)
