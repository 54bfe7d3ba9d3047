"""Pictures of hard cases: the figure at the start, transparent, and an answer, by the viewer and a headless browser."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.files import Scratch
from wholebody.bench.suite.stability.asking import Cell
from wholebody.bench.suite.stability.case import Answer, HardCase, Nonsense, Stream
from wholebody.bench.suite.stability.verdict import Result
from wholebody.geometry.pieces import box_corners
from wholebody.problem import Problem
from wholebody.tasks import Point
from wholebody.view import Viewer
from wholebody.view.screenshot import Screenshots
from wholebody.view.style import LOOK

SIZE = (560, 420)  # pixels
ROOM = 1.0  # times the radius of what is to be seen
SAME = 1e-3  # rad: postures nearer than this are drawn once
QUALITY = 82  # of the JPEG; such pictures are 10 to 30 kB
MOST_FAILURES = 2  # pictures of failing answers of one case


Drawn = dict[str, list[tuple[Path, str]]]
"""Paths and captions of pictures, by the case's name."""


def shown(result: Result) -> list[tuple[HardCase, str]]:
    """Cases, each with a method whose answer is drawn: the first of the best kind, and those that fail."""
    return [
        (case, method) for case in result.cases for method in (_best(case, result), *_failing(case, result)) if method
    ]


def draw(
    result: Result, cells: Mapping[tuple[str, str], Cell], folder: Path, progress: Callable[[], None] = lambda: None
) -> Drawn:
    """Draw a picture of each case into a folder, and of answers that fail; a case's own picture comes first.

    Answers that are not among the cells are not drawn.

    Raises:
        MissingPackageError: there is no Chromium.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.jpg"):
        old.unlink()
    screenshots = Screenshots()
    drawn: Drawn = {}
    try:
        for case in result.cases:
            drawn[case.name] = _case(case, result, cells, folder, screenshots)
            progress()
    finally:
        screenshots.close()
    return drawn


def _case(
    case: HardCase, result: Result, cells: Mapping[tuple[str, str], Cell], folder: Path, screenshots: Screenshots
) -> list[tuple[Path, str]]:
    found = []
    best = _best(case, result)
    if best is None:
        found.append((_picture(case, None, None, folder / f"{case.name}.jpg", screenshots), "As it begins."))
    elif (case.name, best) in cells:
        before = "the frame before" if isinstance(case.question(), Stream) else "the start"
        path, answer = folder / f"{case.name}.jpg", cells[case.name, best].answer
        caption = f"The answer of {best}; transparent, {before}."
        found.append((_picture(case, answer, None, path, screenshots), caption))
    for number, method in enumerate(_failing(case, result), start=1):
        if (case.name, method) in cells:
            cell, path = cells[case.name, method], folder / f"{case.name}-wrong-{number}.jpg"
            caption = f"{method}: {result.verdicts[case.name, method].figure}."
            found.append((_picture(case, cell.answer, cell.judged.worst, path, screenshots), caption))
    return found


def _best(case: HardCase, result: Result) -> str | None:
    """The first method with the best kind of answer that has a posture."""
    for kind in ("solved", "honest"):
        for method in result.methods:
            row = result.rows[case.name, method]
            if row.verdict == kind and row.frames:
                return method
    return None


def _failing(case: HardCase, result: Result) -> list[str]:
    """Methods with a wrong answer that can be drawn, one of each family, as many as are drawn."""
    found: dict[str, str] = {}
    for method in result.methods:
        row = result.rows[case.name, method]
        if row.verdict == "wrong" and row.frames and np.isfinite(row.goal_error):
            found.setdefault(method.partition("/")[0], method)
    return list(found.values())[:MOST_FAILURES]


def _picture(case: HardCase, answer: Answer | None, index: int | None, path: Path, screenshots: Screenshots) -> Path:
    """Draw one posture of an answer; the one that the case wants shown where `index` is None."""
    question = (case.drawn or case.question)()
    problem = question.problem
    if index is None:
        index = question.shown % len(question.frames) if isinstance(question, Stream) else 0
    start = problem.scene.figure.clamp(problem.start)
    q = start if answer is None else answer.postures[index]
    before = start
    if isinstance(question, Stream):
        _set_scene(problem, question, index)
        if answer is not None and index > 0:
            before = answer.postures[index - 1]
    if isinstance(question, Nonsense):
        before = q
    path.write_bytes(_jpeg(screenshots.page(_page(case, problem, q, before), SIZE)))
    return path


def _set_scene(problem: Problem, question: Stream, index: int) -> None:
    """Put the goal and the things where they are in a frame."""
    first = problem.goals[0]
    assert isinstance(first, Point)
    for frame in question.frames[: index + 1]:
        for name, place in frame.moved.items():
            problem.scene.move(name, at=place)
    problem.retarget([Point(first.frame, question.frames[index].target)])


def _page(case: HardCase, problem: Problem, q: Array, before: Array) -> str:
    """The page that shows a posture, with another one transparent."""
    shown = [q] if np.abs(q - before).max() <= SAME else [q, before]
    with Viewer(problem.scene, see_through=case.see_through) as viewer, Scratch() as folder:
        viewer.ghosts(shown[1:])
        viewer.look(*_camera(problem, shown, np.array(case.eye)))
        viewer.show(q, problem=problem)
        return viewer.save(folder / "scene.html").read_text(encoding="utf-8")


def _camera(problem: Problem, shown: list[Array], way: Array) -> tuple[Array, Array]:
    """Eye and target (3,), from as far away as it takes to see the figure, its goals, and what is near."""
    scene, points = problem.scene, []
    for q in shown:
        state = scene.state(q)
        pieces, placed = scene.geometry.geometryObjects, pin.GeometryData(scene.geometry)
        pin.updateGeometryPlacements(scene.model, state.data, scene.geometry, placed)
        for piece, place in zip(pieces, placed.oMg, strict=True):
            if piece.parentJoint:
                points += [place.act(corner) for corner in box_corners(piece.geometry)]
        points += [np.array(goal.target) for goal in problem.goals if isinstance(goal, Point)]
    cloud = np.array(points)
    target = (cloud.min(axis=0) + cloud.max(axis=0)) / 2.0
    radius = float(np.linalg.norm(cloud - target, axis=1).max()) * ROOM
    return target + radius / np.sin(np.radians(LOOK.field_of_view) / 2.0) * way / np.linalg.norm(way), target


def _jpeg(png: bytes) -> bytes:
    from PIL import Image

    written = io.BytesIO()
    Image.open(io.BytesIO(png)).convert("RGB").save(written, "JPEG", quality=QUALITY, optimize=True)
    return written.getvalue()
