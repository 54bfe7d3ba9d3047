"""The challenge of Choi and Cremer 1999, figure 1: a standing person is dragged down onto a chair by the pelvis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.audits.templates import TEMPLATES
from wholebody.bench.measure.drag import DragFrameRow, DragRow, drag_frames, drag_summary
from wholebody.bench.report import render
from wholebody.problem import Problem
from wholebody.taskfile import read_task
from wholebody.tracking.dragging import Dragged, drag_along, judge_drag, present_position
from wholebody.tracking.paths import read_path, spread

TASK = "sit_on_chair"
METHODS = ("newton", "qp")


@dataclass(frozen=True)
class ChallengeRow(DragRow):
    """One method; distances are those of the last posture, millimetres.

    Attributes:
        seat_mm: from the pelvis to the seat.
        back_mm: from the thorax to the backrest.
        feet_mm: farthest that a sole is from where it stood, in any posture.
    """

    seat_mm: float
    back_mm: float
    feet_mm: float


def measure(
    task: Path, frames: int, say: Callable[[str], None]
) -> tuple[list[ChallengeRow], dict[str, list[DragFrameRow]]]:
    """Drag by each method; a row each, and the rows of all frames by method.

    The task is sit_on_chair.toml, with its path beside it; `say` takes a line about each method.
    """
    problem = read_task(task).problem
    places = spread(np.vstack([present_position(problem), read_path(task.with_suffix(".csv"))]), frames)
    rows, every = [], {}
    for method in METHODS:
        dragged = drag_along(problem, places, method)
        judged = judge_drag(problem, dragged)
        rows.append(_row(problem, dragged, drag_summary(TASK, dragged, judged)))
        every[dragged.method] = drag_frames(TASK, dragged, judged)
        say(f"{rows[-1].method}: {rows[-1].mean_ms:.1f} ms a frame, {rows[-1].seat_mm:.2f} mm over the seat")
    return rows, every


def report(rows: Sequence[ChallengeRow], facts: Mapping[str, str]) -> str:
    """The table as Markdown."""
    return render("challenge.md", TEMPLATES, rows=rows, facts=facts)


def _row(problem: Problem, dragged: Dragged, row: DragRow) -> ChallengeRow:
    return ChallengeRow(
        **vars(row),
        seat_mm=1e3 * _apart(problem, dragged, "pelvis", "seat"),
        back_mm=1e3 * _apart(problem, dragged, "thorax", "backrest"),
        feet_mm=1e3 * _drift(problem, dragged),
    )


def _apart(problem: Problem, dragged: Dragged, segment: str, thing: str) -> float:
    """Distance of a segment to a thing in the last posture, metres."""
    contacts, owner = problem.scene.contacts(dragged.q[-1], within=0.2), problem.scene.piece_owner
    found = [
        float(distance)
        for pair, distance in zip(contacts.pair, contacts.distance, strict=True)
        if {owner[piece] for piece in pair} == {segment, thing}
    ]
    return min(found, default=np.inf)


def _drift(problem: Problem, dragged: Dragged) -> float:
    """Farthest that a sole is from where it began, metres."""
    figure, soles = problem.scene.figure, ("left_sole", "right_sole")
    places = np.array([[figure.placement(q, sole).translation for sole in soles] for q in dragged.q])
    return float(np.linalg.norm(places - places[0], axis=2).max())
