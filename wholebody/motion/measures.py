"""How one clip differs from another that it was made from: measures of the change, and bounds on what the eye sees.

A clip can be free of collisions and hold everything, and still jump. So bounds on jerk, speed and deviation are part of
what `wb.avoid` asks. They are relative to the original motion nearby: what follows a fast motion may be fast.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import sliding_window_view

from wholebody.assessment.motion import root_mean_square, third_differences, velocities
from wholebody.base import checks
from wholebody.base.arrays import Array, Mask
from wholebody.base.checks import instance
from wholebody.base.errors import InputError
from wholebody.base.fields import Checked, Range
from wholebody.figures.state import root_freedoms
from wholebody.motion.checking import joint_jerk
from wholebody.motion.clip import Clip
from wholebody.motion.stance import paths, point_paths, slid, standing_points
from wholebody.tasks.base import filled


@dataclass(frozen=True)
class Deviation:
    """How far a clip is from another one.

    Attributes:
        angle: root of the mean square over frames and joint coordinates, radians (metres for joints that slide);
            without a free root.
        distance: root of the mean square over frames and joints of the distance between the joints' centres, metres.
    """

    angle: float
    distance: float


def deviation(before: Clip, after: Clip) -> Deviation:
    """How far a clip is from the one that it was made from; `InputError` for other figures or lengths."""
    _same(before, after, "deviation")
    model = before.figure.model
    apart = np.array([pin.difference(model, *pair) for pair in zip(before.q, after.q, strict=True)])
    angles = apart[:, ~root_freedoms(model)]
    centres = [(joint, np.zeros(3)) for joint in range(1, model.njoints)]
    old, new = (point_paths(clip.figure, clip.q, centres) for clip in (before, after))
    away = np.linalg.norm(old - new, axis=2)
    return Deviation(_rms(angles), _rms(away))


def jerk_ratio(before: Clip, after: Clip) -> float:
    """Root of the mean square jerk of the joints, in parts of that of the clip before; `InputError` as for `deviation`.

    It is 1 for clips of less than four frames, and infinite where only the clip before has no jerk.
    """
    _same(before, after, "jerk_ratio")
    old, new = (_rms(joint_jerk(clip)) for clip in (before, after))
    if old > 0.0:
        return new / old
    return 1.0 if new == 0.0 else float("inf")


def foot_sliding(before: Clip, after: Clip) -> float:
    """By how much feet slide that stood before, more than they did before: metres; `InputError` as for `deviation`.

    The result is the longest horizontal way, over all times that a point of a foot stands in the clip before, by
    which its offset from where it was before changes. It is 0 for a figure that names no points of feet.
    """
    _same(before, after, "foot_sliding")
    stand = standing_points(before.figure, before.q, before.dt)
    old, new = (paths(clip.figure, clip.q, tuple(stand)) for clip in (before, after))
    return max((slid(new[:, k] - old[:, k], stands)[0] for k, stands in enumerate(stand.values())), default=0.0)


def _same(before: Clip, after: Clip, what: str) -> None:
    for clip, name in ((before, "before"), (after, "after")):
        instance(clip, Clip, f"{what}: {name}", "give a clip")
    if before.names != after.names or before.q.shape != after.q.shape or abs(before.dt - after.dt) > 1e-9:
        raise InputError(
            f"{what}: {after.name} has {len(after)} frames of {after.figure.name}, {after.dt:g} s apart, "
            f"{before.name} {len(before)} of {before.figure.name}, {before.dt:g} s apart; give two of the same"
        )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


PLAIN_SPEED, PLAIN_JERK = 15.0 / 8.0 / 0.5, math.sqrt(720.0) / 0.5**3
"""Largest speed (rad/s) and root mean square jerk (rad/s^3) of a turn by 1 rad in 0.5 s with the least jerk (Flash and
Hogan 1985, Journal of Neuroscience 5(7): 1688). Where the original is calmer, the new motion may be as fast."""


@dataclass(frozen=True)
class MotionBounds(Checked):
    """Bounds on jerk, speed and deviation of a changed clip: a term for the `constraints` of `wb.avoid`.

    `wb.avoid` asks for `MotionBounds()` where none is given. Jerk and speed are those of the joints, and apart from
    them of a free root. They are compared with the original within 0.25 s on both sides, and with a movement of one
    joint by 1 rad in 0.5 s where the original is calmer than this.

    Attributes:
        jerk: largest root mean square jerk over half a second, in parts of the original's there or in the whole clip,
            whichever is more; None for any.
        speed: largest speed of a joint, in parts of the largest of the original within 0.25 s; None for any.
        deviation: by how much a posture may differ from an original one that is free of collisions, within limits, and
            meets what is held, radians and metres; None for any.
        keep_ends: whether the first and the last posture stay as they are where they are free.
        largest: (n,) largest deviation of each frame, radians and metres; inf for none; once resolved.

    Raises:
        InputError: a value out of range.

    Examples:
        >>> freed = wb.avoid(clip, scene, constraints=[wb.motion.MotionBounds(jerk=1.5)])
    """

    jerk: Annotated[float, Range(1.0, 1e6)] | None = 2.0
    speed: Annotated[float, Range(1.0, 1e6)] | None = 1.5
    deviation: Annotated[float, Range(0.0, 1e6)] | None = 0.75
    keep_ends: bool = False
    largest: Array | None = field(init=False, default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.warn_of_degrees(self.deviation or 0.0, "MotionBounds: deviation")


class Excess(NamedTuple):
    """What a changed clip has of jerk, speed and deviation, and where that is beyond its bounds."""

    # jerk and speed: the largest, in parts of the original's
    jerk: float
    speed: float
    deviation: float  # largest of a posture that was free, radians or metres
    beyond: Mask  # (n,) frames that are beyond a bound
    said: tuple[str, ...]  # what is beyond its bound, and by how much; empty where nothing is


def resolved(bounds: MotionBounds, free: Mask, passed: Mask) -> MotionBounds:
    """Bounds with the largest deviation of each frame: bounded where it is free and beside no motion that passes."""
    most = np.inf if bounds.deviation is None else bounds.deviation
    largest = np.where(free & ~passed, most, np.inf)
    if bounds.keep_ends:
        largest[[0, -1]] = np.where(free[[0, -1]], 0.0, largest[[0, -1]])
    return filled(bounds, largest=largest)


def excess(before: Clip, after: Clip, bounds: MotionBounds) -> Excess:
    """Compare a changed clip with the original at the same timing, by bounds that are resolved for it."""
    model, dt, count = before.figure.model, before.dt, len(before)
    jerk, speed = _jerk_ratios(before, after), _speed_ratios(before, after)
    away = np.abs([pin.difference(model, *each) for each in zip(before.q, after.q, strict=True)]).max(axis=1, initial=0)
    largest = np.full(count, np.inf) if bounds.largest is None else bounds.largest
    free = np.isfinite(largest) if bounds.deviation is not None else largest == 0.0
    beyond, said = np.zeros(count, dtype=bool), list[str]()
    rough = _beyond(jerk, bounds.jerk)
    fast = _beyond(speed, bounds.speed)
    for first in np.flatnonzero(rough).tolist():
        beyond[first : first + 4] = True
    for first in np.flatnonzero(fast).tolist():
        beyond[first : first + 2] = True
    far = ~(away <= largest + 1e-6)
    beyond |= far
    for name, ratio, marks, most in (("jerk", jerk, rough, bounds.jerk), ("speed", speed, fast, bounds.speed)):
        if marks.any():
            at = int(np.argmax(ratio))
            said.append(
                f"{name} is {ratio[at]:.3g} times the original's at {at * dt:.2f} s, where {most:g} times are allowed"
            )
    if far.any():
        at = int(np.argmax(np.where(far, away - largest, -np.inf)))
        kept = "is to stay" if largest[at] == 0.0 else f"may move by {largest[at]:g}"
        said.append(f"the posture at {at * dt:.2f} s, which was free and {kept}, moved by {away[at]:.3g} rad or m")
    rough_most, fast_most = (float(ratio.max(initial=0.0)) for ratio in (jerk, speed))
    return Excess(rough_most, fast_most, float(away[free].max(initial=0.0)), beyond, tuple(said))


def _beyond(ratio: Array, most: float | None) -> Mask:
    """Which ratios are not within a bound; NaN is not."""
    return np.zeros(len(ratio), dtype=bool) if most is None else ~(ratio <= most + 1e-6)


def _jerk_ratios(before: Clip, after: Clip) -> Array:
    """(n - 3,) jerk over half a second, in parts of the original's there, of its whole clip, or of a plain movement."""
    model, dt = before.figure.model, before.dt
    old, new = (third_differences(model, clip.q, dt) for clip in (before, after))
    found = np.zeros(len(old))
    for part in _parts(before):
        squares = [np.nanmean(_near(root_mean_square(each[:, part]) ** 2, dt, np.nan), axis=1) for each in (old, new)]
        plain = PLAIN_JERK**2 / max(1, old[:, part].shape[1])
        usual = max(plain, float((old[:, part] ** 2).mean()) if old[:, part].size else 0.0)
        found = np.maximum(found, np.sqrt(squares[1] / np.maximum(squares[0], usual)))
    return found


def _speed_ratios(before: Clip, after: Clip) -> Array:
    """(n - 1,) largest speed from frame to frame, in parts of the original's near it or of a plain movement."""
    model, dt = before.figure.model, before.dt
    old, new = (np.abs(velocities(model, clip.q, dt)) for clip in (before, after))
    found = np.zeros(len(old))
    for part in _parts(before):
        most = _near(old[:, part].max(axis=1, initial=0.0), dt, 0.0).max(axis=1)
        found = np.maximum(found, new[:, part].max(axis=1, initial=0.0) / np.maximum(most, PLAIN_SPEED))
    return found


def _parts(clip: Clip) -> tuple[Mask, ...]:
    """Which columns are of free roots, if there are any, and which of joints."""
    free = root_freedoms(clip.figure.model)
    return (free, ~free) if free.any() else (~free,)


def _near(values: Array, dt: float, fill: float) -> Array:
    """(k, r) the values (k,) within 0.25 s on both sides of each: a single one says little, the whole clip hides it."""
    if not len(values):
        return np.zeros((0, 1))
    reach = max(1, round(0.25 / dt))
    return sliding_window_view(np.pad(values, reach, constant_values=fill), 2 * reach + 1)
