"""Thirteen everyday tasks of a person, each solved by qp with the terms that a person has by default."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.measuring import measure
from wholebody.base.arrays import Array

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure
    from wholebody.problem import Problem
    from wholebody.scene.scene import Scene

UP, DOWN, FRONT, LEFT, RIGHT = (0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 1, 0), (0, -1, 0)
WOOD = (0.60, 0.48, 0.36, 1.0)
KEPT = -1e-3
"""Least value of a range of motion's row that counts as kept, radians."""

ON_SEAT = 0.01
"""Metres above a seat up to which a point of pelvis or thighs rests on it: flesh yields by as much."""

BEHIND_KNEE = 0.035
"""Metres that a seat ends behind the hollow of the knee: ESTIMATE."""

LEG = 0.04
"""Thickness of the legs of stool and desk, metres."""

SIZE = (360, 400)
"""Pixels of a task's picture."""


@dataclass(frozen=True)
class TaskRow:
    """What became of one task.

    Attributes:
        task: its name.
        status: of the solution.
        seconds: CPU time of the solve.
        ranges: least value of all ranges of motion, degrees; negative beyond one.
        balance: least distance of the centre of mass from the edges of what carries the person, mm, negative outside:
            the feet's polygon, with pelvis and thighs where they are on a seat.
        miss: largest distance of a point from its goal, mm.
        hips, knees, spine: largest flexion of a hip and a knee, and the spine's in total, degrees.
        picture: its file's name.
    """

    task: str
    status: str
    seconds: float
    ranges: float
    balance: float
    miss: float
    hips: float
    knees: float
    spine: float
    picture: str

    @property
    def plausible(self) -> bool:
        """Whether it is solved within the ranges of motion, and the centre of mass is above the feet."""
        return self.status == "solved" and np.radians(self.ranges) >= KEPT and self.balance >= -0.1


def tasks(figure: Figure) -> dict[str, Callable[[], Problem]]:
    """Return the tasks by name: functions that state the problem for a person of about the median man's size.

    Places scale with the person's stature.
    """
    import wholebody as wb

    high = float(figure.placement(figure.posture("standing"), "head_top").translation[2])
    scale = high / 1.755
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]

    def at(x: float, y: float, z: float) -> Array:
        return scale * np.array([x, y, z])

    def room() -> wb.Scene:
        return wb.Scene(figure).add(wb.HalfSpace(), name="floor")

    def point(frame: str, x: float, y: float, z: float, look: bool = True, **added: Any) -> Problem:
        place = at(x, y, z)
        goals: list[Any] = [wb.Point(frame, place)]
        if look:
            goals.append(wb.Axis("gaze", FRONT, toward=place, weight=0.02))
        return wb.Problem(room(), goals=goals, constraints=feet, **added)

    def box_from_the_floor() -> Problem:
        scene = room()
        scene.add(wb.Box(tuple(at(0.30, 0.30, 0.25))), name="box", at=at(0.42, 0.0, 0.1255), color=WOOD)
        goals = [
            wb.Point("left_palm", at(0.42, 0.1505, 0.16)),
            wb.Point("right_palm", at(0.42, -0.1505, 0.16)),
            wb.Axis("left_palm", UP, direction=RIGHT, weight=0.1),
            wb.Axis("right_palm", UP, direction=LEFT, weight=0.1),
        ]
        return wb.Problem(scene, goals=goals, constraints=feet)

    def typing() -> Problem:
        scene, q = room(), figure.posture("sitting")
        top = add_seat(scene, figure, q) + 0.27 * scale
        _add_on_legs(scene, "desk", (0.7 * scale, 1.2 * scale, 0.03), (0.62 * scale, 0.0, top - 0.015))
        goals: list[Any] = [
            wb.Point(f"{side}_index_tip", (0.42 * scale, sign * 0.06 * scale, top + 0.02)) for side, sign in _SIDES
        ]
        goals += [wb.Axis(f"{side}_palm", UP, direction=DOWN, weight=0.01) for side, _ in _SIDES]
        goals.append(wb.Axis("gaze", FRONT, toward=(0.75 * scale, 0.0, top + 0.3), weight=0.02))
        return wb.Problem(scene, start=q, goals=goals, constraints=[wb.Hold("pelvis"), *feet])

    def door() -> Problem:
        scene = room()
        scene.add(wb.Box(tuple(at(0.04, 0.9, 2.0))), name="door", at=at(0.52, 0.0, 1.001), color=WOOD)
        goals = []
        for side, sign in _SIDES:
            goals += [
                wb.Point(f"{side}_palm", at(0.4995, sign * 0.2, 1.30)),
                wb.Axis(f"{side}_palm", UP, direction=FRONT, weight=0.1),
            ]
        return wb.Problem(scene, goals=goals, constraints=feet)

    def shoulder() -> Problem:
        goals = [wb.Axis("gaze", FRONT, direction=(-0.77, 0.64, 0.0))]
        return wb.Problem(room(), goals=goals, constraints=feet)

    def shoe() -> Problem:
        goals: list[Any] = [
            wb.Point(f"{side}_index_tip", at(0.12, -0.085 + sign * 0.035, 0.115)) for side, sign in _SIDES
        ]
        goals.append(wb.Axis("gaze", FRONT, toward=at(0.12, -0.085, 0.1), weight=0.01))
        return wb.Problem(room(), goals=goals, constraints=feet)

    def sit() -> Problem:
        scene, height = room(), 0.43 * scale
        _add_on_legs(scene, "seat", at(0.42, 0.5, 0.04), (-0.42 * scale, 0.0, height - 0.02 * scale))
        goals = [wb.Sit("seat"), wb.Axis("thorax", UP, direction=UP, weight=0.05)]
        return wb.Problem(scene, goals=goals, constraints=feet)

    def mouth() -> Problem:
        face = figure.placement(figure.neutral, "gaze")
        head = figure.placement(figure.neutral, "head")
        place = head.actInv(face.translation) + scale * np.array([0.012, 0.0, -0.068])
        goal = wb.Relative("right_index_tip", "head", place, orientation=False)
        return wb.Problem(room(), goals=[goal], constraints=feet)

    def overhead() -> Problem:
        goals = [wb.Point(f"{side}_index_tip", at(0.15, sign * 0.15, 2.15)) for side, sign in _SIDES]
        return wb.Problem(room(), goals=goals, constraints=feet)

    return {
        "reach high": lambda: point("right_index_tip", 0.30, -0.25, 2.05),
        "reach low": lambda: point("right_index_tip", 0.45, -0.20, 0.30),
        "reach to the side": lambda: point("right_index_tip", 0.0, -1.0, 1.20),
        "reach behind": lambda: point("right_index_tip", -0.45, -0.40, 1.10),
        "box from the floor": box_from_the_floor,
        "typing": typing,
        "push a door": door,
        "look over the shoulder": shoulder,
        "tie a shoe": shoe,
        "sit down": sit,
        "hand to mouth": mouth,
        "both hands overhead": overhead,
        "reach across": lambda: point("left_index_tip", 0.45, -0.50, 1.10),
    }


