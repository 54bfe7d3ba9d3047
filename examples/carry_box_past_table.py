"""Carry a box in both hands past a table and the vase on it, with both feet held and in balance."""

from __future__ import annotations

from math import radians
from pathlib import Path

from presenting import CARDBOARD, OAK, STEEL, command_line, picture, report

import wholebody as wb

SIZE = (0.24, 0.22, 0.36)  # m: of the box; the last from palm to palm
GRIP = 0.001  # m: between a palm and the box
MIDDLE = (0.09, 0.0, 0.5 * SIZE[2] + GRIP)  # m: of the box, in the axes of the right palm
OTHER_PALM = (0.0, 0.0, SIZE[2] + 2.0 * GRIP, -1.0, 0.0, 0.0, 0.0)  # across the box, turned to face the right one
PLACE = (0.42, 0.03, 1.0)  # m: target of the middle of the box, close beside the vase

VASE = (0.50, -0.22, 0.94)  # m: its middle


def build() -> wb.Problem:
    """State the problem; tasks/carry_box_past_table.toml states the same."""
    person = wb.load("human", sex="male", stature=1.75, mass=78.0)
    scene = wb.Scene(person)
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.80, 1.40, 0.04)), name="table top", at=(0.62, -0.72, 0.72), color=OAK)
    for number, (x, y) in enumerate(((0.27, -0.07), (0.27, -1.37), (0.97, -0.07), (0.97, -1.37)), start=1):
        scene.add(wb.Box((0.05, 0.05, 0.70)), name=f"table leg {number}", at=(x, y, 0.35), color=OAK)
    scene.add(wb.Capsule(radius=0.06, length=0.28), name="vase", at=VASE, color=STEEL)
    scene.attach(wb.Box(SIZE), to="right_palm", name="box", at=MIDDLE, color=CARDBOARD)
    bent = {"elbow_flexion": 85.0, "shoulder_rotation": 18.0, "wrist_flexion": -18.0}  # degrees
    return wb.Problem(
        scene,
        start=person.with_joints(
            person.posture("standing"),
            {f"{side}_{joint}": radians(angle) for side in ("left", "right") for joint, angle in bent.items()},
        ),
        goals=[
            wb.Point("right_palm", PLACE, offset=MIDDLE),
            wb.Axis("right_palm", (0, -1, 0), direction=(0, 0, 1)),  # the box stays level
            wb.Axis("gaze", (1, 0, 0), toward=VASE, weight=0.1),
        ],
        constraints=[
            wb.Hold("left_palm", at=OTHER_PALM, relative_to="right_palm"),
            wb.Hold("left_foot"),
            wb.Hold("right_foot"),
            wb.Balance(margin=0.02),
            wb.tasks.ReachCones(),
        ],
        measures=[wb.Effort(), wb.tasks.Discomfort(0.1)],
        clearance=0.01,
        touching=[("box", "left_hand")],
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.Solution:
    """Solve, report and draw."""
    problem = build()
    solution = wb.solve(problem)
    report("Carry a box past a table", problem, solution)
    if pictures:
        picture("carry_box_past_table", problem, solution, out, eye=(3.1, 2.2, 2.1), target=(0.3, -0.2, 0.8))
    return solution


if __name__ == "__main__":
    command_line(main, __doc__)
