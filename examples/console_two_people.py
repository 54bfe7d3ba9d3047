"""A small woman and a large man stand at the same console: which of its controls can each of them reach?

The 5th percentile of women and the 95th of men, in stature and mass (ANSUR II, 2012).
"""

from __future__ import annotations

from pathlib import Path

from presenting import DARK, STEEL, command_line, report

import wholebody as wb

PEOPLE = {
    "small woman": {"sex": "female", "stature": 1.525, "mass": 51.3},
    "large man": {"sex": "male", "stature": 1.87, "mass": 110.69},
}
CONTROLS = {  # m: targets of a fingertip
    "lever": ("left_index_tip", (0.46, 0.30, 0.96)),
    "screen": ("right_index_tip", (0.70, -0.05, 1.30)),
    "breaker": ("right_index_tip", (0.60, -0.25, 1.98)),
}


def console(person: str) -> wb.Scene:
    """Put a person in front of the console."""
    scene = wb.Scene(wb.load("human", **PEOPLE[person]))
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.40, 1.20, 0.80)), name="cabinet", at=(0.58, 0.0, 0.50), color=STEEL)
    scene.add(wb.Box((0.30, 1.20, 0.10)), name="plinth", at=(0.63, 0.0, 0.05), color=DARK)
    scene.add(wb.Box((0.06, 1.20, 1.20)), name="panel", at=(0.75, 0.0, 1.50), color=STEEL)
    scene.add(wb.Box((0.16, 1.20, 0.14)), name="breakers", at=(0.70, 0.0, 2.00), color=DARK)
    return scene


def build(scene: wb.Scene, control: str) -> wb.Problem:
    """The problem of one control: touch it and look at it, with both feet held, in balance."""
    fingertip, place = CONTROLS[control]
    return wb.Problem(
        scene,
        goals=[wb.Point(fingertip, place), wb.Axis("gaze", (1, 0, 0), toward=place, weight=0.1)],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Balance(margin=0.02), wb.tasks.ReachCones()],
        measures=[wb.Effort(), wb.tasks.Discomfort(0.1)],
        clearance=0.002,
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> dict[tuple[str, str], wb.Solution]:
    """Solve for everyone and every control, report and draw."""
    scenes = {person: console(person) for person in PEOPLE}
    problems = {(person, control): build(scenes[person], control) for person in PEOPLE for control in CONTROLS}
    solutions = {who_what: wb.solve(problem) for who_what, problem in problems.items()}
    for (person, control), solution in solutions.items():
        report(f"{person}, {control}", problems[person, control], solution)
    for person in PEOPLE:
        print(f"{person}: " + ", ".join(f"{control} {said(solutions[person, control])}" for control in CONTROLS))
    if pictures:
        draw(problems, solutions, out)
    return solutions


def said(solution: wb.Solution) -> str:
    """The result for one control in words."""
    return "reached" if solution.solved else f"{1e3 * solution.assessment.goal_error:.0f} mm out of reach"


def draw(problems: dict[tuple[str, str], wb.Problem], solutions: dict[tuple[str, str], wb.Solution], out: Path) -> None:
    """Write a page for each person, and one picture: a row for each person, a column for each control."""
    from PIL import Image

    width, height = 480, 540
    whole = Image.new("RGB", (width * len(CONTROLS), height * len(PEOPLE)))
    path = out / "console_two_people.png"
    out.mkdir(parents=True, exist_ok=True)
    for row, person in enumerate(PEOPLE):
        with wb.Viewer(problems[person, "lever"].scene, title=person) as viewer:
            viewer.look(eye=(-1.9, 3.3, 1.8), target=(0.3, 0.0, 1.05))
            for column, control in enumerate(CONTROLS):
                viewer.show(solutions[person, control].q, problem=problems[person, control])
                try:
                    one = Image.open(viewer.picture(path, size=(width, height), legend=False))
                except wb.MissingPackageError as error:
                    print(f"no picture: {error}")
                    continue
                whole.paste(one, (width * column, height * row))
                whole.save(path)
            print(viewer.save(out / f"console_{person.replace(' ', '_')}.html"))
    print(path)


if __name__ == "__main__":
    command_line(main, __doc__)
