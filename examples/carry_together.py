"""Two people carry one box over a post: two figures and a box as one assembly, a loop of four arms."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
from presenting import CARDBOARD, DARK, command_line, play

import wholebody as wb
from wholebody.base.arrays import Array

APART = 1.20  # m: between the two people, who face each other
BOX = (0.46, 0.30, 0.22)  # m
SIDEWAYS, LOW, HIGH = 0.28, 1.00, 1.20  # m: the box's middle goes from one side to the other, over the post
POST = 0.98  # m: its top, above the box's underside on either side
GRIP = 0.15  # m: of the hands from the box's middle, along the line between the people
AWAY = 0.022  # m: of the palms from the box's sides; forearms are 20 mm thicker than hands there
FRAMES = 12  # of a drag from one corner of the path to the next
PEOPLE = {"ann": ("female", 1.68, 0.0), "ben": ("male", 1.78, np.pi)}  # sex, stature [m], turned about z
COLORS = {"ann": (0.80, 0.62, 0.52, 1.0), "ben": (0.52, 0.66, 0.80, 1.0)}


def build() -> wb.Assembly:
    """Two people who stand, and a box in the air between them."""
    made = wb.Assembly()
    for name, (sex, stature, turn) in PEOPLE.items():
        figure = wb.load("human", sex=sex, stature=stature)
        q = np.array(figure.posture(figure.postures[0]))
        base = pin.SE3(pin.utils.rotate("z", turn), np.array((APART if turn else 0.0, 0.0, 0.0)))
        q[:7] = pin.SE3ToXYZQUAT(base * pin.XYZQUATToSE3(q[:7]))
        feet = [wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Balance()]
        made.figure(name, figure, q, constraints=feet, color=COLORS[name])
    made.body("box", (0.5 * APART, -SIDEWAYS, LOW), shape=wb.Box(BOX), color=CARDBOARD)
    made.add(wb.Box((0.08, 0.08, POST)), name="post", at=(0.5 * APART, 0.0, 0.5 * POST), color=DARK)
    return made.add(wb.HalfSpace(), name="floor").ignore("ann", "floor").ignore("ben", "floor")


def take_hold(made: wb.Assembly) -> wb.methods.AssemblySolution:
    """Bring four palms to the box's sides, and join them to it there; the box stays where it is.

    Raises:
        WholebodyError: a hand does not get there.
    """
    made.frame_goal("box", made.placement("box"))
    for name in PEOPLE:
        toward = 1.0 if name == "ann" else -1.0
        for side, left in (("left", toward), ("right", -toward)):
            place = made.placement("box").act(np.array((-toward * GRIP, left * (0.5 * BOX[1] + AWAY), 0.0)))
            made.point_goal(f"{name}/{side}_palm", place)
    solution = made.solve(tolerance=1e-4)
    if solution.status != "solved":
        raise wb.WholebodyError(solution.message)
    for name in PEOPLE:
        for side in ("left", "right"):
            palm = made.placement(f"{name}/{side}_palm").translation
            made.spherical(f"{name}/{side}_palm", "box", at=palm)
    made.drop_goals()
    return solution


def carry(made: wb.Assembly) -> tuple[list[Array], float]:
    """Drag the box level up, across and down; the states, and how far the box is from its goal at the end, metres."""
    path = [(-SIDEWAYS, LOW), (-SIDEWAYS, HIGH), (SIDEWAYS, HIGH), (SIDEWAYS, LOW)]
    made.frame_goal("box", made.placement("box"))
    drag, states = wb.Drag(made), [made.q]
    for begin, end in pairwise(path):
        for share in np.linspace(0.0, 1.0, FRAMES + 1)[1:]:
            y, z = np.array(begin) + share * (np.array(end) - begin)
            states.append(drag.to((0.5 * APART, y, z, 0.0, 0.0, 0.0, 1.0)).q)
    solution = drag.finish()
    return [*states, solution.q], solution.goal_error


def main(out: Path = Path("pictures"), pictures: bool = True) -> tuple[wb.Assembly, list[Array], float]:
    """Take hold, carry, report and draw."""
    made = build()
    reach = take_hold(made)
    print(f"Two people and a box: {len(made.bodies)} bodies, {len(made.scene.pair_table.pairs)} pairs that can touch")
    print(f"  {reach.status}, four palms at the box, deepest overlap {reach.penetration:.1e} m")
    states, left = carry(made)
    scene = made.scene
    least = min(float(scene.contacts(state, 0.2).distance.min(initial=0.2)) for state in states)
    passed = sum(scene.sweep(a, b, tolerance=5e-4) is not None for a, b in pairwise(states) if not np.array_equal(a, b))
    print(f"  carried in {len(states) - 2} frames; the box ends {1e3 * left:.2f} mm or mrad off")
    print(f"  least distance on the way {1e3 * least:.3f} mm; {passed} ways between frames pass through something")
    if pictures:
        draw(made, [*reach.path, *states], [reach.path[0], states[0], states[len(states) // 2], states[-1]], out)
    return made, states, left


def draw(made: wb.Assembly, motion: list[Array], chosen: list[Array], out: Path) -> None:
    """Write carry_together.html, which plays the motion, and carry_together.png: start, hold, above the post, end."""
    play(
        "carry_together",
        made,
        motion,
        chosen,
        out,
        eye=(2.6, -2.4, 1.7),
        target=(0.5 * APART, 0.0, 0.9),
        size=(400, 480),
        dt=1 / 15,
    )


if __name__ == "__main__":
    command_line(main, __doc__)
