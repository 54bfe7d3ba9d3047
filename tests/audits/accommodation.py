"""Criteria of one dimension or two, solved for people: `python -m tests.audits.accommodation ansur2.csv`.

Each scene has a thing in the way of a dimension of people who stand or sit as they are measured. Whoever is solved
is compared with the own body's dimension, and the share of a population on the right side with that of the table.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import wholebody as wb
from tests.audits.population import people as rows_of
from tests.measuring import measure
from wholebody.base.errors import WholebodyError
from wholebody.figures.anthropometry import dimension_names

HIGH = 0.6
"""Height of the seat, metres."""

SIT = wb.Sit(on="seat", back="back", erect=True)

KNEES = wb.Freeze("left_knee_flexion", "right_knee_flexion")

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

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Its name alone."""
        return (self.dimension,)

    def passes_all(self, of: Mapping[str, Any]) -> Any:
        """Whether people with these dimensions, metres, are to pass."""
        return self.passes(of[self.dimension])

    def __call__(self, figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
        """The task."""
        own = getattr(self, f"_{self.dimension}", None)
        made: wb.Problem = _on_seat(figure, (self,)) if own is None else own(figure)
        return made

    def beside(self, scene: wb.Scene) -> list[Any]:
        """Put what is in the way of somebody on the seat into a scene; constraints beside sitting."""
        found: list[Any] = getattr(self, f"_by_{self.dimension}")(scene)
        return found

    def _by_thigh_clearance(self, scene: wb.Scene) -> list[Any]:
        # from 0.32 m on: in front of bellies, which would meet it, and where thighs are as thick as measured
        scene.add(wb.Box((0.6, 1.2, 0.03)), name="desk", at=(0.62, 0.0, HIGH + self.value + 0.015))
        return []

    def _by_hip_breadth_sitting(self, scene: wb.Scene) -> list[Any]:
        for name, side in (("left rest", 1.0), ("right rest", -1.0)):
            scene.add(wb.Box((0.3, 0.04, 0.18)), name=name, at=(0.2, side * (0.5 * self.value + 0.02), HIGH + 0.091))
        return []

    def _by_buttock_knee_length(self, scene: wb.Scene) -> list[Any]:
        scene.add(wb.Box((0.04, 1.2, 0.24)), name="panel", at=(self.value + 0.02, 0.0, HIGH + 0.08))
        return [KNEES]

    def _by_sitting_height(self, scene: wb.Scene) -> list[Any]:
        scene.add(wb.Box((0.8, 1.0, 0.05)), name="roof", at=(0.2, 0.0, HIGH + self.value + 0.025))
        return []

    def _by_eye_height_sitting(self, scene: wb.Scene) -> list[Any]:
        scene.add(wb.Box((0.05, 2.0, 0.4)), name="board", at=(1.5, 0.0, HIGH + self.value - 0.2))
        return []

    def _by_overhead_reach_sitting(self, scene: wb.Scene) -> list[Any]:
        return [wb.Plane("left_middle_tip", (0, 0, 1), point=(0.0, 0.0, HIGH + self.value), side="above")]

    def _by_thumb_tip_reach(self, scene: wb.Scene) -> list[Any]:
        return [GIRDLE, wb.Plane("left_thumb_tip", (1, 0, 0), point=(self.value, 0.0, 0.0), side="above")]

    def _by_popliteal_height(self, scene: wb.Scene) -> list[Any]:
        scene.add(wb.HalfSpace(offset=HIGH - self.value), name="footrest")
        return [wb.Stand(on="footrest", balance=False)]

    def _popliteal_height(self, figure: wb.Figure) -> wb.Problem:
        scene = _seated(figure, 0.36, self.value).add(wb.HalfSpace(), name="floor")
        return wb.Problem(scene, "sitting", constraints=[SIT, wb.Stand(on="floor", balance=False)])

    def _buttock_popliteal_length(self, figure: wb.Figure) -> wb.Problem:
        return wb.Problem(_seated(figure, self.value, thick=0.03), "sitting", constraints=[SIT, KNEES])

    def _hip_breadth(self, figure: wb.Figure) -> wb.Problem:
        out = {f"{side}_shoulder_abduction": 1.5 for side in ("left", "right")}
        q, scene = figure.with_joints(figure.neutral, out), wb.Scene(figure)
        high = float(figure.placement(q, "pelvis").translation[2])
        for name, side in (("left rail", 1.0), ("right rail", -1.0)):
            scene.add(wb.Box((0.6, 0.04, 0.4)), name=name, at=(0.0, side * (0.5 * self.value + 0.02), high))
        return wb.Problem(scene, q, constraints=[wb.Freeze("root", *figure.joints)])

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

    def _foot_length(self, figure: wb.Figure) -> wb.Problem:
        heel = float(figure.placement(figure.posture("standing"), "left_heel").translation[0])
        scene = wb.Scene(figure)
        for name, x in (("heel board", heel - 0.0205), ("toe board", heel + self.value + 0.02)):
            scene.add(wb.Box((0.04, 1.0, 0.2)), name=name, at=(x, 0.0, 0.1))
        return wb.Problem(scene, constraints=[wb.Freeze("root", *figure.joints)])


def _seated(figure: wb.Figure, deep: float = 0.40, high: float = HIGH, thick: float = 0.04) -> wb.Scene:
    scene = wb.Scene(figure).add(wb.Box((deep, 0.6, thick)), name="seat", at=(0.5 * deep, 0.0, high - 0.5 * thick))
    return scene.add(wb.Box((0.03, 0.6, 0.6)), name="back", at=(-0.015, 0.0, high + 0.4))


def _on_seat(figure: wb.Figure, criteria: Sequence[Criterion]) -> wb.Problem:
    scene = _seated(figure, 0.36)  # as deep as the thighs of the smallest
    terms = [term for one in criteria for term in one.beside(scene)]
    return wb.Problem(scene, "sitting", constraints=[SIT, *terms])


@dataclass(frozen=True)
class Both:
    """Two criteria of somebody on the seat at once."""

    first: Criterion
    second: Criterion

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Their names."""
        return self.first.dimension, self.second.dimension

    @property
    def sees(self) -> tuple[float, float, float] | None:
        """What has to be seen."""
        return self.first.sees or self.second.sees

    def passes_all(self, of: Mapping[str, Any]) -> Any:
        """Whether people with these dimensions, metres, are to pass both."""
        return self.first.passes_all(of) & self.second.passes_all(of)

    def __call__(self, figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
        """The task."""
        return _on_seat(figure, (self.first, self.second))


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
    Criterion("foot_length", 0.2605),
    Criterion("hip_breadth", 0.3505),
    Criterion("buttock_popliteal_length", 0.4905, most=False),
)
"""Those that judge `wb.accommodation`; the table is in whole millimetres."""

_OF = {one.dimension: one for one in CRITERIA}
PAIRS = tuple(
    Both(_OF[first], _OF[second])
    for first, second in (
        ("thigh_clearance", "hip_breadth_sitting"),
        ("thigh_clearance", "buttock_knee_length"),
        ("sitting_height", "thigh_clearance"),
        ("sitting_height", "eye_height_sitting"),
        ("overhead_reach_sitting", "hip_breadth_sitting"),
        ("thumb_tip_reach", "buttock_knee_length"),
        ("popliteal_height", "thigh_clearance"),
        ("eye_height_sitting", "thumb_tip_reach"),
    )
)
"""Those of two dimensions."""


def right(criterion: Criterion | Both, given: Mapping[str, Any]) -> tuple[int, int]:
    """How many of some people are judged as their bodies' dimensions say, and how many there are."""
    found = wb.accommodation(criterion, given, sees=criterion.sees)
    names = [one.factors["person"] for one in found.records if one.factors]
    bodies = [_body(given[name]) for name in names]
    good = sum(good == bool(criterion.passes_all(of)) for good, of in zip(found.accommodated, bodies, strict=True))
    return good, len(names)


def _body(given: Mapping[str, Any]) -> dict[str, float]:
    """The dimensions of somebody's body, metres."""
    return measure(wb.load("human", **given)) | {"stature": float(given["stature"])}


def columns(people: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """Dimensions of people as arrays."""
    return {name: np.array([one[name] for one in people]) for name in people[0]}


def bodies_of(sex: str, table: Mapping[str, Any], rows: Sequence[int]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Dimensions of people of the table, and of bodies built with these; who is refused is left out."""
    own, built = [], []
    for row in rows:
        one = {name: float(column[row]) for name, column in table.items()}
        proportions = {name: one[name] for name in dimension_names() if name in one}
        given = {"sex": sex, "stature": one["stature"], "mass": one["mass"], "proportions": proportions}
        with suppress(WholebodyError):
            built.append(_body(given))
            own.append(one)
    return columns(own), columns(built)


def main(path: Path, count: int = 2000, solved: int = 12, same: int = 150) -> None:
    """Print how people are judged, the shares of `count`, and how many bodies of `same` kept back differ from these."""
    for sex in ("male", "female"):
        kept, rest = (rows_of(path, kept_back=one)[sex] for one in (True, False))
        both = {name: np.append(column, rest[name]) for name, column in kept.items()}
        given = wb.people(count, sex)
        drawn = columns([{**one["proportions"], "stature": one["stature"]} for one in given.values()])
        own, built = bodies_of(sex, kept, np.random.default_rng(1).permutation(len(kept["age"]))[:same])
        for criterion in (*CRITERIA, *PAIRS):
            share, all_of, back = (float(np.mean(criterion.passes_all(of))) for of in (drawn, both, kept))
            differ = int((criterion.passes_all(own) != criterion.passes_all(built)).sum())
            told = f"{share:.3f}, table {all_of:.3f}, kept back {back:.3f}; {differ} of {len(own['age'])} bodies differ"
            if solved:
                good, number = right(criterion, dict(list(given.items())[:solved]))
                told += f"; {good} of {number} judged as measured"
            sys.stdout.write(f"{sex} {' and '.join(criterion.dimensions)}: {told}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
