"""Two people carry one box over a post: two figures in one scene, four palms on the box, a loop of four arms."""

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
PEOPLE = {"ann": ("female", 1.68), "ben": ("male", 1.78)}  # sex, stature [m]
PALMS = [f"{name}/{side}_palm" for name in PEOPLE for side in ("left", "right")]
FEET = [wb.Hold(f"{name}/{side}_foot") for name in PEOPLE for side in ("left", "right")]
LEADER = PALMS[0]  # carries the box; the others keep their places at it


def build() -> wb.Scene:
    """Two people who face each other over a post, and a box in the air."""
    ann, ben = (wb.load("human", sex=sex, stature=stature) for sex, stature in PEOPLE.values())
    scene = wb.Scene({"ann": ann, "ben": (ben, (APART, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0))})
    scene.add(wb.Box(BOX), name="box", at=(0.5 * APART, -SIDEWAYS, LOW), color=CARDBOARD)
    scene.add(wb.Box((0.08, 0.08, POST)), name="post", at=(0.5 * APART, 0.0, 0.5 * POST), color=DARK)
    return scene.add(wb.HalfSpace(), name="floor")


def take_hold(scene: wb.Scene) -> Array:
    """Bring four palms to the box's sides, and give it to them there; the posture.

    Raises:
        WholebodyError: a hand does not get there.
    """
    box, goals = np.array((0.5 * APART, -SIDEWAYS, LOW)), []
    for palm in PALMS:
        toward = 1.0 if palm.startswith("ann") else -1.0
        side = toward if "left" in palm else -toward
        goals.append(wb.Point(palm, box + (-toward * GRIP, side * (0.5 * BOX[1] + AWAY), 0.0)))
    solution = wb.solve(wb.Problem(scene, goals=goals, constraints=FEET))
    if solution.status != "solved":
        raise wb.WholebodyError(solution.message)
    at = scene.figure.placement(solution.q, LEADER).inverse() * pin.SE3(np.eye(3), box)
    hands = [palm.replace("palm", "hand") for palm in PALMS]
    scene.remove("box").attach(wb.Box(BOX), to=LEADER, name="box", at=at, rests_on=hands, color=CARDBOARD)
    return solution.q


def carry(scene: wb.Scene, q: Array) -> tuple[list[Array], wb.Solution]:
    """Drag the box level up, across and down; the postures of all frames, and the last one solved."""
    figure = scene.figure
    held = [wb.Hold(palm, relative_to=LEADER, orientation=False) for palm in PALMS if palm != LEADER]
    palm = figure.placement(q, LEADER)
    problem = wb.Problem(scene, q, goals=[wb.Frame(LEADER, palm)], constraints=[*FEET, *held])
    drag, postures = wb.tracking.Drag(problem), [q]
    path = [(-SIDEWAYS, LOW), (-SIDEWAYS, HIGH), (SIDEWAYS, HIGH), (SIDEWAYS, LOW)]
    for begin, end in pairwise(path):
        for share in np.linspace(0.0, 1.0, FRAMES + 1)[1:]:
            y, z = np.array(begin) + share * (np.array(end) - begin)
            moved = palm.translation + (0.0, y + SIDEWAYS, z - LOW)
            postures.append(drag.to(pin.SE3(palm.rotation, moved)).q)
    solution = drag.finish()
    return [*postures, solution.q], solution


def main(out: Path = Path("pictures"), pictures: bool = True) -> tuple[wb.Scene, list[Array], wb.Solution]:
    """Take hold, carry, report and draw."""
    scene = build()
    q = take_hold(scene)
    postures, solution = carry(scene, q)
    low = min(scene.contacts(posture, 0.0).distance.min(initial=0.0) for posture in postures)
    print(f"Carried in {len(postures)} frames: {solution.status}, {solution.assessment.goal_errors[0]:.1e} m off")
    print(f"  deepest penetration in any frame {1e3 * max(-low, 0.0):.3f} mm")
    if pictures:
        chosen = postures[:: len(postures) // 3]
        play(
            "carry_together", scene, np.array(postures), chosen, out,
            eye=(3.2, -3.1, 1.95), target=(0.5 * APART, 0.0, 0.95), size=(400, 480), dt=1 / 15,
        )  # fmt: skip
    return scene, postures, solution


if __name__ == "__main__":
    command_line(main, __doc__)
