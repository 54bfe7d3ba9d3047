"""Sit on a chair with the hands on the thighs.

The chair is the mesh chair.obj (KayKit Dungeon Remastered, CC0) if it is present in the folder that WHOLEBODY_DATA
names, or in ../shared/data beside the checkout. Otherwise it is made of boxes.
"""

from __future__ import annotations

import os
from pathlib import Path

from presenting import OAK, command_line, picture, report

import wholebody as wb

BACKWARDS = (0.0, 0.0, 1.0, 0.0)  # half a turn about z: the mesh has its backrest in front
SCALE = 0.8585  # of the mesh: the seat is as high as the thighs of a man who sits with his soles on the floor
HIPS = 0.034  # m: in front of the middle of the chair, so that the back is close to the backrest
PALM = (0.067, 0.0, -0.34)  # m: on the thigh, in its axes


def mesh() -> Path | None:
    """The chair's file, or None if it is not present."""
    data = Path(os.environ.get("WHOLEBODY_DATA") or Path(__file__).resolve().parents[2] / "shared" / "data")
    path = data / "props" / "chair.obj"
    return path if path.is_file() else None


def add_chair(scene: wb.Scene) -> None:
    """Put the chair at the origin, the backrest behind."""
    path = mesh()
    if path is not None:
        scene.add(wb.Mesh(path, scale=SCALE, up="y"), name="chair", at=(0, 0, 0, *BACKWARDS), color=OAK)
        return
    print("chair.obj is not present (WHOLEBODY_DATA names its folder): the chair is made of boxes")
    scene.add(wb.Box((0.40, 0.50, 0.04)), name="seat", at=(0.08, 0.0, 0.4094), color=OAK)
    scene.add(wb.Box((0.03, 0.50, 0.50)), name="backrest", at=(-0.132, 0.0, 0.65), color=OAK)
    for number, (x, y) in enumerate(((-0.12, 0.22), (-0.12, -0.22), (0.25, 0.22), (0.25, -0.22)), start=1):
        scene.add(wb.Box((0.04, 0.04, 0.386)), name=f"leg {number}", at=(x, y, 0.193), color=OAK)


def build() -> wb.Problem:
    """State the problem."""
    person = wb.load("human", sex="male", stature=1.75, mass=78.0)
    scene = wb.Scene(person)
    add_chair(scene)
    scene.add(wb.HalfSpace(), name="floor")
    start = person.posture("sitting")
    start[0] = HIPS
    return wb.Problem(
        scene,
        start,
        goals=[
            goal
            for side in ("left", "right")
            for goal in (
                wb.Relative(f"{side}_palm", f"{side}_thigh", PALM, orientation=False),
                wb.Axis(f"{side}_palm", (0, 0, 1), direction=(0, 0, -1), weight=0.1),
            )
        ],
        constraints=[wb.Hold("pelvis"), wb.Hold("left_foot"), wb.Hold("right_foot"), wb.tasks.ReachCones()],
        measures=[wb.Effort(), wb.tasks.Discomfort(0.1)],
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.Solution:
    """Solve, report and draw."""
    problem = build()
    solution = wb.solve(problem)
    report("Sit on a chair", problem, solution)
    if pictures:
        picture("chair", problem, solution, out, eye=(2.2, -2.2, 1.4), target=(0.15, 0.0, 0.6))
    return solution


if __name__ == "__main__":
    command_line(main, __doc__)
