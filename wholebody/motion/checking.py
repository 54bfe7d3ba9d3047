"""The check of a clip: every pair in every frame and in between, joint limits and speeds, feet that slide, jerk."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.assessment.motion import root_mean_square, third_differences, velocities
from wholebody.base.arrays import Array
from wholebody.base.charts import Shown, new_chart, plain
from wholebody.base.checks import function, instance, known, number
from wholebody.figures.state import root_freedoms
from wholebody.geometry.continuous.swept_depth import SweptDepth
from wholebody.motion.clip import Clip, same_joints
from wholebody.motion.clip_contacts import Contact, ContactTable, contact_as_dict
from wholebody.motion.stance import Sliding, sliding
from wholebody.scene.moving_obstacles import MovingScene
from wholebody.scene.scene import Scene

DEPTH = 1e-4  # depth up to which an overlap is no contact, metres: that of sweeps, a tenth of a millimetre

SMALLEST, LARGEST = 1e-5, 1.0  # m, of the tolerance; ten times coal's own accuracy
ROUNDING = 1e-9  # rad, m: by which a limit may be missed; share by which a speed may be

Progress = Callable[[int], object]  # called with the number of frames that are done


@dataclass(frozen=True)
class Beyond:
    """A joint that is beyond its limit, or faster than its limit.

    Attributes:
        joint: name of the joint.
        frames: number of frames in which it is beyond; of gaps for speeds.
        frame: the worst one; for a speed the frame before.
        value: there; radians or metres, a second for speeds.
        limit: the one that is exceeded.
    """

    joint: str
    frames: int
    frame: int
    value: float
    limit: float


@dataclass(frozen=True, eq=False, repr=False)
class ClipCheck(Shown):
    """What `check` found in a clip.

    Attributes:
        clip: the clip.
        tolerance: depth up to which an overlap is no contact, metres.
        depth: (n,) deepest overlap of any pair in each frame, metres; 0 if there is none.
        between: (n - 1,) deepest overlap of any pair from each frame to the next one, both included. No pair gets
            deeper than this, or than the tolerance where this is less. What is beyond the tolerance may be too large by
            a tenth of the tolerance and a twentieth of itself.
        contacts: pairs of segments and things that overlap by more than the tolerance, the deepest first.
        limits: joints beyond their limits, the worst first.
        speeds: joints faster than their velocity limits, the worst first.
        sliding: how far each point of the feet slides while it stands.
        jerk: (n - 3,) root of the mean square of the third difference of the joint angles over time, rad/s^3.

    Examples:
        >>> found = wb.check(clip, scene)
        >>> found.free, found.depth.shape == (len(clip),)
        (True, True)
    """

    clip: Clip
    tolerance: float
    depth: Array
    between: Array
    contacts: tuple[Contact, ...]
    limits: tuple[Beyond, ...]
    speeds: tuple[Beyond, ...]
    sliding: tuple[Sliding, ...]
    jerk: Array

    @property
    def free(self) -> bool:
        """Whether no pair overlaps by more than the tolerance, in any frame or in between."""
        return not self.contacts

    @property
    def colliding(self) -> int:
        """Number of frames in which some pair overlaps by more than the tolerance."""
        return int((self.depth > self.tolerance).sum())

    @property
    def dips(self) -> int:
        """Number of gaps in which some pair overlaps by more than the tolerance, though none does at either end."""
        ends = np.maximum(self.depth[:-1], self.depth[1:])
        return int(((self.between > self.tolerance) & (ends <= self.tolerance)).sum())

    @property
    def deepest(self) -> float:
        """Deepest overlap of any pair in any frame, metres."""
        return float(self.depth.max(initial=0.0))

    @property
    def deepest_between(self) -> float:
        """Deepest overlap of any pair at any time; see `between`, metres."""
        return float(self.between.max(initial=0.0))

    @property
    def slid(self) -> float:
        """How far a point of a foot slides at most while it stands, metres."""
        return max((each.distance for each in self.sliding), default=0.0)

    @property
    def mean_jerk(self) -> float:
        """Root of the mean square of `jerk`, rad/s^3; 0 for fewer than four frames."""
        return float(np.sqrt(np.mean(self.jerk**2))) if len(self.jerk) else 0.0

    def __str__(self) -> str:
        """Three lines: whether it is free, the deepest overlap, and limits, speeds, feet and jerk."""
        heading = f"{self.clip.name}, {len(self.clip)} frames: "
        first = f"nothing overlaps by more than {1e3 * self.tolerance:g} mm"
        if not self.free:
            between = f"{self.dips} times between free frames"
            first = f"{len(self.contacts)} pairs collide in {self.colliding} frames, and {between}"
        deepest = f"deepest {1e3 * self.deepest:.2f} mm in a frame and {1e3 * self.deepest_between:.2f} mm at any time"
        if self.contacts:
            worst = max(self.contacts, key=lambda contact: contact.deepest)
            deepest += f", {worst.first} and {worst.second} at {worst.deepest_frame * self.clip.dt:.2f} s"
        return (
            f"{heading}{first}\n{deepest}\n{len(self.limits)} joints beyond limits, {len(self.speeds)} too fast; feet "
            f"slide {1e3 * self.slid:.1f} mm at most; jerk {self.mean_jerk:.0f} rad/s^3"
        )

    def plot(self) -> Any:
        """Draw the depth of the eight deepest pairs over time, a matplotlib figure; of a free clip none.

        Between two frames stands the greatest depth of the motion from one to the other.
        """
        chart, axes = new_chart(1, 1, (8.0, 2.6))
        axis, times = axes[0, 0], 0.5 * self.clip.dt * np.arange(2 * len(self.clip) - 1)
        for each in self.contacts[:8]:
            depth = np.empty(len(times))
            depth[::2], depth[1::2] = each.depth, each.between
            axis.plot(times, 1e3 * depth, label=plain(each.names))
        axis.axhline(1e3 * self.tolerance, color="0.6", linestyle="--", label="tolerance")
        ends = 0.0, max(self.clip.duration, self.clip.dt)
        axis.set(xlabel="time [s]", ylabel="depth [mm]", title=plain(self.clip.name), xlim=ends)
        chart.legend(loc="outside right upper", fontsize="x-small")
        return chart

    def __repr__(self) -> str:
        return f"ClipCheck({str(self).splitlines()[0]!r})"

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON has it: metres, radians, seconds."""
        dt = self.clip.dt
        return {
            "clip": self.clip.name,
            "figure": self.clip.figure.name,
            "frames": len(self.clip),
            "dt": dt,
            "tolerance": self.tolerance,
            "free": self.free,
            "frames_in_collision": self.colliding,
            "dips_between_frames": self.dips,
            "deepest": self.deepest,
            "deepest_between": self.deepest_between,
            "jerk": self.mean_jerk,
            "contacts": [contact_as_dict(contact, dt) for contact in self.contacts],
            "limits": [asdict(each) | {"time": each.frame * dt} for each in self.limits],
            "speeds": [asdict(each) | {"time": each.frame * dt} for each in self.speeds],
            "sliding": [
                {
                    "frame_name": each.frame, "distance": each.distance, "frame": each.at, "time": each.at * dt,
                    "frames_standing": int(each.stands.sum()),
                }
                for each in self.sliding
            ],
            "depth": self.depth.tolist(),
            "between": self.between.tolist(),
        }  # fmt: skip


