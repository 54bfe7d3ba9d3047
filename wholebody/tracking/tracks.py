"""Tracks: postures of a tracker, frame by frame; recorded, computed, or scripted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, brief
from wholebody.base.checks import array, instance, known, listed, settle, shown, text, time_step, whole
from wholebody.base.checks import posture as checked_posture
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.figures.figure import Figure
from wholebody.figures.state import UNIT_TOLERANCE
from wholebody.geometry.placement import placement

ROOT_SIZE = 7
LARGEST = 1e6  # of a value, radians or metres
MOST_FRAMES = 1_000_000  # of a track: ten hours at 30 frames a second; more would be gigabytes


def check_frames(q: Array, what: str, place: Callable[[int], str]) -> None:
    """Refuse values (frames, columns) that are not finite or far too large; `place` names a column."""
    if not (q.min(initial=0.0) >= -LARGEST and q.max(initial=0.0) <= LARGEST):  # false of NaN, and without copies of q
        bad = np.argwhere(~(np.abs(q) <= LARGEST))
        frame, column = (int(k) for k in bad[0])
        raise InputError(
            f"{what}: frame {frame}, {place(column)} is {q[frame, column]:g}; {len(bad)} values are not finite or "
            f"beyond {LARGEST:g}; correct or cut those frames"
        )


def check_figure(figure: object, what: str) -> Figure:
    """A figure; raises InputError where it is something else."""
    return instance(figure, Figure, f"{what}: figure", "load one with wb.load('human')")


@dataclass(frozen=True, eq=False)
class Track:
    """Postures of a tracker at a fixed time step; they may penetrate things.

    It has `q` and `dt` like a clip, so `Viewer.play` plays it.

    Attributes:
        q: (n, nq) one posture for each frame.
        dt: seconds from frame to frame.
        joints: names of the joints in the order of q, without the free root.
        name: name of the track in messages.

    Raises:
        InputError: no frame, a time step that is not positive, or a value that is not finite; the frame is named.

    Examples:
        >>> wholebody.tracking.posed(human, angles={"left_elbow_flexion": [0.0, 0.5]}, dt=0.1).dt
        0.1
    """

    __repr__ = brief

    q: Array
    dt: float
    joints: tuple[str, ...]
    name: str = "track"

    def __post_init__(self) -> None:
        text(self.name, "the name of a track")
        q = array(self.q, f"{self.name}: q", "postures, shape (frames, nq)").copy()
        if q.ndim != 2 or not len(q):
            raise InputError(f"{self.name}: a track is (frames, nq) with at least one frame, not {q.shape}")
        settle(self, "dt", time_step(self.dt, f"{self.name}: dt"))
        joints = listed(self.joints, f"{self.name}: joints", "figure.joints")
        if not all(isinstance(joint, str) for joint in joints):
            raise InputError(f"{self.name}: joints is {shown(self.joints)}; give names, such as figure.joints")
        object.__setattr__(self, "joints", tuple(joints))
        roots, rest = divmod(q.shape[1] - len(self.joints), ROOT_SIZE)
        if roots < 0 or rest:
            raise InputError(
                f"{self.name}: {q.shape[1]} values a frame do not fit {len(self.joints)} joints; give one value "
                "for each joint, after seven for a free root"
            )
        check_frames(q, self.name, lambda column: self._place(q.shape[1], column))
        q.setflags(write=False)
        object.__setattr__(self, "q", q)

    def __len__(self) -> int:
        return len(self.q)

    @classmethod
    def of(cls, figure: Figure, q: ArrayLike, dt: float, name: str = "track") -> Track:
        """Track of a figure's own postures, (n, nq), in its order of joints."""
        return cls(q, dt, check_figure(figure, "Track.of").joints, name)  # type: ignore[arg-type]

    def part(self, first: int, last: int) -> Track:
        """Frames `first` to `last`, without the last one; raises InputError where there is none among them."""
        first = whole(first, "first", 0, len(self))
        last = whole(last, "last", 0, len(self))
        if not first < last:
            raise InputError(f"{self.name}: frames {first} to {last} of {len(self)}; give 0 <= first < last")
        return Track(self.q[first:last], self.dt, self.joints, self.name)

    def repeated(self, frames: int) -> Track:
        """A track of as many frames, at least one: the first ones, or all of them repeatedly."""
        frames = whole(frames, f"{self.name}: frames", 1, MOST_FRAMES)
        return Track(self.q[np.arange(frames) % len(self)], self.dt, self.joints, self.name)

    def check(self, figure: Figure) -> None:
        """Check that the track fits a figure.

        Raises:
            UnknownNameError: it has a joint that the figure does not have.
            InputError: it lacks joints, has them in another order, or has a quaternion that is not of unit length.
        """
        check_figure(figure, f"{self.name}: check")
        for joint in self.joints:
            if joint not in figure.joints:
                raise UnknownNameError("joint", joint, figure.joints, self.name)
        missing = [joint for joint in figure.joints if joint not in self.joints]
        if missing or self.q.shape[1] != figure.model.nq:
            what = f"lacks {', '.join(missing[:4])}" if missing else f"has {self.q.shape[1]} values a frame"
            raise InputError(f"{self.name} {what}; {figure.name} takes {figure.model.nq} values: {_order(figure)}")
        if self.joints != figure.joints:
            raise InputError(f"{self.name}: its joints are in another order than {figure.name}'s; use posed(...)")
        figure.warn_of_angles(self.q, self.name)
        for root in figure.roots.values():
            first = int(figure.model.joints[root].idx_q)
            off = np.abs(np.linalg.norm(self.q[:, first + 3 : first + ROOT_SIZE], axis=1) - 1.0)
            if off.max() > UNIT_TOLERANCE:
                frame = int(np.argmax(off > UNIT_TOLERANCE))
                raise InputError(
                    f"{self.name}: frame {frame}, the root's quaternion is not of unit length; normalise it"
                )

    def _place(self, size: int, column: int) -> str:
        root = size - len(self.joints)
        if root > ROOT_SIZE:  # of several figures, each of which has its root before its joints
            return f"value {column}"
        return f"value {column} of the root" if column < root else f"joint {self.joints[column - root]}"


