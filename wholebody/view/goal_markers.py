"""Markers of goals, with the remaining error in words, and axes of frames: red, green and blue for x, y and z."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import distance_and_angle
from wholebody.base.arrays import Array
from wholebody.base.checks import a
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.geometry.placement import placement
from wholebody.view import drawing
from wholebody.view.scene_graph import Keyframe, Marker
from wholebody.view.style import LOOK
from wholebody.view.viewed_scene import ViewedScene

FARTHEST_LOOK = 1.0
"""Metres: what an axis is turned to is not drawn, and not kept in the picture, if it is farther from the frame."""


class Goals:
    """The resolved goals of a `wholebody.Problem`, drawn at any posture; raises InputError for what is no problem."""

    def __init__(self, scene: ViewedScene, problem: Any) -> None:
        self.scene = scene
        goals = getattr(problem, "goals", None)
        if not isinstance(goals, (tuple, list)):
            raise InputError(f"problem is {a(type(problem))}, not a Problem; state one with wb.Problem(scene)")
        self.goals = goals

    def mark(self, keyframe: Keyframe, state: State) -> None:
        """Mark each goal that has a position: target, line to it, axes of an orientation goal, the error."""
        for number, goal in enumerate(self.goals):
            root = f"{LOOK.goal_node}/{number}"
            here = self._here(goal, state)
            target, directed = _target(goal, here, state, self.scene)
            if here is None or target is None:
                continue
            if not _far(goal, here) and (
                np.linalg.norm(target.translation - here.translation) > 1e-9 or not (directed or hasattr(goal, "axis"))
            ):
                ball = Marker("ball", LOOK.target, LOOK.target_radius)
                keyframe.markers[f"{root}/target"] = (ball, drawing.point_placement(target.translation))
            line = drawing.rod_placement(here.translation, target.translation, LOOK.line_radius)
            if line is not None:
                keyframe.markers[f"{root}/line"] = (Marker("rod", LOOK.target), line)
            if directed:
                mark_axes(keyframe, f"{root}/axes", target, LOOK.axes_length)
                mark_axes(keyframe, f"{root}/frame", here, LOOK.axes_length / 2)
            self._point(keyframe, root, goal, here)
            text = f"{getattr(goal, 'frame', 'centre of mass')}  {left(goal, state)}"
            label = Marker("label", LOOK.goal_label, LOOK.label_size, text)
            keyframe.markers[f"{root}/text"] = (label, drawing.point_placement(target.translation))

    def targets(self, state: State) -> Array:
        """Positions (n, 3) that should be in the picture; on the way to what is looked at from afar."""
        found = [np.zeros((0, 3))]
        for goal in self.goals:
            target, _ = _target(goal, self._here(goal, state), state, self.scene)
            if target is not None:
                found.append(target.translation[None])
        return np.concatenate(found)

    def _here(self, goal: Any, state: State) -> pin.SE3 | None:
        """Placement of the goal's frame; None for a goal without a position."""
        name = getattr(goal, "frame", None)
        if isinstance(name, str):
            here = state.frame(self.scene.figure.frame_id(name)).copy()
            offset = np.asarray(getattr(goal, "offset", (0.0, 0.0, 0.0)), dtype=float)
            here.translation = here.act(offset)
            return here
        if hasattr(goal, "axes") and hasattr(goal, "target"):
            return pin.SE3(np.eye(3), state.center_of_mass())
        return None

    def _point(self, keyframe: Keyframe, root: str, goal: Any, here: pin.SE3) -> None:
        """The axis of a goal, and its target direction."""
        axis = getattr(goal, "axis", None)
        if axis is None:
            return
        now = here.rotation @ np.asarray(axis, dtype=float)
        wanted = _wanted(goal, here)
        blue, green = LOOK.axes[2], LOOK.target
        for name, color, way in (("is", blue, now), ("wanted", green, wanted)):
            place = drawing.arrow_placement(here.translation, way / np.linalg.norm(way), 2.5 * LOOK.axes_length)
            keyframe.markers[f"{root}/{name}"] = (Marker("arrow", color, 0.35, symbol=True), place)


def _wanted(goal: Any, here: pin.SE3) -> Array:
    if goal.direction is not None:
        return np.asarray(goal.direction, dtype=float)
    return np.asarray(np.asarray(goal.toward, dtype=float) - here.translation)


def _far(goal: Any, here: pin.SE3) -> bool:
    """Whether a goal turns an axis to a place that is too far to be drawn."""
    toward = getattr(goal, "toward", None) if hasattr(goal, "axis") else None
    return toward is not None and bool(np.linalg.norm(_wanted(goal, here)) > FARTHEST_LOOK)


def _target(goal: Any, here: pin.SE3 | None, state: State, scene: ViewedScene) -> tuple[pin.SE3 | None, bool]:
    """Target placement of the goal's frame, and whether the goal includes the orientation."""
    if here is None:
        return None, False
    target = getattr(goal, "target", None)
    if hasattr(goal, "axis"):
        way = np.zeros(3) if goal.toward is None else _wanted(goal, here)
        if _far(goal, here):
            way *= FARTHEST_LOOK / np.linalg.norm(way)
        return pin.SE3(np.eye(3), here.translation + way), False
    if hasattr(goal, "to"):
        base = state.frame(scene.figure.frame_id(goal.to))
        return (base * placement(goal.placement), True) if goal.placement is not None else (None, False)
    if target is None or isinstance(target, str):
        return None, False
    if not isinstance(target, pin.SE3) and np.shape(target) in ((4,), (3, 3)):
        values = np.asarray(target, dtype=float)
        rotation = pin.Quaternion(values).matrix() if values.shape == (4,) else values
        return pin.SE3(rotation, here.translation), True
    if getattr(goal, "axes", "") == "xy":
        return pin.SE3(np.eye(3), np.array([target[0], target[1], 0.0])), False
    try:
        return placement(target), isinstance(target, pin.SE3) or np.shape(target) != (3,)
    except InputError:
        return None, False


def left(goal: Any, state: State) -> str:
    """Remaining error of a goal in words: "3.2 mm", "1.5°", or both."""
    distance, angle = distance_and_angle(goal, state)
    parts = [] if distance is None else [f"{1000 * distance:.1f} mm"]
    return "  ".join(parts if angle is None else [*parts, f"{np.degrees(angle):.1f}°"])


def mark_axes(keyframe: Keyframe, path: str, place: pin.SE3, length: float) -> None:
    """Draw the three axes of a placement in the world, `length` metres long."""
    for name, color, direction in zip("xyz", LOOK.axes, place.rotation.T, strict=True):
        arrow = drawing.arrow_placement(place.translation, direction, length)
        keyframe.markers[f"{path}/{name}"] = (Marker("arrow", color, 0.7), arrow)


def mark_frames(keyframe: Keyframe, scene: ViewedScene, state: State, names: Iterable[str], length: float) -> None:
    """Draw the axes of named frames of the figure, each with its name, `length` metres long."""
    for name in names:
        place = state.frame(scene.figure.frame_id(name))
        mark_axes(keyframe, f"{LOOK.frame_node}/{name}", place, length)
        label = Marker("label", LOOK.label, LOOK.label_size, name)
        keyframe.markers[f"{LOOK.frame_node}/{name}/name"] = (label, drawing.point_placement(place.translation))
