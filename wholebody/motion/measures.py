"""How one clip differs from another that it was made from: what is reported of ways to free a clip of collisions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import instance
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.motion.checking import joint_jerk
from wholebody.motion.clip import Clip
from wholebody.motion.stance import paths, standing_points
from wholebody.motion.windows import runs


@dataclass(frozen=True)
class Deviation:
    """How far a clip is from another one.

    Attributes:
        angle: root of the mean square over frames and joint coordinates, radians (metres for joints that slide);
            without a free root.
        greatest_angle: the greatest of them.
        distance: root of the mean square over frames and joints of the distance between the joints' centres, metres.
        greatest_distance: the greatest of them.
        frames_changed: frames in which some coordinate differs by more than 1e-6.
    """

    angle: float
    greatest_angle: float
    distance: float
    greatest_distance: float
    frames_changed: int


def deviation(before: Clip, after: Clip) -> Deviation:
    """How far a clip is from the one that it was made from.

    Raises:
        InputError: two clips of different figures or lengths.
    """
    _same(before, after, "deviation")
    model = before.figure.model
    apart = np.array([pin.difference(model, *pair) for pair in zip(before.q, after.q, strict=True)])
    angles = apart[:, 6 if before.figure.root == "free" else 0 :]
    away = np.linalg.norm(_centres(before) - _centres(after), axis=2)
    return Deviation(
        angle=_rms(angles),
        greatest_angle=float(np.abs(angles).max(initial=0.0)),
        distance=_rms(away),
        greatest_distance=float(away.max(initial=0.0)),
        frames_changed=int((np.abs(apart).max(axis=1, initial=0.0) > 1e-6).sum()),
    )


def jerk_ratio(before: Clip, after: Clip) -> float:
    """Root of the mean square jerk of the joints, in parts of that of the clip before.

    It is 1 for clips of less than four frames, and infinite where only the clip before has no jerk.

    Raises:
        InputError: two clips of different figures or lengths.
    """
    _same(before, after, "jerk_ratio")
    old, new = (_rms(joint_jerk(clip)) for clip in (before, after))
    if old > 0.0:
        return new / old
    return 1.0 if new == 0.0 else float("inf")


def foot_sliding(before: Clip, after: Clip) -> float:
    """By how much feet slide that stood before, more than they did before: metres.

    Points of the feet stand in the frames in which they do in the clip before. The result is the longest horizontal
    way, over all times that a point stands, by which its offset from where it was before changes. It is 0 for a figure
    that names no points of feet.

    Raises:
        InputError: two clips of different figures or lengths.
    """
    _same(before, after, "foot_sliding")
    stand, most = standing_points(before.figure, before.q, before.dt), 0.0
    old, new = (paths(clip.figure, clip.q, tuple(stand)) for clip in (before, after))
    for k, stands in enumerate(stand.values()):
        offset = (new[:, k] - old[:, k])[:, :2]
        for first, end in runs(stands):
            most = max(most, float(np.linalg.norm(offset[first:end] - offset[first], axis=1).max()))
    return most


def hand_error(before: Clip, after: Clip, hand: str, other: str) -> float:
    """By how much a hand leaves its place in the frame of the other one, which holds a weapon: metres.

    Args:
        before: the clip in which both hands hold it.
        after: the clip that was made from it.
        hand: frame that holds the weapon firmly.
        other: frame of the other hand.

    Returns:
        The greatest change of the position of the other hand, in the axes of the first, in any frame.

    Raises:
        UnknownNameError: the figure has no such frame.
        InputError: two clips of different figures or lengths.
    """
    _same(before, after, "hand_error")
    ids = before.figure.frame_id(hand), before.figure.frame_id(other)
    held = [_relative(clip.figure, clip.q, *ids) for clip in (before, after)]
    return float(np.linalg.norm(held[0] - held[1], axis=1).max())


def hand_off_weapon(before: Clip, after: Clip, hand: str, other: str) -> float:
    """By how much a hand leaves a straight weapon that both hands hold, along which it may slide: metres.

    The weapon lies along the line between both frames in each posture of the clip before.

    Args:
        before: the clip in which both hands hold it.
        after: the clip that was made from it.
        hand: frame that holds the weapon firmly.
        other: frame of the other hand.

    Returns:
        The greatest distance by which the change of the other hand's position leaves that line, in any frame.

    Raises:
        UnknownNameError: the figure has no such frame.
        InputError: two clips of different figures or lengths.
    """
    _same(before, after, "hand_off_weapon")
    ids = before.figure.frame_id(hand), before.figure.frame_id(other)
    held, now = (_relative(clip.figure, clip.q, *ids) for clip in (before, after))
    length = np.linalg.norm(held, axis=1, keepdims=True)
    line = np.divide(held, length, out=np.zeros_like(held), where=length > 0.0)
    change = now - held
    off = change - (change * line).sum(axis=1, keepdims=True) * line
    return float(np.linalg.norm(off, axis=1).max())


def _centres(clip: Clip) -> Array:
    """(n, njoints - 1, 3) centres of the joints in the world, metres."""
    model, data = clip.figure.model, clip.figure.model.createData()
    found = np.zeros((len(clip), model.njoints - 1, 3))
    for k, q in enumerate(clip.q):
        pin.forwardKinematics(model, data, q)
        found[k] = [place.translation for place in data.oMi.tolist()[1:]]
    return found


def _relative(figure: Figure, q: Array, first: int, second: int) -> Array:
    """(n, 3) position of the second frame in the axes of the first."""
    data, found = figure.model.createData(), np.zeros((len(q), 3))
    for k, posture in enumerate(q):
        pin.forwardKinematics(figure.model, data, posture)
        base = pin.SE3(pin.updateFramePlacement(figure.model, data, first))
        found[k] = base.actInv(pin.updateFramePlacement(figure.model, data, second)).translation
    return found


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
