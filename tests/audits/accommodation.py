"""Criteria of one dimension each, solved for people: `python -m tests.audits.accommodation ansur2.csv`.

Each scene has one thing in the way of one dimension of people who stand or sit as they are measured. Whoever is solved
is compared with the own body's dimension, and the share of a population on the right side with that of the table.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import wholebody as wb
from tests.audits.population import people as rows_of
from wholebody.figures.measuring import measure

HIGH = 0.6
"""Height of the seat, metres."""

SIT = wb.Sit(on="seat", back="back", erect=True)

GIRDLE = wb.Freeze(*(f"{side}_clavicle_{part}" for side in ("left", "right") for part in ("protraction", "elevation")))


@dataclass(frozen=True)
class Criterion:
    """A task that people pass whose dimension is at most a value, or at least.

    Attributes:
        dimension: its name.
        value: of men and women, metres.
        most: whether people with more than the value are left out; otherwise those with less.
        sees: a point that has to be seen; None for none.
    """

    dimension: str
    value: float
    most: bool = True
    sees: tuple[float, float, float] | None = None

    def passes(self, dimension: Any) -> Any:
        """Whether somebody with such a dimension, metres, is to pass; arrays too."""
        return (dimension <= self.value) if self.most else (dimension >= self.value)

    def __call__(self, figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
        """The task."""
        made: wb.Problem = getattr(self, f"_{self.dimension}")(figure)
        return made

    def _seated(self, figure: wb.Figure, deep: float = 0.40, high: float = HIGH) -> wb.Scene:
        scene = wb.Scene(figure).add(wb.Box((deep, 0.6, 0.04)), name="seat", at=(0.5 * deep, 0.0, high - 0.02))
        return scene.add(wb.Box((0.03, 0.6, 0.6)), name="back", at=(-0.015, 0.0, high + 0.4))

    def _thigh_clearance(self, figure: wb.Figure) -> wb.Problem:
        scene = self._seated(figure)
        scene.add(wb.Box((0.6, 1.2, 0.03)), name="desk", at=(0.60, 0.0, HIGH + self.value + 0.015))
        return wb.Problem(scene, "sitting", constraints=[SIT])

    def _hip_breadth_sitting(self, figure: wb.Figure) -> wb.Problem:
        scene = self._seated(figure)
        for name, side in (("left rest", 1.0), ("right rest", -1.0)):
            scene.add(wb.Box((0.3, 0.04, 0.18)), name=name, at=(0.2, side * (0.5 * self.value + 0.02), HIGH + 0.091))
        return wb.Problem(scene, "sitting", constraints=[SIT])

    def _popliteal_height(self, figure: wb.Figure) -> wb.Problem:
        scene = self._seated(figure, 0.36, self.value).add(wb.HalfSpace(), name="floor")
        return wb.Problem(scene, "sitting", constraints=[SIT, wb.Stand(on="floor", balance=False)])

    def _buttock_knee_length(self, figure: wb.Figure) -> wb.Problem:
        scene = self._seated(figure)
        scene.add(wb.Box((0.04, 1.2, 0.24)), name="panel", at=(self.value + 0.02, 0.0, HIGH + 0.08))
        knees = wb.Freeze("left_knee_flexion", "right_knee_flexion")
        return wb.Problem(scene, "sitting", constraints=[SIT, knees])

    def _sitting_height(self, figure: wb.Figure) -> wb.Problem:
        scene = self._seated(figure)
        scene.add(wb.Box((0.8, 1.0, 0.05)), name="roof", at=(0.2, 0.0, HIGH + self.value + 0.025))
        return wb.Problem(scene, "sitting", constraints=[SIT])

    def _eye_height_sitting(self, figure: wb.Figure) -> wb.Problem:
        scene = self._seated(figure)
        scene.add(wb.Box((0.05, 2.0, 0.4)), name="board", at=(1.5, 0.0, HIGH + self.value - 0.2))
        return wb.Problem(scene, "sitting", constraints=[SIT])

    def _overhead_reach_sitting(self, figure: wb.Figure) -> wb.Problem:
        reached = wb.Plane("left_middle_tip", (0, 0, 1), point=(0.0, 0.0, HIGH + self.value), side="above")
        return wb.Problem(self._seated(figure), "sitting", constraints=[SIT, reached])

    def _thumb_tip_reach(self, figure: wb.Figure) -> wb.Problem:
        reached = wb.Plane("left_thumb_tip", (1, 0, 0), point=(self.value, 0.0, 0.0), side="above")
        return wb.Problem(self._seated(figure), "sitting", constraints=[SIT, GIRDLE, reached])

    def _stature(self, figure: wb.Figure) -> wb.Problem:
        scene = wb.Scene(figure).add(wb.Box((0.5, 0.9, 0.1)), name="lintel", at=(0.0, 0.0, self.value + 0.05))
        return wb.Problem(scene, constraints=[wb.Freeze("root", *figure.joints)])

    def _knee_height_sitting(self, figure: wb.Figure) -> wb.Problem:
        scene = wb.Scene(figure).add(wb.Box((0.3, 1.2, 0.03)), name="table", at=(0.50, 0.0, self.value + 0.015))
        return wb.Problem(scene, "sitting", constraints=[wb.Freeze("root", *figure.joints)])

    def _acromial_height(self, figure: wb.Figure) -> wb.Problem:
        scene = wb.Scene(figure)
        for name, y in (("left beam", 0.2), ("right beam", -0.2)):
            scene.add(wb.Box((0.5, 0.16, 0.05)), name=name, at=(0.0, y, self.value + 0.025))
        return wb.Problem(scene, constraints=[wb.Freeze("root", *figure.joints)])


CRITERIA = (
    Criterion("thigh_clearance", 0.185),
    Criterion("hip_breadth_sitting", 0.4405),
    Criterion("popliteal_height", 0.4105, most=False),
    Criterion("buttock_knee_length", 0.6105),
    Criterion("sitting_height", 0.9005),
    Criterion("eye_height_sitting", 0.7705, most=False, sees=(10.0, 0.0, HIGH + 0.7705)),
    Criterion("overhead_reach_sitting", 1.3605, most=False),
    Criterion("thumb_tip_reach", 0.7705, most=False),
    Criterion("stature", 1.7205),
    Criterion("knee_height_sitting", 0.5405),
    Criterion("acromial_height", 1.4005),
)
"""Those that judge `wb.accommodation`; the table is in whole millimetres."""


def right(criterion: Criterion, given: Mapping[str, Any]) -> tuple[int, int]:
    """How many of some people are judged as their bodies' dimension says, and how many there are."""
    found = wb.accommodation(criterion, given, sees=criterion.sees)
    names = [one.factors["person"] for one in found.records if one.factors]
    bodies = [_body(given[name], criterion.dimension) for name in names]
    return sum(good == criterion.passes(body) for good, body in zip(found.accommodated, bodies, strict=True)), len(
        names
    )


def _body(given: Mapping[str, Any], dimension: str) -> float:
    """A dimension of somebody's body, metres."""
    return float(given["stature"]) if dimension == "stature" else measure(wb.load("human", **given))[dimension]


def main(path: Path, count: int = 200, solved: int = 12) -> None:
    """Print how people are judged, and the shares."""
    for sex in ("male", "female"):
        kept, rest = (rows_of(path, kept_back=one)[sex] for one in (True, False))
        given = wb.people(count, sex)
        bodies = [measure(wb.load("human", **one)) | {"stature": one["stature"]} for one in given.values()]
        for criterion in CRITERIA:
            name = criterion.dimension
            share = float(np.mean([criterion.passes(body[name]) for body in bodies]))
            back, all_of = (
                float(np.mean(criterion.passes(one))) for one in (kept[name], np.append(kept[name], rest[name]))
            )
            few = dict(list(given.items())[:solved])
            good, number = right(criterion, few)
            told = f"{share:.3f}, table {all_of:.3f}, kept back {back:.3f}; {good} of {number} judged as measured"
            sys.stdout.write(f"{sex} {name}: {told}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
