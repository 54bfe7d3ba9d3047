"""Reach behind the back to a pouch on the belt, around the body."""

from __future__ import annotations

from pathlib import Path

from presenting import LEATHER, command_line, picture, report

import wholebody as wb

POUCH = (-0.158, 0.0, 0.10)  # m: its middle, in the axes of the pelvis
BUCKLE = (-0.199, -0.02, 0.10)  # m: on the back of the pouch, in the axes of the pelvis


def build() -> wb.Problem:
    """State the problem; tasks/behind_the_back.toml states the same."""
    scene = wb.Scene(wb.load("human", sex="female", stature=1.65, mass=62.0))
    scene.add(wb.HalfSpace(), name="floor")
    scene.attach(wb.Box((0.06, 0.18, 0.12)), to="pelvis", name="pouch", at=POUCH, color=LEATHER)
    return wb.Problem(
        scene,
        goals=[wb.Relative("right_index_tip", "pelvis", BUCKLE, orientation=False)],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Balance(margin=0.02), wb.tasks.ReachCones()],
        measures=[wb.Effort(), wb.tasks.Discomfort(0.1)],
        clearance=0.005,
        touching=[("right_hand", "pouch")],
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.Solution:
    """Solve, report and draw."""
    problem = build()
    solution = wb.solve(problem)
    report("Reach behind the back", problem, solution)
    if pictures:
        picture("behind_the_back", problem, solution, out, eye=(-2.9, -1.5, 1.7), target=(0.0, -0.05, 0.85))
    return solution


if __name__ == "__main__":
    command_line(main, __doc__)
