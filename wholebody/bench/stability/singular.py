"""Postures in which joints lose directions: stretched arms, axes through the goal, axes that fall together."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.bench.stability.bodies import human_arm, planar_arm, spatial_arm
from wholebody.bench.stability.case import HardCase, Posed
from wholebody.problem import Problem
from wholebody.scene import Scene
from wholebody.tasks import Orientation, Point

GROUP = "Singular postures"
LENGTHS = (0.5, 0.4, 0.3)
BENT = np.array([-0.6, 0.8, 0.5])


class StraightArm(HardCase):
    """The goal is at full stretch."""

    name, group, title = "straight-arm", GROUP, "Straight-arm singularity"
    why = (
        "The goal is a micrometre short of full stretch. Where the arm is straight no joint moves the tip along it, so "
        "the last stretch is quadratic in the joints: 1 µm of reach is a bend of 2 mrad, and a method that inverts the "
        "Jacobian asks for enormous steps."
    )
    acceptable = "Solved: the goal can be reached."

    def question(self) -> Posed:
        """An arm bent at the start."""
        scene = Scene(planar_arm(LENGTHS))
        return Posed(Problem(scene, BENT, goals=[Point("tip", (sum(LENGTHS) - 1e-6, 0.0, 0.0))]))


class CollinearStart(HardCase):
    """Joint, tip and goal on one line at the start."""

    name, group, title = "collinear-start", GROUP, "CCD's collinear start"
    why = (
        "The arm is straight and the goal lies on its line, nearer to the shoulder. Every joint's gradient is exactly "
        "zero: coordinate descent does not move, and Gauss-Newton steps are zero too, although half the workspace "
        "leads to the goal."
    )
    acceptable = "Solved: any bend away from the line leads there."

    def question(self) -> Posed:
        """A straight arm, and a goal at half its length."""
        return Posed(Problem(Scene(planar_arm(LENGTHS)), np.zeros(3), goals=[Point("tip", (0.6, 0.0, 0.0))]))


class OnTheAxis(HardCase):
    """The goal is on the axis of the first joint."""

    name, group, title = "goal-on-axis", GROUP, "Goal on a joint's axis"
    why = (
        "The goal is straight above the base, on the axis about which the whole arm turns. At the goal that joint "
        "moves nothing, and near it a small sideways error asks for a large turn."
    )
    acceptable = "Solved: shoulder and elbow alone can reach it."

    def question(self) -> Posed:
        """An arm that reaches forward."""
        scene = Scene(spatial_arm())
        start = np.array([0.7, 0.9, 0.6, 0.2, 0.4, 0.0])
        return Posed(Problem(scene, start, goals=[Point("tip", (0.0, 0.0, 0.95))]))


class AtTheShoulder(HardCase):
    """The goal is in the shoulder itself."""

    name, group, title = "goal-at-shoulder", GROUP, "Goal at the shoulder"
    why = (
        "A fingertip is asked into the middle of its own shoulder, which stays where it is. The direction from the "
        "joint to the goal has no length, and the body is in the way."
    )
    acceptable = "An honest best effort: nothing can be there; near the best known answer and outside the body."
    expected, best, near = "honest", None, 0.01
    eye = (1.0, -0.8, 0.35)

    def question(self) -> Posed:
        """A person with the arm forward."""
        figure = human_arm(clavicle=False)
        scene, start = Scene(figure), figure.posture("arms_forward")
        shoulder = scene.state(start).frame(figure.frame_id("right_shoulder_flexion")).translation.copy()
        return Posed(Problem(scene, start, goals=[Point("right_index_tip", shoulder)]))


class Gimbal(HardCase):
    """Two of three wrist axes fall together."""

    name, group, title = "gimbal", GROUP, "Gimbal posture"
    why = (
        "The wrist is straight, which makes its first and its third axis one. The hand is to "
        "turn about the direction that has been lost: at first no joint does that, and the way there is a detour."
    )
    acceptable = "Solved: another combination of the three joints has this orientation."

    def question(self) -> Posed:
        """Roll, pitch and hand of an arm with the pitch at zero: roll and hand are one axis."""
        scene = Scene(spatial_arm())
        start = np.array([0.0, 0.8, 0.7, 0.0, 0.0, 0.0])
        now = scene.state(start).frame(scene.figure.frame_id("tip")).copy()
        wanted = pin.Quaternion(now.rotation @ pin.utils.rotate("x", 0.5))
        goals = [Point("tip", now.translation.copy()), Orientation("tip", wanted.coeffs().copy())]
        return Posed(Problem(scene, start, goals=goals))


CASES = (StraightArm, CollinearStart, OnTheAxis, AtTheShoulder, Gimbal)
