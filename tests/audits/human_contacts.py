"""Contacts of the body with itself that people make every day: whether two parts meet, or the gap that remains."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from tests.audits.human_tasks import add_seat, draw
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.things import coal_distance
from wholebody.figures.human.details import SPREAD

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure

TOUCHING = 5.0
"""mm: parts nearer than this touch."""


STILL = ("spine", "neck")
"""Parts that rest while legs are crossed."""


@dataclass(frozen=True)
class ContactRow:
    """One contact.

    Attributes:
        contact: its name.
        status: of the solve that brings the parts together; "measured" where a posture alone was measured.
        gap: distance that remains between the two parts, mm; the larger one where there are two.
    """

    contact: str
    status: str
    gap: float

    @property
    def drawn(self) -> bool:
        """Whether it has a picture: all have that are made by the body alone."""
        return self.contact not in ("palm flat on a table", "thighs on the seat")

    @property
    def picture(self) -> str:
        """Its file's name."""
        return f"{self.contact.replace(' ', '_')}.png"

    @property
    def reached(self) -> bool:
        """Whether the parts touch."""
        return self.gap < TOUCHING


def contacts(figure: Figure, pictures: Path | None = None) -> list[ContactRow]:
    """Make every contact.

    The parts are asked to touch, or a frame to be on the other part. Legs are crossed by a goal inside the other thigh,
    as near as they come, with all else at rest. An ankle is laid on several places of the other thigh; the first one
    that it touches counts.

    Args:
        figure: the person.
        pictures: folder for a picture of each contact; None draws none.
    """
    import wholebody as wb

    chair = figure.posture("sitting")
    size = float(figure.placement(figure.posture("standing"), "head_top").translation[2])

    def near(frame: str, to: str, x: float, y: float, z: float) -> Any:
        return wb.Relative(frame, to, size * np.array([x, y, z]), orientation=False)

    thigh = float(np.linalg.norm(_origin(figure, "left_shank") - _origin(figure, "left_thigh"))) / size
    solves: list[tuple[str, Any, list[Any], list[tuple[str, str]]]] = [
        (
            "folded arms",
            "standing",
            [
                wb.Touch("right_hand", "left_upper_arm"),
                wb.Touch("left_hand", "right_upper_arm"),
            ],
            [("right_hand", "left_upper_arm"), ("left_hand", "right_upper_arm")],
        ),
        ("hand on hip", "standing", [wb.Touch("right_palm", "pelvis")], [("right_hand", "pelvis")]),
        (
            "hand behind the head",
            "standing",
            [near("right_palm", "head", -0.05, -0.01, 0.05)],
            [("right_hand", "head")],
        ),
        (
            "palms together",
            "standing",
            [
                wb.Touch("right_palm", "left_hand"),
                wb.Axis("right_palm", (0, 0, 1), direction=(0, 1, 0)),
                wb.Axis("left_palm", (0, 0, 1), direction=(0, -1, 0)),
            ],
            [("right_hand", "left_hand")],
        ),
        (
            "hand in the back pocket",
            "standing",
            [near("right_palm", "pelvis", -0.09, -0.05, 0.0)],
            [("right_hand", "pelvis")],
        ),
        (
            "hand on the other shoulder",
            "standing",
            [wb.Touch("right_palm", "left_upper_arm:0")],
            [("right_hand", "left_upper_arm")],
        ),
        (
            "fingertip to the nose",
            "standing",
            [near("right_index_tip", "gaze", 0.0, 0.0, -0.025)],
            [("right_hand", "head")],
        ),
        *(
            (
                "ankle on knee",
                chair,
                [near("right_ankle", "left_thigh", 0.057, y, -z * thigh)],
                [("right_shank", "left_thigh")],
            )
            for z in (0.9, 0.75)
            for y in (0.0, 0.03)
        ),
        (
            "knee over knee",
            chair,
            [near("right_knee", "left_thigh", 0.075, 0.02, -0.92 * thigh)],
            [("right_thigh", "left_thigh")],
        ),
    ]
    found: dict[str, ContactRow] = {}
    shown: dict[str, tuple[Any, Array]] = {}
    for name, start, goals, parts in solves:
        seated = start is chair
        kept = [wb.Hold("pelvis")] if seated else [wb.Hold("left_foot"), wb.Hold("right_foot")]
        kept += [wb.Hold("left_foot")] if seated else []
        scene = wb.Scene(figure)
        still = [wb.Freeze(part) for part in STILL] if seated else []
        if seated:
            add_seat(scene, figure, chair)
        if name == "hand on the other shoulder":
            still = [wb.Freeze("left_arm")]
        solution = wb.solve(wb.Problem(scene, start=start, goals=goals, constraints=[*kept, *still]))
        gap = max(distance(figure, solution.q, [one], [other]) for one, other in parts)
        row = ContactRow(name, str(solution.status), 1e3 * max(gap, 0.0))
        if name not in found or (not found[name].reached and row.gap < found[name].gap):
            found[name] = row
            shown[name] = scene, solution.q
    if pictures is not None:
        for name, (scene, q) in shown.items():
            draw(scene, q, pictures / found[name].picture)
    return [*found.values(), _palm_on_table(figure), _thighs_on_seat(figure)]


