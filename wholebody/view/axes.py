"""Axes of frames: three arrows each, red, green and blue for x, y and z."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from wholebody.figures.state import State
from wholebody.view import drawing, style
from wholebody.view.scene_graph import Keyframe, Marker
from wholebody.view.viewed_scene import ViewedScene


def mark_axes(keyframe: Keyframe, path: str, place: pin.SE3, length: float) -> None:
    """Draw the three axes of a placement in the world, `length` metres long."""
    for name, color, direction in zip("xyz", style.AXES, place.rotation.T, strict=True):
        arrow = drawing.arrow_placement(place.translation, direction, length)
        keyframe.markers[f"{path}/{name}"] = (Marker("arrow", color, 0.7), arrow)


def mark_frames(keyframe: Keyframe, scene: ViewedScene, state: State, names: Iterable[str], length: float) -> None:
    """Draw the axes of named frames of the figure, each with its name, `length` metres long."""
    for name in names:
        place = state.frame(scene.figure.frame_id(name))
        mark_axes(keyframe, f"{style.FRAME_NODE}/{name}", place, length)
        matrix = np.eye(4)
        matrix[:3, 3] = place.translation
        keyframe.markers[f"{style.FRAME_NODE}/{name}/name"] = (
            Marker("label", style.LABEL, style.LABEL_SIZE, name),
            matrix,
        )
