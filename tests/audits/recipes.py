"""Three recipes of the docs for people: `python -m tests.audits.recipes FOLDER [COUNT] [SEED]`.

A driver, a seat and a box that is taken and lifted, each solved for COUNT women and COUNT men of `wb.people`. Prints
who is solved, and how many neighbours in stature differ by over 10 degrees in a joint. Pictures of the shortest and the
tallest of each sex, and of those who are not solved, go to FOLDER.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import partial
from importlib import import_module
from math import radians
from pathlib import Path
from typing import Any

import wholebody as wb
from tests.measuring import measure

JUMP = radians(10.0)

EXAMPLES = str(Path(__file__).resolve().parents[2] / "examples")


def example(recipe: str) -> Any:
    """The module of an example, in a child process too."""
    sys.path = [*dict.fromkeys([*sys.path, EXAMPLES])]
    return import_module(recipe)


def task(recipe: str, figure: wb.Figure, _target: Any = None, _layout: Any = None) -> wb.Problem:
    """The problem of a recipe, by the name of its example."""
    module = example(recipe)
    # A seat is at most as high as the popliteal height (ISO 9241-5): who has short legs takes a lower chair.
    sized = (min(module.HIGH, measure(figure)["popliteal_height"]),) if recipe == "take_a_seat" else ()
    made: wb.Problem = module.build(figure, *sized)
    return made


RECIPES: dict[str, dict[str, Any]] = {
    "driver": {"eye": (1.6, -2.2, 1.5), "target": (-0.1, 0.0, 0.55)},
    "take_a_seat": {"eye": (1.6, -2.6, 1.2), "target": (-0.2, 0.0, 0.6)},
    "lift_a_box": {"eye": (2.6, -3.1, 1.8), "target": (0.3, 0.0, 0.95)},
}


def main(folder: Path, count: int = 40, seed: int = 0) -> None:
    """Solve, tell and draw."""
    folder.mkdir(parents=True, exist_ok=True)
    for sex in ("female", "male"):
        people = wb.people(count, sex, seed=seed)
        for recipe in RECIPES:
            found = wb.accommodation(partial(task, recipe), people, method="qp")
            told(f"{sex} {recipe}: {found}")
            jumps = 0
            before: dict[str, float] = {}
            for k, record in enumerate(found.records):
                who = record.factors["person"]
                figure = wb.load("human", **people[who])
                problem, q, status = task(recipe, figure), record.q, record.outcome
                if recipe == "lift_a_box" and record.solved:
                    taken = wb.solve(problem.with_start(q))
                    problem, lifted = example(recipe).lift(taken, problem)
                    q, status = lifted.q, f"taken, lift {lifted.status}"
                values = figure.joint_values(q)
                jumps += max((abs(values[name] - angle) for name, angle in before.items()), default=0.0) > JUMP
                before = values
                if not status.endswith("solved"):
                    told(f"  {who}: {status}, {record.message}")
                if k in (0, count - 1) or not status.endswith("solved"):
                    draw(folder / f"{recipe} {who}.png", problem, q, RECIPES[recipe])
            told(f"  {jumps} of {count - 1} neighbours in stature have a joint that differs by over 10 degrees")


def told(sentence: str) -> None:
    """Print it now."""
    sys.stdout.write(sentence + "\n")
    sys.stdout.flush()


def draw(path: Path, problem: wb.Problem, q: Any, camera: Mapping[str, Any]) -> None:
    """Write the picture of a posture (nq,)."""
    with wb.Viewer(problem.scene) as viewer:
        viewer.show(q, problem=problem)
        viewer.look(**camera)
        viewer.picture(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
