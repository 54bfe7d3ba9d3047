"""Starts that are already wrong: inside of things, or out of limits."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.bench.stability.bodies import planar_arm, sliding_tool, spatial_arm
from wholebody.bench.stability.case import HardCase, Posed
from wholebody.geometry.shapes import Box, Sphere
from wholebody.problem import Problem
from wholebody.scene import Scene
from wholebody.tasks import Point

GROUP = "Starts that are wrong"
POSTURE = np.array([0.5, 0.5, 0.57])  # the last link straight down
LENGTHS = (0.5, 0.4, 0.4)
RADIUS = 0.03


class _Inside(HardCase):
    """A last link that stands in a block."""

    group = GROUP
    acceptable = "Solved: the goal is 10 cm above the block. Less good: an honest answer no deeper than the start."
    depth: float

    def question(self) -> Posed:
        """An arm whose last link begins in a block that is far wider than the link is deep in it."""
        figure = planar_arm(LENGTHS, RADIUS, base=(0.0, 0.0, 0.9))
        scene = Scene(figure)
        tip = scene.state(POSTURE).frame(figure.frame_id("tip")).translation.copy()
        top = tip[2] - RADIUS + self.depth
        scene.add(Box((1.0, 0.8, 0.8)), name="block", at=(tip[0], 0.0, top - 0.4))
        return Posed(Problem(scene, POSTURE, goals=[Point("tip", (tip[0], 0.0, top + 0.1))]))


class InsideByAMillimetre(_Inside):
    """A graze."""

    name, title = "start-1-mm-inside", "Start 1 mm inside"
    why = (
        "The tip begins 1 mm inside a block: methods that take only feasible starts give up, and barriers are infinite."
    )
    depth = 1e-3


class InsideByFiveCentimetres(_Inside):
    """A hand in a table."""

    name, title = "start-5-cm-inside", "Start 5 cm inside"
    why = (
        "The tip begins 5 cm inside a block, more than its own radius: the nearest surface is no longer the one "
        "beside it."
    )
    depth = 0.05


class InsideByThirtyCentimetres(_Inside):
    """A forearm in a table."""

    name, title = "start-30-cm-inside", "Start 30 cm inside"
    why = (
        "Most of the last link begins inside a block. Linearised contacts are trusted over a few centimetres, and the "
        "way out is longer."
    )
    depth = 0.3
    see_through = ("block",)


class Cancelling(HardCase):
    """A fork on both sides of a plate."""

    name, group, title = "cancelling-normals", GROUP, "Convex pieces whose normals cancel"
    why = (
        "A fork is pushed over a plate that is thicker than its gap. Each prong overlaps the plate from its own side; "
        "the two normals are opposed and add up to nothing (figure 4b of Schmidl and Lin's paper), although the fork "
        "only has to be pulled back."
    )
    acceptable = "An honest best effort: the fork pulled back by its 12 cm, off the plate."
    expected, best, near = "honest", 0.12, 0.002
    see_through = ("plate",)

    def question(self) -> Posed:
        """The goal keeps the fork where it is, so that nothing but the contact moves it."""
        prong = Box((0.30, 0.12, 0.06))
        handle = (Box((0.06, 0.12, 0.18)), pin.SE3(np.eye(3), np.array([-0.33, 0.0, 0.0])))
        prongs = [(prong, pin.SE3(np.eye(3), np.array([-0.15, 0.0, z]))) for z in (0.06, -0.06)]
        scene = Scene(sliding_tool(handle, *prongs))
        scene.add(Box((1.0, 1.0, 0.09)), name="plate", at=(0.38, 0.0, 0.5))
        start = np.array([0.0, 0.0, 0.5])
        return Posed(Problem(scene, start, goals=[Point("tool", (0.0, 0.0, 0.5))]))


class Coincident(HardCase):
    """Two balls with one middle."""

    name, group, title = "coincident-centres", GROUP, "Coincident centres"
    why = (
        "A ball begins exactly in the middle of another one, and its goal is there. Every way out is as good as any "
        "other: the normal is zero divided by zero."
    )
    acceptable = "An honest best effort: the balls touching, 10 cm from middle to middle, in any direction."
    expected, best, near = "honest", 0.1, 0.001

    def question(self) -> Posed:
        """Both of 5 cm."""
        scene = Scene(sliding_tool((Sphere(0.05), pin.SE3.Identity())))
        scene.add(Sphere(0.05), name="ball", at=(0.0, 0.0, 0.5))
        start = np.array([0.0, 0.0, 0.5])
        return Posed(Problem(scene, start, goals=[Point("tool", (0.0, 0.0, 0.5))]))


class OutOfLimits(HardCase):
    """Joints beyond their limits."""

    name, group, title = "out-of-limits", GROUP, "Start out of limits"
    why = (
        "Two joints begin 0.5 rad beyond their limits, as postures from a tracker or another model do. Bounds on the "
        "first step contradict each other where they are taken at their word."
    )
    acceptable = "Solved, within all limits."

    def question(self) -> Posed:
        """An arm of six joints."""
        start = np.array([3.4, 0.5, 0.9, 0.0, 0.5, -3.4])
        return Posed(Problem(Scene(spatial_arm()), start, goals=[Point("tip", (0.5, 0.2, 0.6))]))


CASES = (
    InsideByAMillimetre, InsideByFiveCentimetres, InsideByThirtyCentimetres, Cancelling, Coincident, OutOfLimits,
)  # fmt: skip
