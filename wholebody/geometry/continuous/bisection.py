"""The last free posture of a motion from a free one, by bisection."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array


def last_free(model: pin.Model, free: Array, q: Array, overlaps: Callable[[Array], object], halvings: int) -> Array:
    """Bisect the motion from a free posture to one that overlaps something; the result was tested to be free.

    Algorithm 1, step 4, of Schmidl and Lin. If the motion is free again after an overlap, the result may be on either
    side.

    Args:
        model: of the figure.
        free: (nq,) posture without overlap.
        q: (nq,) posture with overlap.
        overlaps: whether something overlaps at a posture (nq,).
        halvings: number of halvings; the result is accurate to 2 to the power of minus this.
    """
    inside, outside = 0.0, 1.0
    for _ in range(halvings):
        middle = 0.5 * (inside + outside)
        if overlaps(np.asarray(pin.interpolate(model, free, q, middle))):
            outside = middle
        else:
            inside = middle
    return np.asarray(pin.interpolate(model, free, q, inside))
