"""Frames that characterise a motion: those which its postures can be interpolated from."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array, Mask
from wholebody.motion.bisection.interpolation import linear


def key_frames(model: pin.Model, q: Array, moving: Mask, deviation: float) -> tuple[int, ...]:
    """Frames between which linear interpolation misses no frame by more than a deviation.

    An interval is split at the frame that is missed most (Ramer 1972; Douglas and Peucker 1973), from the whole motion
    on. The first and the last frame are among them.

    Args:
        model: Pinocchio's model.
        q: (n, nq) postures.
        moving: (nv,) the degrees of freedom that count.
        deviation: radians and metres.
    """
    found, waiting = {0, len(q) - 1}, [(0, len(q) - 1)]
    while waiting:
        a, b = waiting.pop()
        missed = [
            np.abs(pin.difference(model, linear(model, a, b, q[a], q[b], k), q[k])[moving]).max(initial=0.0)
            for k in range(a + 1, b)
        ]
        if missed and max(missed) > deviation:
            worst = a + 1 + int(np.argmax(missed))
            found.add(worst)
            waiting += [(a, worst), (worst, b)]
    return tuple(sorted(found))
