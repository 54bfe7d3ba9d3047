"""Where the camera stands and looks: as it was told, or at the figure with what is near it."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.arrays import Array
from wholebody.view import commands, style
from wholebody.view.server import CAMERA, Command

NEAR = 0.3
"""How far around the figure things are kept in the picture, metres; a wall is as long as it likes."""


def look(
    target: Array,
    fov: float,
    *,
    eye: Array | None = None,
    direction: Array | None = None,
    points: Array | None = None,
    margin: float = 1.0,
) -> Command:
    """Turn the camera to a target, from `eye`, or from `direction` so that all `points` (n, 3) are in the picture.

    Args:
        target: (3,) what is in the middle.
        fov: vertical angle of view, degrees.
        eye: (3,) where the camera is.
        direction: (3,) from the target towards the camera.
        points: (n, 3) what must be seen.
        margin: how much wider than the points the picture is, 1 being exact.
    """
    command: dict[str, Any] = {"type": "look", "target": np.asarray(target, dtype=float).tolist(), "fov": float(fov)}
    if eye is not None:
        command["eye"] = np.asarray(eye, dtype=float).tolist()
    else:
        command["direction"] = np.asarray(direction, dtype=float).tolist()
        command["points"] = np.asarray(points, dtype=float).round(6).ravel().tolist()
        command["margin"] = float(margin)
    return Command(CAMERA, "", "", commands.pack(command))


def camera_on(figure: Array, things: Array, direction: Array | None = None) -> Command:
    """Look at the figure from its front right, from as far away as it takes to see it and what is near it.

    Args:
        figure: (n, 3) points of the figure that must be seen.
        things: (m, 3) points of other things; those far away are drawn in to `NEAR`.
        direction: (3,) from the figure to the camera, if another is wanted.
    """
    if not len(figure):
        figure = things if len(things) else np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 2.0]])
    low, high = figure.min(axis=0), figure.max(axis=0)
    near = np.clip(things, low - NEAR, high + NEAR)
    points = np.concatenate([figure, near])
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    way = np.asarray(style.DIRECTION if direction is None else direction, dtype=float)
    return look(target, style.FIELD_OF_VIEW, direction=way, points=points, margin=style.MARGIN)