def posed(
    figure: Figure,
    *,
    roots: Sequence[Any] | None = None,
    angles: Mapping[str, ArrayLike] | None = None,
    posture: str | ArrayLike | None = None,
    dt: float,
    name: str = "track",
) -> Track:
    """Track from placements of the root and angles by joint name: a hand's placements and a glove's angles.

    Args:
        figure: the figure of the postures.
        roots: n placements of a free root, each as for `Scene.add`; by default that of the posture.
        angles: joint name to n angles, radians, or one for all frames; other joints stay as in the posture.
        posture: (nq,) or a name; the figure's first one if left out.
        dt: seconds from frame to frame.
        name: name of the track in messages.

    Raises:
        UnknownNameError: a joint that the figure does not have.
        InputError: tracks of different length, a placement that cannot be read (the frame is named), roots for a fixed
            figure.

    Examples:
        >>> track = wholebody.tracking.posed(human, angles={"left_elbow_flexion": [0.0, 0.5, 1.0]}, dt=0.1)
        >>> track.q.shape
        (3, 56)
    """
    check_figure(figure, "posed")
    base = _posture(figure, posture)
    text(name, "name")
    if not (angles is None or isinstance(angles, Mapping)):
        raise InputError(f"{name}: angles is {shown(angles)}; give angles by joint, such as {{'neck_flexion': [0.5]}}")
    joints = {known(joint, figure.joints, "joint", name): values for joint, values in (angles or {}).items()}
    given = {joint: _angles(values, joint) for joint, values in joints.items()}
    roots = None if roots is None else listed(roots, f"{name}: roots", "placements (x, y, z)")
    if not (roots is None or roots):
        raise InputError(f"{name}: roots is empty; give a placement for each frame, or leave it out")
    frames = _frames(name, roots, given)
    q = np.tile(base, (frames, 1))
    for joint, values in given.items():
        q[:, figure.model.joints[figure.joint_id(joint)].idx_q] = values
    if roots is not None:
        if figure.root != "free":
            what = "is fixed to the world" if figure.root == "fixed" else "are several figures"
            raise InputError(f"{name}: {figure.name} {what}; leave roots out")
        for frame, root in enumerate(roots):
            try:
                q[frame, :ROOT_SIZE] = pin.SE3ToXYZQUAT(placement(root))
            except InputError as error:
                raise InputError(f"{name}: frame {frame}: {error}") from None
    return Track.of(figure, q, dt, name)


def _posture(figure: Figure, posture: str | ArrayLike | None) -> Array:
    if posture is None:
        return figure.neutral
    return figure.posture(posture) if isinstance(posture, str) else checked_posture(posture, figure.model.nq)


def _angles(values: object, joint: str) -> Array:
    """Angles (n,) of a joint, one or more."""
    wanted = "an angle for each frame, radians, or one for all"
    found = np.atleast_1d(array(values, f"angles of {joint!r}", wanted))
    if found.ndim != 1 or not len(found):
        raise InputError(f"angles of {joint!r} have shape {found.shape}; give {wanted}")
    return found


def _frames(name: str, roots: Sequence[Any] | None, angles: Mapping[str, Array]) -> int:
    sizes = {joint: len(values) for joint, values in angles.items() if len(values) != 1}
    if roots is not None:
        sizes["root"] = len(roots)
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{joint} {size}" for joint, size in list(sizes.items())[:5])
        raise InputError(f"{name}: tracks of different length ({listed} frames); cut them to the same")
    return next(iter(sizes.values()), 1)


def _order(figure: Figure) -> str:
    root = "seven of the root, then " if figure.root == "free" else ""
    return f"{root}{', '.join(figure.joints[:3])}, ..."
