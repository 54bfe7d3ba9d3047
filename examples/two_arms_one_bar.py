"""Two robot arms at one bench bring a bar behind a post: two figures, and a loop through both that stays closed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
from presenting import DARK, LIGHT, OAK, command_line, picture, report

import wholebody as wb

ARM = Path(__file__).parent / "tasks" / "arm.urdf"
APART = 1.10  # m: between the two arms, which face each other
BAR, GRIPS = 0.36, 0.22  # m: length of the bar, and from one grip to the other
FROM, TO = -0.22, 0.24  # m: where the bar is along the bench, and where it is to be, turned by 0.4 rad
DOWN = {"left": (-1.0, 0.0, 0.0, 0.0), "right": (0.0, 1.0, 0.0, 0.0)}  # of the grips: from above, along the bar


def build() -> tuple[wb.Scene, np.ndarray]:
    """Two arms with a bar in both grips, and that posture.

    Raises:
        WholebodyError: a grip does not get there.
    """
    arm = wb.load(ARM)
    scene = wb.Scene({"left": arm, "right": (arm, (APART, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0))})
    scene.add(wb.Box((1.6, 1.0, 0.05)), name="bench", at=(0.5 * APART, 0.0, -0.03), color=OAK)
    scene.add(wb.Cylinder(0.05, 0.40), name="post", at=(0.5 * APART, 0.0, 0.20), color=DARK)
    ends = {"left": 0.5 * (APART - GRIPS), "right": 0.5 * (APART + GRIPS)}
    goals = [wb.Frame(f"{side}/grip", (x, FROM, 0.30, *DOWN[side])) for side, x in ends.items()]
    solution = wb.solve(wb.Problem(scene, goals=goals))
    if solution.status != "solved":
        raise wb.WholebodyError(solution.message)
    along = pin.SE3(pin.utils.rotate("y", 0.5 * np.pi), np.array((0.5 * GRIPS, 0.0, 0.0)))
    hands = [f"{side}/{part}" for side in ends for part in ("palm", "left_finger", "right_finger")]
    scene.attach(wb.Capsule(0.015, BAR), to="left/grip", name="bar", at=along, rests_on=hands, color=LIGHT)
    return scene, solution.q


def state(scene: wb.Scene, q: np.ndarray) -> wb.Problem:
    """The bar behind the post; the second grip stays where it is at the bar."""
    turn = pin.SE3(pin.utils.rotate("z", 0.4), np.array((0.5 * APART, TO, 0.34)))
    grip = turn * pin.XYZQUATToSE3(np.array((-0.5 * GRIPS, 0.0, 0.0, *DOWN["left"])))
    return wb.Problem(
        scene, q, goals=[wb.Frame("left/grip", grip)], constraints=[wb.Hold("right/grip", relative_to="left/grip")],
        clearance=0.01,
    )  # fmt: skip


def main(out: Path = Path("pictures"), pictures: bool = True) -> tuple[wb.Problem, wb.Solution]:
    """Solve, report and draw."""
    problem = state(*build())
    solution = wb.solve(problem)
    report("Two arms and a bar", problem, solution)
    if pictures:
        picture("two_arms_one_bar", problem, solution, out, eye=(0.1, -1.9, 1.3), target=(0.5 * APART, 0.05, 0.3))
    return problem, solution


if __name__ == "__main__":
    command_line(main, __doc__)
