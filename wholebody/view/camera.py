"""Where the camera looks: at the figure, with what is near it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.view import commands, style
from wholebody.view.server import Command

Array = NDArray[np.float64]

NEAR = 0.3
"""How far around the figure things are kept in the picture, metres; a wall is as long as it likes."""


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
    return commands.look(target, style.FIELD_OF_VIEW, direction=way, points=points, margin=style.MARGIN)