def check(
    clip: Clip, scene: Scene | None = None, *, depth: float = DEPTH, progress: Progress | None = None
) -> ClipCheck:
    """Check a clip: every pair of pieces, in every frame and in the motions between frames.

    Between two frames the figure moves along ``pin.interpolate``, as `Clip.at` does. What gets deeper than `depth` in
    between is always found, however short the time and however thin the piece. Pairs that the figure or the scene leave
    out (`Figure.excluded_pairs`, `Scene.excluded_pairs`) are left out. Things stand where they are when the check
    begins, but those of `clip.things`, which move.

    Args:
        clip: the clip.
        scene: things around the figure, and attached to it; the figure alone by default.
        depth: up to which an overlap is no contact, metres.
        progress: called with the number of frames that are done.

    Raises:
        InputError: no clip, a scene of a figure with other joints, a depth out of range, or a joint whose motion
            between two postures cannot be bounded.

    Examples:
        >>> wb.check(clip, scene).free
        True
    """
    instance(clip, Clip, "check: clip", "read one with wb.read_clip(path, figure)")
    scene = (
        Scene(clip.figure) if scene is None else instance(scene, Scene, "check: scene", "make one: wb.Scene(figure)")
    )
    same_joints(clip, scene.figure, "check")
    depth = number(depth, "check: depth", SMALLEST, LARGEST, "m")
    tell: Progress | None = function(progress, "check: progress") if progress is not None else None
    table = ContactTable(scene, len(clip))
    for name in clip.things:
        known(name, [each for each, thing in scene.objects.items() if thing.segment is None], "thing", "check: scene")
    with scene.borrow() as workspace:
        swept, q = SweptDepth(workspace.table, workspace.geometry, depth), clip.q
        if clip.things:  # the things that move get joints
            moving = MovingScene(scene.built, clip.things, between_things=False)
            moving.refresh(workspace.geometry)
            swept = SweptDepth(moving.table, moving.geometry, depth)
            tracks = [[pin.XYZQUATToSE3(one) for one in track] for track in clip.things.values()]
            q = np.array(
                [
                    moving.configuration(one, dict(zip(clip.things, at, strict=True)))
                    for one, *at in zip(clip.q, *tracks, strict=True)
                ]
            )
        table.add(0, swept.start(q[0]), between=False)
        for frame in range(1, len(clip)):
            found, passing = swept.advance(q[frame])
            table.add(frame, found, between=False)
            table.add(frame - 1, passing, between=True)
            if tell is not None and frame % 16 == 0:
                tell(frame)
    if tell is not None:
        tell(len(clip))
    deep, between = table.deepest()
    return ClipCheck(
        clip=clip,
        tolerance=depth,
        depth=deep,
        between=between,
        contacts=table.contacts(depth),
        limits=beyond_limits(clip),
        speeds=too_fast(clip),
        sliding=sliding(clip.figure, clip.q, clip.dt),
        jerk=root_mean_square(joint_jerk(clip)),
    )


