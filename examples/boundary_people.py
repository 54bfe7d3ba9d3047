"""Men at the boundary of 95 % in sitting height and hip breadth, on one bench beside the man in the middle."""

from __future__ import annotations

from pathlib import Path

from presenting import OAK, command_line, picture, report

import wholebody as wb

CHOSEN = (1, 0, 3)  # the middle between two ends
APART = 0.9  # m
DIMENSIONS = ["sitting_height", "hip_breadth_sitting"]


def build() -> wb.Problem:
    """Seat them beside each other on one bench."""
    people = {f"male boundary {k}": wb.boundary(0.95, DIMENSIONS, sex="male")[f"male boundary {k}"] for k in CHOSEN}
    names = [name.replace("male boundary", "man") for name in people]
    places = [(0.0, APART * k, 0.0) for k in range(len(names))]
    figures = [wb.load("human", **options) for options in people.values()]
    scene = wb.Scene(dict(zip(names, zip(figures, places, strict=True), strict=True)))
    length = APART * len(names)
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.42, length, 0.04)), name="bench", at=(-0.08, 0.5 * (length - APART), 0.42), color=OAK)
    sitting = scene.figure.grounded(wb.Problem(scene, dict.fromkeys(names, "sitting")).start, scene)
    return wb.Problem(
        scene,
        sitting,
        goals=[wb.Sit(on="bench", pelvis=f"{name}/pelvis", trunk=f"{name}/thorax") for name in names],
        constraints=[wb.Hold(f"{name}/{side}_foot") for name in names for side in ("left", "right")],
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.Solution:
    """Solve, report and draw."""
    problem = build()
    solution = wb.solve(problem)
    report("People at the edge of a population", problem, solution)
    if pictures:
        middle = 0.5 * APART * (len(CHOSEN) - 1)
        picture("boundary_people", problem, solution, out, eye=(5.0, middle - 1.5, 1.8), target=(0.0, middle, 0.75))
    return solution


if __name__ == "__main__":
    command_line(main, __doc__)
