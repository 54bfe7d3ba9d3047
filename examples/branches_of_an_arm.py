"""All postures in which an arm holds its tool at one place, the least effort first."""

from __future__ import annotations

from pathlib import Path

from presenting import OAK, STEEL, command_line

import wholebody as wb

ARM = Path(__file__).parent / "tasks" / "arm.urdf"


def build() -> wb.Problem:
    """State the problem."""
    scene = wb.Scene(wb.load(ARM))
    scene.add(wb.Box((1.6, 1.6, 0.04)), name="bench", at=(0.0, 0.0, -0.03), color=OAK)
    scene.add(wb.Box((0.12, 0.12, 0.25)), name="part", at=(0.45, 0.20, 0.12), color=STEEL)
    return wb.Problem(scene, goals=[wb.Frame("grip", (0.45, 0.20, 0.38, 0.0, 1.0, 0.0, 0.0))], clearance=0.005)


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.planning.Solutions:
    """Solve, report and draw."""
    problem = build()
    found = wb.solutions(problem, most=4, apart=0.5, starts=30, seed=0)
    print(f"All postures above a part: {found}")
    for answer in found:
        print(f"  effort {answer.assessment.measure:.2f}, off by {1e3 * answer.assessment.goal_error:.1e} mm")
    if pictures:
        out.mkdir(parents=True, exist_ok=True)
        with wb.Viewer(problem.scene, title="Branches of an arm") as viewer:
            viewer.look(eye=(1.3, -1.4, 1.1), target=(0.2, 0.05, 0.3))
            viewer.ghosts([answer.q for answer in found[1:]], color=(0.25, 0.45, 0.75, 0.5))
            viewer.show(found[0].q, problem=problem)
            print(f"  {viewer.save(out / 'branches_of_an_arm.html')}")
            try:
                print(f"  {viewer.picture(out / 'branches_of_an_arm.png')}")
            except wb.MissingPackageError as error:
                print(f"  no picture: {error}")
    return found


if __name__ == "__main__":
    command_line(main, __doc__)
