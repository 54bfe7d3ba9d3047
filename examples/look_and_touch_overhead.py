"""Look at a lamp overhead and touch it, on both feet and in balance."""

from __future__ import annotations

from pathlib import Path

from presenting import LIGHT, STEEL, command_line, picture, report

import wholebody as wb

LAMP = (0.28, 0.12, 2.10)  # m: its middle
BELOW = (0.28, 0.12, 2.039)  # m: a millimetre below its lowest point


def build() -> wb.Problem:
    """State the problem; tasks/look_and_touch_overhead.toml states the same."""
    scene = wb.Scene(wb.load("human", sex="male", stature=1.75, mass=78.0))
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((1.40, 1.40, 0.04)), name="ceiling", at=(0.20, 0.0, 2.30), color=STEEL)
    scene.add(wb.Capsule(radius=0.01, length=0.12), name="cord", at=(0.28, 0.12, 2.21), color=STEEL)
    scene.add(wb.Sphere(0.06), name="lamp", at=LAMP, color=LIGHT)
    return wb.Problem(
        scene,
        goals=[
            wb.Point("left_index_tip", BELOW),
            wb.Axis("gaze", (1, 0, 0), toward=LAMP, weight=0.1),
        ],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Balance(margin=0.02), wb.tasks.ReachCones()],
        measures=[wb.Effort(), wb.tasks.Discomfort(0.1)],
        clearance=0.005,
        touching=[("left_hand", "lamp")],
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.Solution:
    """Solve, report and draw."""
    problem = build()
    solution = wb.solve(problem)
    report("Look at and touch what is overhead", problem, solution)
    if pictures:
        picture("look_and_touch_overhead", problem, solution, out, eye=(3.2, -3.4, 1.7), target=(0.1, 0.0, 1.15))
    return solution


if __name__ == "__main__":
    command_line(main, __doc__)
