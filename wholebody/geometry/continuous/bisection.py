"""The last free posture on the way from a free one, by halving."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array


def last_free(model: pin.Model, free: Array, q: Array, overlaps: Callable[[Array], object], halvings: int) -> Array:
    """Halve the way from a free posture to one that overlaps something; never beyond what was found free.

    Algorithm 1, step 4, of Schmidl and Lin. A way that is free again beyond an overlap may end on either side of it.

    Args:
        model: of the figure.
        free: (nq,) where nothing overlaps.
        q: (nq,) where something does.
        overlaps: whether something overlaps at a posture (nq,).
        halvings: the way is known to 2 to the power of minus this.
    """
    inside, outside = 0.0, 1.0
    for _ in range(halvings):
        middle = 0.5 * (inside + outside)
        if overlaps(np.asarray(pin.interpolate(model, free, q, middle))):
            outside = middle
        else:
            inside = middle
    return np.asarray(pin.interpolate(model, free, q, inside))
