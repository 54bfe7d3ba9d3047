"""Clips: postures of a figure at a fixed time step, their derivatives on the manifold, and things that move beside."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.charts import Shown, new_chart, plain
from wholebody.base.checks import array, instance, listed, number, shown, text, time_step
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.mirroring import PLACEMENT, mirrored
from wholebody.figures.state import UNIT_TOLERANCE
from wholebody.geometry.placement import PlacementLike, placement, steady
from wholebody.motion.resampling import splined

ROOT_SIZE = 7  # values of a free root
LARGEST = 1e6  # of a value, radians or metres
MOST_FRAMES = 1_000_000  # of a clip: ten hours at 30 frames a second; more would be gigabytes
ROUNDING = 1e-9  # share of a time step by which a time may be outside of a clip: the rounding of sums of steps


@dataclass(frozen=True, eq=False)
class Clip(Shown):
    """Postures of a figure at a fixed time step.

    Postures may be in collision and beyond joint limits: `wb.check` reports both, and `wb.avoid` removes collisions.

    Attributes:
        figure: the figure of the postures.
        q: (n, nq) one posture for each frame, read-only; quaternions are of unit length.
        dt: seconds from frame to frame.
        name: name of the clip in messages and files.
        things: name to placements (n, 7) of what moves beside the figure, such as a box that it carries: x, y, z,
            metres, and a quaternion x, y, z, w. `wb.check` moves its scene so; of files only .npz has them.

    Raises:
        InputError: no frame, another number of values than the figure has, a value that is not finite, a quaternion
            that is not of unit length, or a time step that is not positive; the frame is named.

    Examples:
        >>> wb.Clip(human, [standing, solution.q], dt=0.5, name="reach").resampled(0.1)
        Clip('reach' of 'human': 6 frames, one each 0.1 s)
    """

    figure: Figure
    q: Array
    dt: float
    name: str = "clip"
    things: Mapping[str, Array] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        text(self.name, "the name of a clip")
        check_figure(self.figure, self.name)
        object.__setattr__(self, "dt", time_step(self.dt, f"{self.name}: dt"))
        q = array(self.q, f"{self.name}: q", "postures, shape (frames, nq)").copy()
        wanted = self.figure.model.nq
        if q.ndim != 2 or not 0 < len(q) <= MOST_FRAMES or q.shape[1] != wanted:
            raise InputError(
                f"{self.name}: q has shape {q.shape}; give 1 to {MOST_FRAMES} frames of the {wanted} values of "
                f"{self.figure.name}"
            )
        if not (q.min(initial=0.0) >= -LARGEST and q.max(initial=0.0) <= LARGEST):  # NaN too, and without copies of q
            bad = np.argwhere(~(np.abs(q) <= LARGEST))
            frame, column = (int(k) for k in bad[0])
            raise InputError(
                f"{self.name}: frame {frame}, {column_name(self.figure, column)} is {q[frame, column]:g}; {len(bad)} "
                f"values are not finite or beyond {LARGEST:g}; correct or cut those frames"
            )
        self._normalise(q)
        self.figure.warn_of_angles(q, self.name)
        q.setflags(write=False)
        object.__setattr__(self, "q", q)
        things = instance(self.things, Mapping, f"{self.name}: things", "give placements by name")
        object.__setattr__(self, "things", thing_tracks(things, len(q), self.name) if things else {})

    def __repr__(self) -> str:
        return f"Clip({self.name!r} of {self.figure.name!r}: {len(self)} frames, one each {self.dt:g} s)"

    def _normalise(self, q: Array) -> None:
        """Make quaternions, and cosines and sines of unlimited joints, of unit length."""
        model = self.figure.model
        for first in range(0, len(q), 10_000):  # an array for each of a million frames takes more than their values
            block = q[first : first + 10_000]
            unit = np.array([pin.normalize(model, frame) for frame in block])
            off = ~(np.abs(unit - block) <= UNIT_TOLERANCE)
            off[[not pin.isNormalized(model, frame, UNIT_TOLERANCE) for frame in unit]] = True  # a quaternion of zeros
            if off.any():
                frame, column = (int(k) for k in np.argwhere(off)[0])
                raise InputError(
                    f"{self.name}: frame {first + frame}, {column_name(self.figure, column)} belongs to a quaternion "
                    "or a direction that is not of unit length; normalise it"
                )
            block[:] = unit

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints in the order of q, without the free root."""
        return self.figure.joints

    def __len__(self) -> int:
        return len(self.q)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self) - 1) * self.dt

    @property
    def times(self) -> Array:
        """(n,) seconds of each frame; the first is at 0."""
        return self.dt * np.arange(len(self), dtype=np.float64)

    def __getitem__(self, frames: slice) -> Clip:
        """Return the clip of some frames; a step of k keeps each k-th and makes the time step k times as long.

        Raises:
            InputError: not a slice of frames in ascending order, or no frame is in it.
        """
        if not isinstance(frames, slice):
            raise InputError(
                f"{self.name}[{shown(frames)}]: give a slice, such as clip[10:20]; clip.q[10] is a posture"
            )
        try:
            first, last, step = frames.indices(len(self))
        except (TypeError, ValueError):
            raise InputError(f"{self.name}[{shown(frames)}]: give whole numbers, such as clip[10:20]") from None
        if step < 1 or first >= last:
            raise InputError(
                f"{self.name}[{shown(frames)}]: no frame of {len(self)} in ascending order is in it; "
                "give first < last and a positive step"
            )
        things = {name: track[first:last:step] for name, track in self.things.items()}
        return Clip(self.figure, self.q[first:last:step], self.dt * step, self.name, things)

    def part(self, name: str) -> Clip:
        """The clip of one of the figures that were joined, by its name: what files and measures of one person take."""
        q = self.figure.part(name, self.q)
        return Clip(self.figure.members[name].figure, q, self.dt, f"{self.name} of {name}", self.things)

    def with_q(self, q: ArrayLike) -> Clip:
        """The clip with other postures (m, nq); things that move go on only beside as many as before."""
        postures = array(q, f"{self.name}: q", "postures, shape (frames, nq)")
        if postures.ndim != 2:
            raise InputError(f"{self.name}: q has shape {postures.shape}; give postures, shape (frames, nq)")
        things = self.things if len(postures) == len(self) else {}
        return Clip(self.figure, postures, self.dt, self.name, things)

    def at(self, t: float) -> Array:
        """Posture (nq,) at a time from 0 to `duration`, interpolated between two frames on the configuration manifold.

        Raises:
            InputError: a time outside of the clip.
        """
        t = number(t, f"{self.name}: t", -np.inf, np.inf, "s")
        slack = ROUNDING * self.dt * len(self)
        if not -slack <= t <= self.duration + slack:
            raise InputError(f"{self.name}: t is {t:g} s; give a time from 0 to {self.duration:g} s")
        return np.array(between(self.figure.model, self.q, np.array([t / self.dt]))[0])

    def resampled(self, dt: float, *, smooth: bool = False) -> Clip:
        """The clip at another time step, seconds, interpolated on the configuration manifold.

        The first frame is the same. The last one is at the last multiple of the new step within the clip.

        Args:
            dt: seconds from frame to frame.
            smooth: on a cubic spline through the frames, without jumps of acceleration, which may go up to a few
                millimetres past them; by default as `at`, which turns at each frame.

        Raises:
            InputError: a time step that is not positive, or so short that there were more than a million frames.
        """
        dt = time_step(dt, f"{self.name}: dt")
        # files write 0.0333333 s for a thirtieth, and their last frame is then there too
        frames = int(np.floor(self.duration / dt + 0.01)) + 1
        if frames > MOST_FRAMES:
            raise InputError(f"{self.name}: dt of {dt:g} s makes {frames} frames; give a longer one")
        places = np.minimum(np.arange(frames) * dt / self.dt, len(self) - 1.0)
        things = {name: np.array([_placed(track, place) for place in places]) for name, track in self.things.items()}
        q = splined(self.figure, self.q, places) if smooth else between(self.figure.model, self.q, places)
        return Clip(self.figure, q, dt, self.name, things)

    def mirrored(self) -> Clip:
        """The clip with left and right exchanged, mirrored at the plane y = 0 of the world.

        Raises:
            InputError: the figure is not symmetric, or its joints do not name their sides.
        """
        things = {name: PLACEMENT * track for name, track in self.things.items()}
        return Clip(self.figure, mirrored(self.figure, self.q), self.dt, self.name, things)

    def joined(self, other: Clip) -> Clip:
        """This clip and then the other one. Nothing is blended: the first frame of the other follows the last of this.

        Raises:
            InputError: the other has other joints, another time step, or other things that move.
        """
        other = instance(other, Clip, f"{self.name}: joined: other", "give a clip with the same joints and time step")
        if other.names != self.names or other.q.shape[1] != self.q.shape[1]:
            raise InputError(f"{self.name}: {other.name} has other joints; join clips of one figure")
        if abs(other.dt - self.dt) > ROUNDING * self.dt:
            raise InputError(
                f"{self.name}: its time step is {self.dt:g} s, that of {other.name} {other.dt:g} s; resample one"
            )
        if other.things.keys() != self.things.keys():
            mine, theirs = (", ".join(sorted(one.things)) or "nothing" for one in (self, other))
            raise InputError(
                f"{self.name}: {mine} moves beside it, and {theirs} beside "
                f"{other.name}; join clips with the same things"
            )
        things = {name: np.concatenate([track, other.things[name]]) for name, track in self.things.items()}
        return Clip(self.figure, np.concatenate([self.q, other.q]), self.dt, self.name, things)

    def velocities(self) -> Array:
        """Velocities (n, nv), rad/s and m/s, by differences on the manifold: central, and one-sided at both ends.

        They are exact for quadratic motion. Those of a free root are in its own axes. One frame has none.
        """
        forward, backward = self._differences()
        v = np.zeros((len(self), self.figure.model.nv))
        if len(self) == 2:
            v[:] = forward[0], -backward[1]
        elif len(self) > 2:
            v[1:-1] = 0.5 * (forward[1:-1] - backward[1:-1])
            model = self.figure.model
            v[0] = 2.0 * forward[0] - 0.5 * pin.difference(model, self.q[0], self.q[2])
            v[-1] = 0.5 * pin.difference(model, self.q[-1], self.q[-3]) - 2.0 * backward[-1]
        v /= self.dt
        return v

    def accelerations(self) -> Array:
        """Accelerations (n, nv), rad/s² and m/s², by second differences on the manifold, extrapolated at both ends.

        They are exact for cubic motion, and zero for a clip of less than three frames.
        """
        forward, backward = self._differences()
        a = np.zeros_like(forward)
        if len(self) > 2:
            a[1:-1] = forward[1:-1] + backward[1:-1]
            last = 1 if len(self) == 3 else 2
            a[0] = 2.0 * a[1] - a[last]
            a[-1] = 2.0 * a[-2] - a[-1 - last]
        a /= self.dt**2
        return a

    def _differences(self) -> tuple[Array, Array]:
        """Displacements (n, nv) from each frame to the next one and to the one before; zero where there is none."""
        model = self.figure.model
        forward, backward = (np.zeros((len(self), model.nv)) for _ in range(2))
        for k in range(len(self) - 1):
            forward[k] = pin.difference(model, self.q[k], self.q[k + 1])
            backward[k + 1] = pin.difference(model, self.q[k + 1], self.q[k])
        return forward, backward

    def plot(self, joints: Sequence[str] | None = None) -> Any:
        """Draw values of joints over time, a matplotlib figure.

        Args:
            joints: their names; None for those that move, at most the eight whose values range the farthest.

        Raises:
            InputError: no joint is named.
            UnknownNameError: a joint that the figure does not have.
        """
        model, figure = self.figure.model, self.figure
        names = self.names if joints is None else listed(joints, "plot: joints", "names of joints")
        if not names:
            raise InputError(
                f"{self.name}: plot takes the names of one or more joints; leave them out for those that move most"
            )
        of = {name: model.joints[figure.joint_id(name)] for name in names}
        if joints is None:
            reach = {
                name: float(np.ptp(self.q[:, one.idx_q : one.idx_q + one.nq], axis=0).max()) for name, one in of.items()
            }
            names = sorted(reach, key=lambda name: -reach[name])[:8]
            names = [name for name in names if reach[name] > 1e-9] or names[:1]
        chart, axes = new_chart(1, 1, (8.0, 3.2))
        for name in names:
            one = of[name]
            for k in range(one.nq):
                axes[0, 0].plot(
                    self.times, self.q[:, one.idx_q + k], label=plain(name if one.nq == 1 else f"{name}[{k}]")
                )
        turns = all(one.nq < 3 and not one.shortname().startswith("JointModelP") for one in map(of.__getitem__, names))
        axes[0, 0].set(xlabel="time [s]", ylabel="angle [rad]" if turns else "value [rad, m]", title=plain(self.name))
        chart.legend(loc="outside right upper", fontsize="x-small")
        return chart

    def write(self, path: str | os.PathLike[str], *, bare: bool = False) -> Path:
        """Write the clip to a file, whose path it returns; the ending of its name chooses the format.

        Args:
            path: the file.
            bare: of a CSV, numbers alone: a line a frame, root and joints in the figure's order, as Unitree's LAFAN1
                files are, and as the tools take them that make data for training of these.

        Raises:
            FileFormatError: an ending that is not known.
            InputError: a figure that the format cannot hold, or a file that cannot be written.
        """
        from wholebody.motion.files import write_motion

        return write_motion(self, path, bare=bare)


