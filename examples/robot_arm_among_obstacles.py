"""A robot arm, from a URDF, reaches through a window to a part behind a post."""

from __future__ import annotations

from pathlib import Path

from presenting import DARK, LIGHT, OAK, STEEL, command_line, picture, report

import wholebody as wb

ARM = Path(__file__).parent / "tasks" / "arm.urdf"
GRIP = (0.83, 0.14, 0.41, 0.0, 0.5**0.5, 0.0, 0.5**0.5)  # m: at the part; fingers forward, on both sides of it


def build() -> wb.Problem:
    """State the problem; tasks/robot_arm_among_obstacles.toml states the same."""
    scene = wb.Scene(wb.load(ARM))
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.03, 0.90, 0.25)), name="below the window", at=(0.50, 0.0, 0.125), color=STEEL)
    scene.add(wb.Box((0.03, 0.90, 0.20)), name="above the window", at=(0.50, 0.0, 0.75), color=STEEL)
    scene.add(wb.Box((0.03, 0.30, 0.40)), name="left of the window", at=(0.50, 0.30, 0.45), color=STEEL)
    scene.add(wb.Box((0.03, 0.30, 0.40)), name="right of the window", at=(0.50, -0.30, 0.45), color=STEEL)
    scene.add(wb.Capsule(radius=0.03, length=0.60), name="post", at=(0.30, 0.10, 0.33), color=DARK)
    scene.add(wb.Box((0.16, 0.16, 0.36)), name="stand", at=(0.84, 0.14, 0.18), color=OAK)
    scene.add(wb.Box((0.05, 0.05, 0.08)), name="part", at=(0.84, 0.14, 0.401), color=LIGHT)
    return wb.Problem(
        scene,
        goals=[wb.Frame("grip", GRIP)],
        measures=[wb.tasks.Displacement()],
        clearance=0.01,
        touching=[("left_finger", "part"), ("right_finger", "part")],
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.Solution:
    """Solve, report and draw."""
    problem = build()
    solution = wb.solve(problem)
    report("A robot arm among obstacles", problem, solution)
    if pictures:
        hidden = ["right of the window"]
        picture(
            "robot_arm_among_obstacles",
            problem,
            solution,
            out,
            eye=(-0.85, -1.75, 1.45),
            target=(0.42, 0.0, 0.3),
            see_through=hidden,
        )
    return solution


if __name__ == "__main__":
    command_line(main, __doc__)
