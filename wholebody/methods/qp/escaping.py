"""The end of a frame in which a thing came faster than a figure can go along with: where else is it free?

What is thin and fast is often past the figure at the end of the frame, or the figure may be beside it. So programs
begin at the posture before, and where its root may go in the frame, all with the thing where it ends.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array

ROOT = 3  # coordinates of a free root's place
WAYS = (
    (1, 0, 0),
    (-1, 0, 0),
    (0, 1, 0),
    (0, -1, 0),
    (0, 0, 1),
    (0, 0, -1),
    (1, 1, 0),
    (1, -1, 0),
    (-1, 1, 0),
    (-1, -1, 0),
)
PROGRAMS = 16  # from one start, at most
WORTH = (
    0.8  # share of the depth that a program must leave at most for one more to follow; larger is slower and finds more
)


def free_end(
    model: pin.Model,
    q: Array,
    most: Array | None,
    out: float,
    overlap: Callable[[Array], float],
    step: Callable[[Array, Array | None], Array],
) -> Array | None:
    """A posture (nq,) that is free, whatever passes on the way to it; None if none was found.

    Args:
        model: of the figure.
        q: (nq,) the posture at the start of the frame.
        most: (2, nv) largest displacements from q, radians and metres; None without bounds.
        out: depth up to which a posture is free, metres.
        overlap: greatest depth of any pair at a posture, metres.
        step: the posture after one program at a posture that may displace it by so much.
    """
    begun = [np.zeros(model.nv)]
    if most is not None and np.isfinite(most[:, :ROOT]).all() and most[:, :ROOT].any():
        for way in WAYS:
            begun.append(np.zeros(model.nv))
            begun[-1][:ROOT] = [0.0 if sign == 0 else most[max(sign, 0), axis] for axis, sign in enumerate(way)]
    for displacement in begun:
        here, before = pin.integrate(model, q, displacement), np.inf
        for _ in range(PROGRAMS):
            depth = overlap(here)
            if depth <= out:
                return np.asarray(here)
            if depth > WORTH * before:
                break
            before = depth
            here = step(here, None if most is None else most - pin.difference(model, q, here))
    return None
