"""Goals that cannot be met, or that limits and bodies stand in the way of."""

from __future__ import annotations

import numpy as np

from wholebody.bench.stability.bodies import human_arm, planar_arm
from wholebody.bench.stability.case import HardCase, Posed
from wholebody.geometry.shapes import Box
from wholebody.problem import Problem
from wholebody.scene import Scene
from wholebody.tasks import Point

GROUP = "Goals out of reach"
LENGTHS = (0.5, 0.4, 0.3)
REACH = sum(LENGTHS)
BENT = np.array([-0.6, 0.8, 0.5])


class _Beyond(HardCase):
    """A goal farther away than the arm is long."""

    group = GROUP
    expected = "honest"
    by: float

    def question(self) -> Posed:
        """A bent arm, and a goal beyond full stretch in another direction."""
        way = np.array([np.cos(0.7), 0.0, np.sin(0.7)])
        return Posed(Problem(Scene(planar_arm(LENGTHS)), BENT, goals=[Point("tip", (REACH + self.by) * way)]))


class OutByAMillimetre(_Beyond):
    """Just out of reach."""

    name, title = "out-by-1-mm", "Out of reach by 1 mm"
    why = (
        "The goal is 1 mm beyond full stretch: the nearest posture is singular, the error cannot vanish, and it is so "
        "small that a careless test calls it solved."
    )
    acceptable = "An honest best effort: the arm straight towards the goal, 1 mm left."
    by = best = 1e-3


class OutByAMetre(_Beyond):
    """Far out of reach."""

    name, title = "out-by-1-m", "Out of reach by 1 m"
    why = (
        "The goal is 1 m beyond full stretch. The pull never ends: steps that follow it fully thrash from limit to "
        "limit, and every method is at a singular posture where it should come to rest."
    )
    acceptable = "An honest best effort: the arm straight towards the goal, 1 m left."
    by = best = 1.0


class InsideAnObstacle(HardCase):
    """The goal is in the middle of a box."""

    name, group, title = "inside-obstacle", GROUP, "Goal inside an obstacle"
    why = "The goal is in the middle of a box: what pulls and what pushes balance, and a soft contact gives way."
    acceptable = "An honest best effort: the tip at the box, outside of it."
    expected, best, near = "honest", None, 0.005
    see_through = ("box",)

    def question(self) -> Posed:
        """A box of 20 cm before an arm."""
        scene = Scene(planar_arm(LENGTHS)).add(Box((0.2, 0.4, 0.2)), name="box", at=(0.75, 0.0, 0.3))
        return Posed(Problem(scene, np.array([0.3, 0.8, 0.5]), goals=[Point("tip", (0.75, 0.0, 0.3))]))


class Conflict(HardCase):
    """One tip, two places."""

    name, group, title = "conflict", GROUP, "Two goals that conflict"
    why = "One fingertip is asked to two places 20 cm apart. Both goals can be met alone; together they have no answer."
    acceptable = "An honest best effort: half way, 10 cm from each."
    expected, best, near = "honest", 0.1, 1e-3

    def question(self) -> Posed:
        """Two goals of equal weight within reach."""
        goals = [Point("tip", (0.7, 0.0, 0.3)), Point("tip", (0.7, 0.0, 0.5))]
        return Posed(Problem(Scene(planar_arm(LENGTHS)), BENT, goals=goals))


class BehindTheBack(HardCase):
    """A hand from the front to the small of the back."""

    name, group, title = "behind-the-back", GROUP, "Behind the back, with limits in between"
    why = (
        "The hand begins in front and is to go to the small of the back. The straight way leads through the trunk and "
        "ends at limits of the shoulder; the way round leads away from the goal first."
    )
    acceptable = "Solved: the place was taken from a posture without overlap within all limits."
    eye = (-1.0, -0.7, 0.35)

    def question(self) -> Posed:
        """A person with the arm forward."""
        figure = human_arm()
        goal = Point("right_index_tip", BACK)
        return Posed(Problem(Scene(figure), figure.posture("arms_forward"), goals=[goal]))


BACK = (-0.154, -0.0056, 1.0116)
"""Place of the fingertip in a witness posture behind the back [m]."""


class TheLongWayRound(HardCase):
    """Forty degrees off, and to be reached by turning back three hundred and twenty."""

    name, group, title = "long-way-round", GROUP, "The long way round a limit"
    why = (
        "The goal is 40 degrees further than the shoulder's limit lets it turn, and 320 degrees back the other way. "
        "Every step towards the goal presses against the limit."
    )
    acceptable = "Solved: within the limits on the other side."

    def question(self) -> Posed:
        """A stiff arm of two joints, the first one near its limit of 160 degrees either way."""
        limit = np.radians(160.0)
        scene = Scene(planar_arm((0.5, 0.4), limits=(-limit, limit)))
        goal = scene.state(np.array([-np.radians(155.0), 0.4])).frame(scene.figure.frame_id("tip")).translation.copy()
        return Posed(Problem(scene, np.array([np.radians(155.0), 0.4]), goals=[Point("tip", goal)]))


CASES = (OutByAMillimetre, OutByAMetre, InsideAnObstacle, Conflict, BehindTheBack, TheLongWayRound)
