"""Plane constraints that follow a path: elbows and wrists leave it only sideways (eqs. 3.2 and 3.3 of the thesis)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wholebody.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.tasks import Plane

ELBOWS = ("left_elbow", "right_elbow")
ANKLES = ("left_ankle", "right_ankle")

STANDS = 1e-4  # m: a shorter way from frame to frame has no direction; trackers are less exact than this


def path_planes(figure: Figure, q: Array, frame: int, joints: Sequence[str], state: State) -> list[Plane]:
    """Planes through the places of joints at a frame, normal to their paths there.

    The normal is the direction from the place at this frame to the place at the next one, at the last frame from the
    one before. They are made anew from the present curves each time that a posture is predicted.

    Args:
        figure: the figure.
        q: (n, nq) the present curves.
        frame: which.
        joints: names of the frames that move in their planes.
        state: of the run; it is moved.

    Returns:
        One plane for each joint that moves there.
    """
    if len(q) < 2:
        return []
    numbers = [figure.frame_id(joint) for joint in joints]
    here, there = (frame, frame + 1) if frame + 1 < len(q) else (frame - 1, frame)
    places = []
    for which in (here, there):
        state.update(q[which])
        places.append([np.array(state.frame(number).translation) for number in numbers])
    planes = []
    for joint, start, end, at in zip(joints, *places, places[frame - here], strict=True):
        if np.linalg.norm(end - start) > STANDS:
            planes.append(Plane(joint, end - start, point=at))
    return planes