def joint_jerk(clip: Clip) -> Array:
    """(n - 3, k) third difference of the k joint coordinates over time, without a free root; rad/s^3, m/s^3."""
    found = third_differences(clip.figure.model, clip.q, clip.dt)
    return found[:, ~root_freedoms(clip.figure.model)]


def beyond_limits(clip: Clip) -> tuple[Beyond, ...]:
    """Joints beyond their limits, the worst first."""
    limits, joints = clip.figure.limits, clip.figure.model.joints
    names = {joints[clip.figure.joint_id(name)].idx_q: name for name in reversed(clip.names)}
    columns = zip(limits.idx_q.tolist(), limits.lower, limits.upper, strict=True)
    return _worst_first((names[k], clip.q[:, k], low, high, ROUNDING) for k, low, high in columns)


def too_fast(clip: Clip) -> tuple[Beyond, ...]:
    """Joints that are faster than their velocity limits from a frame to the next one, the worst first."""
    model, limits = clip.figure.model, np.array(clip.figure.model.velocityLimit)
    speed, found = np.abs(velocities(model, clip.q, clip.dt)), list[tuple[str, Array, float, float, float]]()
    for name in clip.names:
        joint = model.joints[clip.figure.joint_id(name)]
        for column in range(joint.idx_v, joint.idx_v + joint.nv):
            if limits[column] > 0.0 and len(speed):  # 0 where a description gives none
                limit = float(limits[column])
                found.append((name, speed[:, column], -np.inf, limit, limit * ROUNDING))
    return _worst_first(found)


def _worst_first(columns: Iterable[tuple[str, Array, float, float, float]]) -> tuple[Beyond, ...]:
    """Joints whose values (n,) are beyond their lower or upper limit by more than rounding, the worst first."""
    found = []
    for name, values, low, high, rounding in columns:
        excess = np.maximum(low - values, values - high)
        worst = int(np.argmax(excess))
        if excess[worst] > rounding:
            count, broken = int((excess > rounding).sum()), low if values[worst] < low else high
            worst_of = Beyond(name, count, worst, float(values[worst]), float(broken))
            found.append((float(excess[worst]) - rounding, worst_of))
    return tuple(each for _, each in sorted(found, key=lambda item: -item[0]))
