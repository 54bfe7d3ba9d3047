"""Which people press a button on a wall at which height, and how their postures score."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from presenting import STEEL, command_line, picture

import wholebody as wb

HEIGHTS = {"low": 0.90, "middle": 1.30, "high": 2.00}  # m: of the button


def build(figure: wb.Figure, height: float, layout: Any = None) -> wb.Problem:
    """The problem of one person and one height; all stand alike."""
    scene = wb.Scene(figure)
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.05, 1.60, 2.40)), name="wall", at=(0.575, 0.0, 1.20), color=STEEL)
    return wb.Problem(
        scene,
        goals=[wb.Point("right_index_tip", (0.54, -0.20, height))],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Balance()],
    )


def main(out: Path = Path("pictures"), pictures: bool = True) -> wb.studies.Records:
    """Solve for everybody, print a table, and write it."""
    people = {name: wb.load("human", **given) for name, given in PEOPLE.items()}
    records = wb.study(build, people=people, targets=HEIGHTS, warm_start=True)
    print(records)
    for one in records:
        assert one.factors is not None
        score = "" if one.q is None else wb.ergonomics.rula(people[one.factors["person"]], one.q).score
        print(f"  {one.name:<20} {one.outcome:<12} {1e3 * one.goal_error:7.1f} mm short, RULA {score}")
    if pictures:
        out.mkdir(parents=True, exist_ok=True)
        print(f"  wrote {records.to_csv(out / 'study_of_people.csv')}")
        last = build(people["small woman"], HEIGHTS["high"])  # the one that is out of reach
        answer = next(one for one in records if one.name == "small woman, high")
        picture("study_of_people", last, answer, out, eye=(-1.6, -3.9, 1.9), target=(0.3, 0.0, 1.05))
    return records


PEOPLE: dict[str, dict[str, Any]] = {
    "small woman": {"sex": "female", "stature": 1.52},
    "tall man": {"sex": "male", "stature": 1.88},
}

if __name__ == "__main__":
    command_line(main, __doc__)