def between(model: pin.Model, q: Array, places: Array) -> Array:
    """(m, nq) postures at places (m,) of postures (n, nq): at 0.5 in the middle of the first motion between two."""
    first = np.clip(np.floor(places).astype(int), 0, max(0, len(q) - 2))
    shares = np.clip(places - first, 0.0, 1.0 if len(q) > 1 else 0.0)
    return np.array([
        q[k] if share <= ROUNDING
        else q[k + 1] if share >= 1.0 - ROUNDING
        else pin.interpolate(model, q[k], q[k + 1], share)
        for k, share in zip(first, shares, strict=True)
    ])  # fmt: skip


def same_joints(clip: Clip, figure: Figure, what: str) -> None:
    """Raise `InputError` if a figure does not take the postures of a clip."""
    if figure.joints != clip.names or figure.model.nq != clip.q.shape[1]:
        raise InputError(
            f"{what}: the scene is of {figure.name}, which has other joints than {clip.figure.name} of {clip.name}; "
            "make the scene with clip.figure"
        )


def check_figure(figure: object, what: str) -> Figure:
    """A figure; raises InputError where it is something else."""
    return instance(figure, Figure, f"{what}: figure", "load one with wb.load('human')")


def column_name(figure: Figure, column: int) -> str:
    """What a column of a clip's postures is, for messages."""
    for name in (*figure.roots, *figure.joints):
        joint = figure.model.joints[figure.joint_id(name)]
        if joint.idx_q <= column < joint.idx_q + joint.nq:
            what = ("the root" if name == "root" else name) if name in figure.roots else f"joint {name}"
            return what if joint.nq == 1 else f"value {column - joint.idx_q} of {what}"
    return f"value {column}"