_SIDES = (("left", 1.0), ("right", -1.0))


def _underside(figure: Figure, sizes: Mapping[str, float]) -> float:
    """Height of the lowest point of pelvis and thighs below the pelvis' frame, thighs level, negative."""
    q = figure.with_joints(figure.neutral, {})
    vertex = figure.placement(q, "head_top").translation[2] - figure.placement(q, "pelvis").translation[2]
    return float(vertex - sizes["sitting_height"])


def add_seat(scene: Scene, figure: Figure, q: Array) -> float:
    """Put a stool below pelvis and thighs of who sits, no deeper than the thighs are long; return its top's height."""
    import wholebody as wb

    sizes, pelvis = measure(figure), figure.placement(q, "pelvis").translation
    top = float(pelvis[2]) + _underside(figure, sizes) - 0.001
    shank = sizes["buttock_knee_length"] - sizes["buttock_popliteal_length"]
    hollow = float(figure.placement(q, "right_knee").translation[0]) - 0.5 * shank  # of the knee
    back, front = float(pelvis[0]) - 0.11, min(float(pelvis[0]) + 0.31, hollow - BEHIND_KNEE)
    size, middle = (front - back, 0.5, 0.04), 0.5 * (front + back)
    alone = wb.Scene(figure).add(wb.Box(size), name="seat", at=(middle, 0.0, top - 0.02))
    lower = float(alone.contacts(q, within=0.001).distance.min(initial=0.001)) - 0.001  # thighs of the heavy hang
    _add_on_legs(scene, "seat", size, (middle, 0.0, top + lower - 0.02))
    return top + lower


