"""A passenger stands in a bus: one hand round a pole, the other pinches a ticket, eyes on the ticket."""

from __future__ import annotations

from pathlib import Path

from presenting import LIGHT, STEEL, command_line, picture, report

import wholebody as wb


def build() -> wb.Problem:
    """State the problem."""
    scene = wb.Scene(wb.load("human", sex="female", hands="fingers"))
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Cylinder(0.017, 2.2), name="pole", at=(0.35, -0.35, 1.1), color=STEEL)
    scene.add(wb.Box((0.001, 0.05, 0.09)), name="ticket", at=(0.38, 0.12, 1.25), color=LIGHT)
    return wb.Problem(
        scene,
        goals=[
            wb.Grasp("right", "pole", kind="power"),
            wb.Grasp("left", "ticket", kind="pinch"),
            wb.Axis("gaze", (1, 0, 0), toward=(0.38, 0.12, 1.25), weight=0.1),
        ],
        constraints=[wb.Stand(on="floor")],
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.Solution:
    """Solve, report and draw."""
    problem = build()
    solution = wb.solve(problem)
    report("A passenger", problem, solution)
    if pictures:
        picture("hold_a_pole", problem, solution, out, eye=(1.7, -1.1, 1.9), target=(0.2, 0.0, 1.1))
    return solution


if __name__ == "__main__":
    command_line(main, __doc__)