def distance(figure: Figure, q: Array, first: Collection[str], second: Collection[str]) -> float:
    """Least distance between the pieces of two groups of segments, metres, negative inside; whether tested or not."""
    pieces = _placed(figure, q)
    apart = (
        coal_distance(a.geometry, at, b.geometry, where)
        for a, at in _of(pieces, first)
        for b, where in _of(pieces, second)
    )
    return min(apart, default=np.inf)


def _placed(figure: Figure, q: Array) -> list[tuple[Any, Any]]:
    """The pieces of a figure with their placements at a posture (nq,)."""
    data, placed = figure.model.createData(), pin.GeometryData(figure.geometry)
    pin.updateGeometryPlacements(figure.model, data, figure.geometry, placed, q)
    return list(zip(figure.geometry.geometryObjects, placed.oMg, strict=True))


def _of(pieces: Sequence[tuple[Any, Any]], segments: Collection[str]) -> list[tuple[Any, Any]]:
    """The pieces of segments, but for the flesh that meets things only."""
    own = [(piece, place) for piece, place in pieces if piece.name.partition(":")[0] in segments]
    return [(piece, place) for piece, place in own if not piece.name.endswith(f"_thigh:{SPREAD}")]


def _origin(figure: Figure, segment: str) -> Array:
    return np.asarray(figure.placement(figure.neutral, segment).translation)


def _palm_on_table(figure: Figure) -> ContactRow:
    """A palm laid flat on a table: height of its skin above the top, and how far the hand is from level."""
    import wholebody as wb

    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    height = 0.43 * float(figure.placement(figure.posture("standing"), "head_top").translation[2])
    scene.add(wb.Box((0.6, 1.2, 0.04)), name="table", at=(0.62, 0.0, height - 0.02))
    goals = [wb.Point("right_palm", (0.50, -0.25, height)), wb.Axis("right_palm", (0, 0, 1), direction=(0, 0, -1))]
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    solution = wb.solve(wb.Problem(scene, goals=goals, constraints=feet))
    palm = figure.placement(solution.q, "right_palm")
    tilt = np.arccos(np.clip(-palm.rotation[2, 2], -1.0, 1.0))
    gap = abs(float(palm.translation[2]) - height) + 0.1 * float(np.sin(tilt))  # at the hand's end
    return ContactRow("palm flat on a table", str(solution.status), 1e3 * gap)


def _thighs_on_seat(figure: Figure) -> ContactRow:
    """Upright on a level seat that carries the pelvis: the gap below the thighs, or below the pelvis."""
    from wholebody.figures.postures import support

    bend = {f"{side}_{joint}_flexion": 0.5 * np.pi for side in ("left", "right") for joint in ("hip", "knee")}
    q = figure.with_joints(pin.neutral(figure.model), bend)
    pieces = _placed(figure, q)
    down = np.array([0.0, 0.0, -1.0])
    pelvis, thighs = (
        max(support(piece.geometry, place, down) for piece, place in _of(pieces, segments))
        for segments in (["pelvis"], ["left_thigh", "right_thigh"])
    )
    return ContactRow("thighs on the seat", "measured", 1e3 * abs(pelvis - thighs))
