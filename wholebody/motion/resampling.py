"""Postures between the frames of a motion, on a cubic spline through them.

Between two frames with displacement d and velocities u and v, all over the time step, the posture at a share s of the
way is displaced from the first one by the cubic (s³ - 2s² + s) u + (3s² - 2s³) d + (s³ - s²) v. Of velocities that
satisfy v_{k-1} + 4 v_k + v_{k+1} = 3 (d_{k-1} + d_k) the acceleration has no jumps (de Boor, A Practical Guide to
Splines, 1978); of rotations, which do not commute, those that are left are of third order of a frame's.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.linalg import solve_banded

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure


def splined(figure: Figure, q: Array, places: Array) -> Array:
    """Postures (m, nq) of a motion (n, nq) at `places`, numbers of frames from 0 to n - 1 that need not be whole."""
    last = len(q) - 1
    if last < 1:
        return np.repeat(q, len(places), axis=0)
    way = np.array([pin.difference(figure.model, q[k], q[k + 1]) for k in range(last)])
    speed = _velocities(way)
    found = np.empty((len(places), q.shape[1]))
    for number, place in enumerate(places):
        k = min(int(place), last - 1)
        s = float(place) - k
        step = (s**3 - 2.0 * s**2 + s) * speed[k] + (3.0 - 2.0 * s) * s**2 * way[k] + (s**3 - s**2) * speed[k + 1]
        found[number] = figure.clamp(np.asarray(pin.integrate(figure.model, q[k], step)))
    return found


def _velocities(way: Array) -> Array:
    """Velocities (n + 1, nv) over the time step, of displacements (n, nv); at both ends the acceleration is zero."""
    count = len(way) + 1
    bands = np.ones((3, count))
    bands[1] = 4.0
    bands[1, [0, -1]] = 2.0
    right = np.concatenate([3.0 * way[:1], 3.0 * (way[:-1] + way[1:]), 3.0 * way[-1:]])
    return np.asarray(solve_banded((1, 1), bands, right))
