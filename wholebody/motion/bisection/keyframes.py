"""Groups of frames that collide, and interpolation between key frames."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.motion.windows import runs


class Group(NamedTuple):
    """Consecutive frames, the last one included, and the one of them that bisects what collides."""

    first: int
    last: int
    middle: int


def collision_groups(bad: Mask, low: int, high: int, share: float = 0.0, least: int = 1) -> list[Group]:
    """Groups of the frames (n,) that collide strictly between two that stay; those that overlap or touch are one.

    A run is widened to each side by a share of its number of frames, and to `least` frames where there is room.
    """
    first, last = low + 1, high - 1
    found: list[tuple[int, int, list[tuple[int, int]]]] = []
    for run in runs(bad[first : last + 1]):
        begin, end = first + run.first, first + run.end - 1
        wide = _widened(begin, end, round((end - begin + 1) * share), least, first, last)
        covered = [(begin, end)]
        while found and wide[0] <= found[-1][1] + 1:
            before = found.pop()
            wide = min(before[0], wide[0]), max(before[1], wide[1])
            covered = before[2] + covered
        found.append((*wide, covered))
    return [Group(begin, end, _middle(covered)) for begin, end, covered in found]


def _widened(begin: int, end: int, buffer: int, least: int, first: int, last: int) -> tuple[int, int]:
    begin, end = max(first, begin - buffer), min(last, end + buffer)
    lacking = least - (end - begin + 1)
    if lacking > 0:
        begin = max(first, begin - (lacking + 1) // 2)
        end = min(last, max(end, begin + least - 1))
        begin = max(first, min(begin, end - least + 1))
    return begin, end


def _middle(covered: list[tuple[int, int]]) -> int:
    """The middle one of the frames that collide."""
    frames = [frame for begin, end in covered for frame in range(begin, end + 1)]
    return frames[(len(frames) - 1) // 2]


Kind = Literal["linear", "quadratic"]


def linear(model: pin.Model, a: int, b: int, qa: Array, qb: Array, frame: int) -> Array:
    """Posture (nq,) of a frame on the geodesic from frame a to frame b > a (eq. 3.1 of the thesis)."""
    return np.asarray(pin.interpolate(model, qa, qb, (frame - a) / (b - a)))


def quadratic(model: pin.Model, a: int, m: int, b: int, qa: Array, qm: Array, qb: Array, frame: int) -> Array:
    """Posture (nq,) of a frame on the parabola through frames a < m < b, of displacements from the middle posture."""
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
    """Frames of q (n, nq) between which linear interpolation misses no frame by more than a deviation, rad and m.

    An interval is split at the frame that is missed most (Ramer 1972; Douglas and Peucker 1973), from the whole motion
    on; `moving` (nv,) marks the degrees of freedom that count. The first and the last frame are among them.
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
