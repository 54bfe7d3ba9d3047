"""Interpolation of postures between key frames, on the configuration manifold, and which frames those are."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask

Kind = Literal["linear", "quadratic"]


def linear(model: pin.Model, a: int, b: int, qa: Array, qb: Array, frame: int) -> Array:
    """Posture (nq,) of a frame on the geodesic from frame a to frame b > a (eq. 3.1 of the thesis)."""
    return np.asarray(pin.interpolate(model, qa, qb, (frame - a) / (b - a)))


def quadratic(model: pin.Model, a: int, m: int, b: int, qa: Array, qm: Array, qb: Array, frame: int) -> Array:
    """Posture (nq,) of a frame on the parabola through the postures of frames a < m < b.

    The parabola is one of displacements from the middle posture: its Lagrange form has the values of
    ``difference(qm, qa)``, zero and ``difference(qm, qb)`` at the three frames. No fraction has a zero below, as the
    three frames differ.
    """
    before, after = pin.difference(model, qm, qa), pin.difference(model, qm, qb)
    at_a = (frame - m) * (frame - b) / ((a - m) * (a - b))
    at_b = (frame - a) * (frame - m) / ((b - a) * (b - m))
    return np.asarray(pin.integrate(model, qm, at_a * before + at_b * after))


def fill(model: pin.Model, q: Array, a: int, m: int, b: int, kind: Kind) -> None:
    """Interpolate the frames between a, m and b of q (n, nq) in place; a = m or m = b leaves out that side."""
    ends = q[[a, m, b]].copy()
    for frame in range(a + 1, b):
        if frame == m:
            continue
        if kind == "quadratic" and a < m < b:
            q[frame] = quadratic(model, a, m, b, ends[0], ends[1], ends[2], frame)
        elif frame < m:
            q[frame] = linear(model, a, m, ends[0], ends[1], frame)
        else:
            q[frame] = linear(model, m, b, ends[1], ends[2], frame)


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