def _add_on_legs(scene: Scene, name: str, size: Sequence[float] | Array, at: tuple[float, float, float]) -> None:
    """Put a board with four legs on the floor at zero height, as a stool or a desk is.

    Args:
        scene: where it is put.
        name: of the board.
        size: (3,) full lengths of the board, metres.
        at: its centre, metres.
    """
    import wholebody as wb

    deep, wide, thick = map(float, size)
    scene.add(wb.Box((deep, wide, thick)), name=name, at=at, color=WOOD)
    high = at[2] - 0.5 * thick
    for end, x in (("front", 1.0), ("back", -1.0)):
        for side, y in _SIDES:
            foot = at[0] + 0.5 * x * (deep - LEG), at[1] + 0.5 * y * (wide - LEG), 0.5 * high
            scene.add(wb.Box((LEG, LEG, high)), name=f"{name}'s {side} {end} leg", at=foot, color=WOOD)


def solve_task(name: str, problem: Problem, pictures: Path | None) -> tuple[TaskRow, Array]:
    """Solve a task, judge the posture, and draw it.

    Args:
        name: of the task.
        problem: the task.
        pictures: folder for its picture; None for no picture.

    Returns:
        What became of it, and the posture (nq,).
    """
    import wholebody as wb
    from wholebody.figures.state import State

    began = time.process_time()
    solution = wb.solve(problem)
    seconds = time.process_time() - began
    scene, q = problem.scene, solution.q
    state = State(scene.model).update(q)
    ranges = wb.tasks.RangeOfMotion().resolve(scene, problem.start).value(state)
    balance = 1e3 * _margin(scene, q)
    figure: Any = scene.figure
    angles: Mapping[str, float] = figure.joint_values(q)
    misses = [
        float(np.linalg.norm(g.error(state)[:3])) for g in problem.goals if isinstance(g, (wb.Point, wb.Relative))
    ]
    picture = f"{name.replace(' ', '_')}.png"
    if pictures is not None:
        draw(problem.scene, q, pictures / picture)
    row = TaskRow(
        task=name,
        status=str(solution.status),
        seconds=seconds,
        ranges=float(np.degrees(ranges.min())),
        balance=balance,
        miss=1e3 * max(misses, default=0.0),
        hips=_largest(angles, "hip_flexion"),
        knees=_largest(angles, "knee_flexion"),
        spine=float(np.degrees(sum(v for j, v in angles.items() if j.startswith("spine") and j.endswith("flexion")))),
        picture=picture,
    )
    return row, q


def _margin(scene: Any, q: Array) -> float:
    """Least distance of the centre of mass from the edges of what carries the person, metres, negative outside."""
    import pinocchio as pin
    from scipy.spatial import ConvexHull

    from wholebody.tasks.balance import DOWN, standing_points
    from wholebody.tasks.surfaces import outermost

    points = [standing_points(scene, q, ("left_foot", "right_foot"))]
    data, placed = scene.model.createData(), pin.GeometryData(scene.geometry)
    center = pin.centerOfMass(scene.model, data, q)
    if "seat" in scene.objects:
        seat = scene.objects["seat"]
        middle, half = np.asarray(seat.placement.translation), 0.5 * np.asarray(seat.shape.size)
        pin.updateGeometryPlacements(scene.model, data, scene.geometry, placed, q)
        for owner, piece, place in zip(scene.piece_owner, scene.geometry.geometryObjects, placed.oMg, strict=True):
            if owner in ("pelvis", "left_thigh", "right_thigh"):
                lows = outermost(piece.geometry, place, DOWN)
                on = (lows[:, 2] < middle[2] + half[2] + ON_SEAT) & (np.abs(lows - middle)[:, :2] < half[:2]).all(1)
                points.append(lows[on])
    hull = ConvexHull(np.vstack(points)[:, :2])
    return -float((hull.equations[:, :2] @ center[:2] + hull.equations[:, 2]).max())


def _largest(angles: Mapping[str, float], ending: str) -> float:
    return float(np.degrees(max(value for joint, value in angles.items() if joint.endswith(ending))))


def draw(scene: Scene, q: Array, path: Path) -> None:
    """Draw a posture from its front right into a file; a door is see-through."""
    from wholebody.view import Viewer

    glass = [name for name in scene.objects if name == "door"]
    with Viewer(scene, contact_distance=-1.0, see_through=glass) as viewer:
        viewer.show(q)
        viewer.look((3.5, -2.9, 1.9), (0.05, 0.0, 1.08))
        viewer.picture(path, SIZE, legend=False)
    _smaller(path)


def _smaller(path: Path) -> None:
    """Reduce a picture to 256 colours, which is half of its bytes."""
    from PIL import Image

    Image.open(path).convert("RGB").quantize(256).save(path, optimize=True)
