"""The camera: at a given position, or automatically in front of the figure and the things near it."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.view import commands
from wholebody.view.server import Command, Op
from wholebody.view.style import LOOK

NEAR = 0.3
"""Distance from the figure within which things are kept in the picture, metres."""


def look(
    target: Array,
    fov: float,
    *,
    eye: Array | None = None,
    direction: Array | None = None,
    points: Array | None = None,
    margin: float = 1.0,
) -> Command:
    """Turn the camera to a target (3,), from `eye` (3,), or from `direction` with all `points` (n, 3) in the picture.

    `fov` is the vertical angle of view, degrees; `margin` the width of the picture relative to the points, 1 is exact.
    """
    command: dict[str, Any] = {"type": "look", "target": np.asarray(target, dtype=float).tolist(), "fov": float(fov)}
    if eye is not None:
        command["eye"] = np.asarray(eye, dtype=float).tolist()
    else:
        command["direction"] = np.asarray(direction, dtype=float).tolist()
        command["points"] = commands.floats(points)
        command["margin"] = float(margin)
    return Command(Op.CAMERA, "", "", commands.pack(command))


def camera_on(figure: Array, things: Array, direction: Array | None = None) -> Command:
    """Look at points (n, 3) of the figure from its front right; things (m, 3) near it are in the picture too."""
    if not len(figure):
        figure = things if len(things) else np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 2.0]])
    low, high = figure.min(axis=0), figure.max(axis=0)
    near = np.clip(things, low - NEAR, high + NEAR)
    points = np.concatenate([figure, near])
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    way = np.asarray(LOOK.direction if direction is None else direction, dtype=float)
    return look(target, LOOK.field_of_view, direction=way, points=points, margin=LOOK.margin)
