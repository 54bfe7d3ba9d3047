"""Reach into a shelf between two boards, and look at the fingertip's target."""

from __future__ import annotations

from pathlib import Path

from presenting import OAK, command_line, picture, report

import wholebody as wb

PLACE = (0.72, -0.28, 1.16)  # m: between the boards, in front of the jar


def build() -> wb.Problem:
    """State the problem; tasks/shelf.toml states the same."""
    scene = wb.Scene(wb.load("human", sex="male", stature=1.75, mass=78.0))
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.40, 0.02, 1.90)), name="left side", at=(0.70, 0.20, 0.95), color=OAK)
    scene.add(wb.Box((0.40, 0.02, 1.90)), name="right side", at=(0.70, -0.80, 0.95), color=OAK)
    scene.add(wb.Box((0.02, 1.02, 1.90)), name="back", at=(0.91, -0.30, 0.95), color=OAK)
    for name, height in (("bottom board", 0.20), ("low board", 0.65), ("board below", 1.05), ("board above", 1.35)):
        scene.add(wb.Box((0.40, 0.98, 0.02)), name=name, at=(0.70, -0.30, height), color=OAK)
    scene.add(wb.Capsule(radius=0.05, length=0.06), name="jar", at=(0.66, -0.12, 1.145), color=(0.75, 0.45, 0.2, 1.0))
    return wb.Problem(
        scene,
        goals=[
            wb.Point("right_index_tip", PLACE),
            wb.Axis("gaze", (1, 0, 0), toward=PLACE, weight=0.1),
        ],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Balance(margin=0.01)],
        measures=[wb.Effort(), wb.tasks.Discomfort(0.1)],
        clearance=0.005,
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.Solution:
    """Solve, report and draw."""
    problem = build()
    solution = wb.solve(problem)
    report("Reach into a shelf", problem, solution)
    if pictures:
        picture(
            "shelf",
            problem,
            solution,
            out,
            eye=(-2.0, -3.4, 2.1),
            target=(0.4, -0.25, 0.95),
            see_through=["right side"],
        )
    return solution


if __name__ == "__main__":
    command_line(main, __doc__)