def thing_tracks(given: Mapping[str, Iterable[PlacementLike]], frames: int, what: str) -> dict[str, Array]:
    """Placements (n, 7) of things by name, or an InputError that names `what` and the frame."""
    found = {}
    for name, track in given.items():
        checks.text(name, f"{what}: the name of a thing")
        rows = checks.listed(track, f"{what}: things: {name}", "a placement for each frame")
        if len(rows) != frames:
            raise InputError(
                f"{what}: things: {name} has {len(rows)} placements for {frames} frames; give one for each"
            )
        placed = [placement(row, f"{what}: things: {name}: frame {frame}") for frame, row in enumerate(rows)]
        values = np.array([pin.SE3ToXYZQUAT(one) for one in placed]).reshape(-1, 7)
        steady(values[:, 3:])
        values.setflags(write=False)
        found[name] = values
    return found


def _placed(track: Array, place: float) -> Array:
    """The placement (7,) at a number of frames from the first one, which need not be whole."""
    first = int(np.clip(np.floor(place), 0, max(0, len(track) - 2)))
    last = min(first + 1, len(track) - 1)
    ends = (pin.XYZQUATToSE3(track[frame]) for frame in (first, last))
    start, end = ends
    share = float(np.clip(place - first, 0.0, 1.0))
    turn = start.rotation @ pin.exp3(share * pin.log3(start.rotation.T @ end.rotation))
    way = (1.0 - share) * start.translation + share * end.translation
    return np.asarray(pin.SE3ToXYZQUAT(pin.SE3(turn, way)))
