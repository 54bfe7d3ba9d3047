"""A robot arm hands a part to a person: palm on the part, eyes on it, the arm out of the way of both."""

from __future__ import annotations

from pathlib import Path

from presenting import LIGHT, OAK, STEEL, command_line, picture, report

import wholebody as wb

ARM = Path(__file__).parent / "tasks" / "arm.urdf"
BENCH = 0.85  # m: height of its top
AWAY = 0.95  # m: from the person to the arm, which faces it


def build() -> wb.Problem:
    """State the problem: where the part is handed over is found too."""
    place = (AWAY, 0.0, BENCH, 0.0, 0.0, 1.0, 0.0)
    scene = wb.Scene({"anna": wb.load("human", sex="female"), "arm": (wb.load(ARM), place)})
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.6, 1.4, 0.05)), name="bench", at=(AWAY, 0.0, BENCH - 0.026), color=OAK)
    scene.add(wb.Box((0.3, 0.3, 0.20)), name="feeder", at=(AWAY - 0.1, 0.35, BENCH + 0.10), color=STEEL)
    fingers = ["arm/left_finger", "arm/right_finger", "arm/palm"]
    scene.attach(
        wb.Box((0.12, 0.05, 0.16)), to="arm/grip", name="part", at=(0.0, 0.0, 0.05), rests_on=fingers, color=LIGHT
    )
    return wb.Problem(
        scene,
        goals=[
            wb.Grasp("anna/right", "part", side=(-0.5, -1.0, 0.0)),
            wb.Axis("anna/gaze", (1.0, 0.0, 0.0), toward=(0.45, -0.1, 1.2), weight=0.1),
            wb.Point("arm/grip", (0.50, -0.1, 1.2)),
        ],
        constraints=[wb.Hold("anna/left_foot"), wb.Hold("anna/right_foot")],
        clearance=0.005,
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> tuple[wb.Problem, wb.Solution]:
    """Solve, report and draw."""
    problem = build()
    solution = wb.solve(problem)
    report("A part is handed over", problem, solution)
    if pictures:
        picture("person_and_arm", problem, solution, out, eye=(-0.2, -2.3, 1.8), target=(0.45, 0.0, 1.05))
    return problem, solution


if __name__ == "__main__":
    command_line(main, __doc__)
