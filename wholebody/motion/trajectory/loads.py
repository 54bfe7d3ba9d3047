"""Loads of a trajectory: rows that keep torques within strength, and the zero moment point within the support.

No joint needs more than its strength or than the largest torque that the original clip needs of it in this direction;
the zero moment point is in no frame farther outside of an edge of its support than it is there in the original. A clip
that may be slowed keeps to the strength of a joint if the original slowed as far as may be does. Rows are those of the
filtered original (`wholebody.motion.clip_torques.smoothed`) with the deviation on it, which is smooth itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask, with_values
from wholebody.figures.figure import Figure
from wholebody.figures.strength import Strength, torque_limits
from wholebody.motion.clip import Clip, between
from wholebody.motion.clip_torques import CUTOFF, bearing, smoothed
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.inverse_dynamics import (
    LIGHT,
    Derivatives,
    InverseDynamics,
    Loads,
    Stand,
    zero_moment_point,
)
from wholebody.motion.stance import standing_feet
from wholebody.motion.trajectory.deviations import Chart
from wholebody.motion.trajectory.retiming import TimedRows
from wholebody.scene.scene import Scene
from wholebody.tasks.forces import FRICTION

LENGTH = 0.1  # metres that stand for a whole strength: one hundredth of it is weighed like a millimetre of the support


NEAR = 0.05  # metres: a load that is farther from its bound has no row; what passes unseen has one in the next step


class Defects(NamedTuple):
    """By how much measured loads (`wb.motion.torques`) are more than those of the rows; see `ClipLoads.corrected`."""

    torque: Array  # (n, nv) N m
    place: Array  # (n, 2) of the zero moment point, metres
    pressed: Mask  # (n,) whether the measurement says where the zero moment point is; see `LIGHT`


class LoadBounds(NamedTuple):
    """What loads keep to."""

    lower: Array  # (nv,) least torques, N m; -inf for none
    upper: Array  # (nv,) largest torques
    # (2, nv) least and largest torques of a clip that may be slowed: strength, if the original slowed by as much as can
    # be keeps to it, or else `lower` and `upper`
    slowed: Array
    outside: tuple[Array, ...]  # for each frame (e,) by how far it may lean outside of each edge of its support, metres


@dataclass(frozen=True, eq=False)
class ClipLoads:
    """Loads of the frames of a clip and of deviations from it."""

    clip: Clip
    scene: Scene
    dynamics: InverseDynamics
    stands: Sequence[Stand]  # of each frame
    bounds: LoadBounds  # that the loads keep to
    changed: Array | None = None  # (n, nq) postures made of those of the clip
    defects: Defects | None = None  # of the loads of the rows

    @property
    def figure(self) -> Figure:
        """Of the clip."""
        return self.clip.figure

    @cached_property
    def base(self) -> Array:
        """(n, nq) the filtered postures."""
        model, original = self.figure.model, self.clip.q
        # filtering the change would hide its accelerations
        each = zip(
            smoothed(self.clip, CUTOFF).q, original, original if self.changed is None else self.changed, strict=True
        )
        return np.array([pin.integrate(model, base, pin.difference(model, was, now)) for base, was, now in each])

    @classmethod
    def original(
        cls, clip: Clip, feet: Mapping[str, Mask], strength: Strength, terms: FrameTerms, stretch: float = 1.0
    ) -> ClipLoads:
        """Those of an original clip on its feet (foot -> (n,)) that may be slowed; its own loads are bounds too."""
        dynamics, _, own = bearing(clip, smoothed(clip, CUTOFF).q, feet, terms.scene, FRICTION)
        lower, upper = torque_limits(clip.figure, strength)
        # Where a foot is held beside its place, the original stands in its own.
        joints = dynamics.joints[: len(dynamics.feet)]
        stands = [stand.shifted([terms.shift(k, joint) for joint in joints]) for k, stand in enumerate(own)]
        inside = tuple(np.zeros(len(each.normals)) for each in own)
        found = cls(clip, terms.scene, dynamics, own, LoadBounds(lower, upper, np.array([lower, upper]), inside))
        bounds = found._widened(stretch)
        outside = [
            far if here is stand else np.full(len(stand.normals), far.max(initial=0.0))
            for far, here, stand in zip(bounds.outside, own, stands, strict=True)
        ]
        return replace(found, stands=stands, bounds=with_values(bounds, outside=tuple(outside)))

    def motion(self, before: Array, here: Array, after: Array) -> tuple[Array, Array]:
        """Velocity and acceleration (nv,) of the middle one of three postures (nq,), by central differences."""
        model = self.figure.model
        ahead, back = pin.difference(model, here, after), pin.difference(model, here, before)
        return (ahead - back) / (2.0 * self.clip.dt), (ahead + back) / self.clip.dt**2

    def gaps(self, frame: int, loads: Loads) -> tuple[Array, Array]:
        """Gaps of torques to their bounds (2 nv,), and of the zero moment point to its (e,); metres, see `LENGTH`."""
        bounds, stand, defects = self.bounds, self.stands[frame], self.defects
        needed = loads.strained if defects is None else loads.strained + defects.torque[frame]
        with np.errstate(invalid="ignore"):
            high = LENGTH * (bounds.upper - needed) / bounds.upper
            low = LENGTH * (needed - bounds.lower) / -bounds.lower
        torque = np.concatenate([high, low])
        torque[np.isnan(torque)] = np.inf
        leaning = self.leaning(stand, loads, None if defects is None else bool(defects.pressed[frame]))
        if not len(leaning):
            return torque, leaning
        moved = 0.0 if defects is None else stand.normals @ defects.place[frame]
        return torque, leaning + moved + bounds.outside[frame]

    def leaning(self, stand: Stand, loads: Loads, pressed: bool | None = None) -> Array:
        """(e,) distances of the zero moment point from the edges of the support; none where it is not `pressed` on."""
        pressed = loads.wrench[2] >= LIGHT * self.dynamics.weight if pressed is None else pressed
        if not len(stand.normals) or not pressed:
            return np.zeros(0)
        return stand.margins(zero_moment_point(loads.wrench, stand.height))

    def of(self, q: Array, times: Array | None = None) -> ClipLoads:
        """The same for as many other postures (n, nq), or for (m, nq) at other times (m,) of the clip, seconds."""
        if times is None:
            return replace(self, changed=q)
        places = times / self.clip.dt
        clip = Clip(self.figure, between(self.figure.model, self.clip.q, places), self.clip.dt)
        feet = np.array([len(np.unique(stand.owner)) for stand in self.stands])  # and parts that touch
        frames = standing_frames(places, feet).tolist()
        bounds = with_values(self.bounds, outside=tuple(self.bounds.outside[frame] for frame in frames))
        return ClipLoads(clip, self.scene, self.dynamics, [self.stands[frame] for frame in frames], bounds, q)

    def corrected(self, q: Array) -> ClipLoads:
        """The same with rows whose loads at postures (n, nq) are those that `wb.motion.torques` measures."""
        # The measurement filters and sees which feet stand; the difference is nearly the same for postures nearby.
        own, clip = self.of(q), Clip(self.figure, q, self.clip.dt)
        steady = smoothed(clip, CUTOFF).q
        dynamics, _, stands = bearing(clip, steady, standing_feet(clip, self.dynamics.feet), self.scene, FRICTION)
        torque, place = np.zeros((len(q), self.figure.model.nv)), np.zeros((len(q), 2))
        pressed: Mask = np.zeros(len(q), dtype=bool)
        for frame in range(1, len(q) - 1):
            recorded, seen = (
                bears.loads(postures[frame], *self.motion(*postures[frame - 1 : frame + 2]), stand)
                for bears, postures, stand in (
                    (self.dynamics, own.base, self.stands[frame]),
                    (dynamics, steady, stands[frame]),
                )
            )
            torque[frame] = seen.strained - recorded.strained
            pressed[frame] = seen.wrench[2] >= LIGHT * self.dynamics.weight and recorded.wrench[2] > 0.0
            if pressed[frame] and len(self.stands[frame].normals):
                height = self.stands[frame].height
                place[frame] = zero_moment_point(seen.wrench, height) - zero_moment_point(recorded.wrench, height)
        return replace(self, defects=Defects(torque, place, pressed))

    def worst(self) -> Array:
        """(n,) by how much loads are beyond their bounds, metres, see `LENGTH`; 0 where they are not."""
        rows, found = WindowLoads(self, 0, len(self.base)), np.zeros(len(self.base))
        for frame in rows.frames:
            found[frame] = -min(part.min(initial=0.0) for part in rows.gaps(frame))
        return found

    def beyond(self) -> Mask:
        """(n,) frames whose loads are beyond their bounds by more than is tolerated where postures are free."""
        return self.worst() > 5e-4  # m, see `LENGTH`

    def timed(self, b: Array) -> TimedRows:
        """Rows of the loads of these postures, when they are passed at rates whose squares are b (n,) or about that."""
        changes = np.gradient(b, self.clip.dt)
        parts = [self._timed(frame, float(b[frame]), float(changes[frame])) for frame in range(1, len(b) - 1)]
        parts = [part for part in parts if len(part.gap)]
        if not parts:
            return TimedRows(np.zeros(0, dtype=np.intp), *(np.zeros(0) for _ in range(3)))
        return TimedRows(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def _timed(self, frame: int, b: float, change: float) -> TimedRows:
        dynamics, stand = self.dynamics, self.stands[frame]
        now = np.array([1.0, b, change])
        torques, wrenches = self._parts(frame, now)
        gaps = [[], [], []]  # type: list[list[Array]]
        for number, torque in enumerate(torques):
            for bound, sign in zip(self.bounds.slowed, (1.0, -1.0), strict=True):
                limit = np.where(np.isfinite(bound), np.abs(bound), np.inf)
                gaps[number].append(LENGTH * (sign * torque / limit + (1.0 if number == 0 else 0.0)))
        if len(stand.normals) and now @ wrenches[:, 2] >= LIGHT * dynamics.weight:
            for number, wrench in enumerate(wrenches):
                place = zero_moment_point(np.concatenate([wrench[:2], [1.0], wrench[3:]]), stand.height)
                far = stand.normals @ place - (stand.offsets - self.bounds.outside[frame]) * wrench[2]
                gaps[number].append(far / dynamics.weight)
        rows = np.array([np.concatenate(each) for each in gaps])
        near = now @ rows < NEAR
        return TimedRows(np.full(int(near.sum()), frame, dtype=np.intp), rows[0, near], rows[1, near], rows[2, near])

    def _parts(self, frame: int, shares: Array) -> tuple[Array, Array]:
        """Torques (3, nv) and wrenches (3, 6): constant, and factors of b and of its derivative; see `timed`."""
        q, none = self.base[frame], np.zeros(self.figure.model.nv)
        v, a = self.motion(*self.base[frame - 1 : frame + 2])
        still = self.dynamics.free_torque(q, none, none)
        moved = self.dynamics.free_torque(q, v, a) - still
        pushed = 0.5 * (self.dynamics.free_torque(q, none, v) - still)
        return self.dynamics.grounded(q, np.array([still, moved, pushed]), shares, self.stands[frame])

    def _widened(self, stretch: float) -> LoadBounds:
        """The bounds, and the loads of these postures where they are beyond them."""
        least, most = self.bounds.slowed
        slow = np.array([1.0, 1.0 / stretch**2, 0.0])
        lower, upper, outside = self.bounds.lower, self.bounds.upper, list(self.bounds.outside)
        for frame in range(1, len(self.base) - 1):
            v, a = self.motion(*self.base[frame - 1 : frame + 2])
            found = self.dynamics.loads(self.base[frame], v, a, self.stands[frame])
            lower, upper = np.minimum(lower, found.strained), np.maximum(upper, found.strained)
            torque = slow @ self._parts(frame, slow)[0]
            least, most = np.minimum(least, torque), np.maximum(most, torque)
            leaning = self.leaning(self.stands[frame], found)
            outside[frame] = np.maximum(outside[frame], -leaning) if len(leaning) else outside[frame]
        limits = self.bounds.slowed
        slowed = [np.where(least < limits[0], lower, limits[0]), np.where(most > limits[1], upper, limits[1])]
        return LoadBounds(lower, upper, np.array(slowed), tuple(outside))


class WindowLoads:
    """Loads of the frames of a window but the ends of the clip, with derivatives with respect to deviations."""

    def __init__(self, loads: ClipLoads, first: int, count: int) -> None:
        self._loads, self._first = loads, first
        self._chart = Chart(loads.figure.model, loads.base[first : first + count])
        self.frames = [k for k in range(count) if 0 < first + k < len(loads.base) - 1]

    def postures(self, frame: int, x: Array) -> tuple[Array, Array, Array]:
        """The postures before, at and after a frame of the window; beyond it nothing deviates."""
        base, chart = self._loads.base, self._chart
        near = (frame - 1, frame, frame + 1)
        found = [chart.posture(k, x[k]) if 0 <= k < len(chart) else base[self._first + k] for k in near]
        return found[0], found[1], found[2]

    def gaps(self, frame: int) -> tuple[Array, Array]:
        """Gaps to the bounds of a frame of the window without deviation; see `ClipLoads.gaps`."""
        before, here, after = self.postures(frame, np.zeros((len(self._chart), self._loads.figure.model.nv)))
        v, a = self._loads.motion(before, here, after)
        number = self._first + frame
        found = self._loads.dynamics.loads(here, v, a, self._loads.stands[number])
        return self._loads.gaps(number, found)

    def rows(self, frame: int, x: Array) -> tuple[Array, tuple[Array, ...]]:
        """Gaps (r,) near bounds at deviations (n, nv), and derivatives (r, nv) for the frames before, at and after."""
        loads, number = self._loads, self._first + frame
        stand = loads.stands[number]
        before, here, after = self.postures(frame, x)
        v, a = loads.motion(before, here, after)
        torque, places = loads.gaps(number, loads.dynamics.loads(here, v, a, stand))
        tight, leaning = (np.flatnonzero(each < NEAR).astype(np.intp) for each in (torque, places))
        gap = np.concatenate([torque[tight], places[leaning]])
        near = [k for k in (frame - 1, frame, frame + 1) if 0 <= k < len(self._chart)]
        if not len(gap):
            return gap, tuple(np.zeros((0, len(v))) for _ in near)
        slopes = self._slopes(loads.dynamics.derivatives(here, v, a, stand), stand, tight, leaning)
        moved = self._moved(before, here, after, slopes)
        parts = (self._chart.carried(k, x[k], moved[k - frame + 1]) for k in near)
        return gap, tuple(parts)

    def _slopes(self, found: Derivatives, stand: Stand, tight: Indices, leaning: Indices) -> list[Array]:
        """Derivatives (r, nv) of the gaps with respect to posture, velocity and acceleration."""
        bounds, nv = self._loads.bounds, self._loads.figure.model.nv
        column, low = tight % nv, tight >= nv
        scale = np.where(low, LENGTH / -bounds.lower[column], -LENGTH / bounds.upper[column])
        return [
            np.vstack([scale[:, None] * torque[column], stand.normals[leaning] @ place])
            for torque, place in zip(found.torque, found.place, strict=True)
        ]

    def _moved(self, before: Array, here: Array, after: Array, slopes: list[Array]) -> list[Array]:
        """The derivatives with respect to the tangents of the postures before, here and after."""
        model, dt = self._loads.figure.model, self._loads.clip.dt
        at, speed, push = slopes
        ahead = [np.asarray(pin.dDifference(model, here, after, arg)) for arg in (pin.ARG0, pin.ARG1)]
        back = [np.asarray(pin.dDifference(model, here, before, arg)) for arg in (pin.ARG0, pin.ARG1)]
        forward, backward = speed / (2.0 * dt) + push / dt**2, -speed / (2.0 * dt) + push / dt**2
        return [backward @ back[1], at + forward @ ahead[0] + backward @ back[0], forward @ ahead[1]]


def standing_frames(places: Array, feet: Array) -> Indices:
    """(m,) frames of a clip whose standing feet are those at places (m,) between frames; `feet` (n,) count them."""
    # A foot stands between frames if it stands in both: of two it is the one with fewer feet, or the nearer.
    near, below, above = (np.clip(to(places).astype(int), 0, len(feet) - 1) for to in (np.rint, np.floor, np.ceil))
    fewer = np.where(feet[below] < feet[above], below, above)
    return np.asarray(np.where(feet[below] == feet[above], near, fewer))
