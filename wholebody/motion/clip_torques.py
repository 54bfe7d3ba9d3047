"""Torques of a clip: inverse dynamics, forces of the ground on feet that stand, centre of pressure, strength."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import sliding_window_view

from wholebody.base import checks
from wholebody.base.arrays import Array, Mask, brief
from wholebody.base.charts import new_chart, plain
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.joined import one_figure
from wholebody.motion.clip import Clip
from wholebody.motion.inverse_dynamics import ROOT, InverseDynamics, foot_wrenches
from wholebody.motion.stance import FEET, standing_feet
from wholebody.motion.strength import Strength, torque_limits

CUTOFF = 6.0
"""Hz: noise of recordings lies above, most of walking below (D. A. Winter, "Biomechanics and motor control of human
movement", chapter 2.2.4: 4 to 6 Hz for walking)."""


@dataclass(frozen=True, eq=False)
class Torques:
    """Torques of a clip, frame by frame; nothing in it is NaN.

    Attributes:
        figure: the figure.
        dt: seconds from frame to frame.
        torque: (n, nv) torque of each joint, N m (force of sliding joints, N), after the ground's forces; positive
            towards positive angles. The six columns of a free root hold what is missing (see there).
        feet: names of the feet.
        force: (n, feet, 3) force of the ground on each foot, N, in the world. It acts on the foot's segment; the
            joint of the toes bears nothing.
        moment: (n, feet, 3) moment of the ground on each foot about its centre of pressure, N m, in the world.
        pressure: (n, feet, 3) centre of pressure of each foot, metres; zero where the foot bears nothing.
        center_of_pressure: (n, 3) of both feet together, metres; zero where nothing bears.
        stands: (n, feet) whether each foot stands in the frame.
        missing: (n, 6) what the ground cannot give of the wrench that the motion needs: force, N, and moment about the
            centre of mass, N m, in the world. Zero for a motion that is possible on these feet.
        outside: (n,) by how far the zero moment point of the motion is outside of the support polygon, metres; 0
            inside, where no foot stands, and in frames that press with less than a fifth of the weight.
        lower: (nv,) least torque of each joint, N m: published strength of a person, effort limits of a robot; -inf
            where none is known.
        upper: (nv,) largest torque of each joint, N m; inf where none is known.

    Examples:
        >>> needed = wb.motion.torques(clip)
        >>> needed.torque.shape == (len(clip), human.model.nv)
        True
    """

    figure: Figure
    dt: float
    torque: Array = field(repr=False)
    feet: tuple[str, ...]
    force: Array = field(repr=False)
    moment: Array = field(repr=False)
    pressure: Array = field(repr=False)
    center_of_pressure: Array = field(repr=False)
    stands: Mask = field(repr=False)
    missing: Array = field(repr=False)
    outside: Array = field(repr=False)
    lower: Array = field(repr=False)
    upper: Array = field(repr=False)

    @property
    def supported(self) -> Mask:
        """(n,) whether a foot stands in the frame."""
        return np.asarray(self.stands.any(axis=1))

    @property
    def flies(self) -> bool:
        """Whether there is a frame in which no foot of a figure with feet stands."""
        return bool(self.feet) and not self.supported.all()

    @property
    def share(self) -> Array:
        """(n, nv) torque as a share of the strength in its direction; more than 1 is more than the person can."""
        limit = np.where(self.torque >= 0.0, self.upper, -self.lower)
        found: Array = np.abs(self.torque) / limit
        return found

    @property
    def largest_share(self) -> float:
        """The largest `share` of any joint in any frame."""
        return float(self.share.max(initial=0.0))

    @property
    def beyond(self) -> Mask:
        """(n,) frames in which a joint needs more than its strength."""
        return np.asarray((self.share > 1.0).any(axis=1))

    def largest(self) -> dict[str, float]:
        """Largest absolute torque of each joint over the clip, N m, by name."""
        peaks = np.abs(self.torque).max(axis=0)
        return {name: float(peaks[first:end].max()) for name, first, end in self._columns()}

    def joint_of(self, column: int) -> str:
        """Name of the joint of a column of `torque`."""
        column = checks.whole(column, "column", 0, self.figure.model.nv - 1)
        return next((name for name, first, end in self._columns() if first <= column < end), "root")

    def _columns(self) -> list[tuple[str, int, int]]:
        """Name of each joint, its first column of `torque`, and the one after its last."""
        joints = [(name, self.figure.model.joints[self.figure.joint_id(name)]) for name in self.figure.joints]
        return [(name, joint.idx_v, joint.idx_v + joint.nv) for name, joint in joints]

    def __str__(self) -> str:
        """Three lines: the joint nearest to its strength, what the ground cannot give, and how many frames stand."""
        share = self.share
        frame, column = (int(k) for k in np.unravel_index(np.argmax(share), share.shape))
        first = "no joint has a known strength"
        if np.isfinite(self.lower).any():
            first = (
                f"{self.joint_of(column)} needs {abs(self.torque[frame, column]):.0f} N m, {share[frame, column]:.0%} "
                f"of its strength, at {frame * self.dt:.2f} s; {int(self.beyond.sum())} of {len(self.torque)} frames "
                "need more than the strength of a joint"
            )
        force, moment = (np.linalg.norm(part, axis=1) for part in (self.missing[:, :3], self.missing[:, 3:]))
        return (
            f"{first}\nthe ground cannot give up to {force.max():.0f} N and {moment.max():.0f} N m (median "
            f"{np.median(force):.0f} N, {np.median(moment):.0f} N m)\na foot stands in {int(self.supported.sum())} of "
            f"{len(self.torque)} frames"
        )


def torques(
    clip: Clip,
    *,
    feet: Sequence[str] = FEET,
    strength: Strength | None = None,
    friction: float = 0.8,
    cutoff: float | None = CUTOFF,
) -> Torques:
    """Torques of a clip by inverse dynamics (recursive Newton-Euler, Featherstone 2008, chapter 5; `pin.rnea`).

    A figure with a free root stands on feet: the wrench that its motion needs at the root is split over the corners
    of the soles of the feet that stand, on level ground and with friction, and acts on the joints from there. In flight
    the ground gives nothing.

    Args:
        clip: the motion.
        feet: segments that may stand; the figure's own of these. A foot stands while its heel, ball or tip of the toes
            is low and slow; without frames of such names, while its own frame is.
        strength: of the person, for `lower`, `upper` and `share`; a man of median strength if left out. For figures
            whose joints have no published strength, such as robots, the effort limits of their descriptions count.
        friction: coefficient of friction of the ground.
        cutoff: Hz of the low-pass filter (Butterworth, zero lag) that takes the noise of recordings out before
            differences amplify it; None for none. It is not used where the frame rate is less than four times of it.

    Raises:
        UnknownNameError: the figure has no such foot.
        InputError: something else than a clip, a value out of range, or a figure without mass or feet.

    Examples:
        >>> needed = wb.motion.torques(clip, strength=wb.motion.Strength(50, "female"))
    """
    clip = checks.instance(clip, Clip, "torques: clip", "read one with wb.read_clip(path, figure)")
    friction = checks.number(friction, "torques: friction", 1e-3, 100.0)
    if cutoff is not None:
        cutoff = checks.number(cutoff, "torques: cutoff", 1e-3, 1e6, "Hz")
    strength = Strength() if strength is None else strength
    checks.instance(strength, Strength, "torques: strength", "give wb.motion.Strength(percentile=50, sex='female')")
    figure = one_figure(clip.figure, "torques: the clip's figure")
    if feet is FEET:
        feet = [name for name in FEET if name in figure.segments]
    feet = checks.listed(feet, "torques: feet", "['left_foot', 'right_foot']")
    for name in feet:
        figure.frame_id(name)
    if not sum(inertia.mass for inertia in figure.model.inertias[1:]) > 0.0:
        raise InputError(f"torques: {figure.name} has no mass; give its segments masses")
    return clip_torques(clip, standing_feet(clip, feet), strength, friction, cutoff)


def clip_torques(
    clip: Clip, stands: Mapping[str, Mask], strength: Strength, friction: float, cutoff: float | None
) -> Torques:
    """Torques of a clip that stands on given feet in given frames (foot -> (n,)); see `torques`."""
    figure, steady = clip.figure, smoothed(clip, cutoff)
    v, a = steady.velocities(), steady.accelerations()
    dynamics = InverseDynamics(figure, tuple(stands), friction)
    count, nv = len(clip), figure.model.nv
    torque, missing = np.zeros((count, nv)), np.zeros((count, ROOT))
    force, moment, pressure = (np.zeros((count, len(stands), 3)) for _ in range(3))
    both, outside = np.zeros((count, 3)), np.zeros(count)
    marks: Mask = np.array(list(stands.values()), dtype=bool).reshape(len(stands), count).T
    for k in range(count):
        stand = dynamics.stand(steady.q[k], marks[k].tolist())
        loads = dynamics.loads(steady.q[k], v[k], a[k], stand)
        torque[k] = loads.torque
        if not dynamics.free:
            continue
        forces = loads.ground.forces
        missing[k] = loads.ground.missing
        for foot, total in enumerate(foot_wrenches(forces, stand, dynamics.soles)):
            mine = stand.owner == foot
            force[k, foot] = total[:3]
            pressure[k, foot] = _pressure(forces[mine], stand.points[mine])
            moment[k, foot] = total[3:] - np.cross(pressure[k, foot], total[:3])
        both[k] = _pressure(forces, stand.points)
        outside[k] = dynamics.outside(loads, stand)
    lower, upper = torque_limits(figure, strength)
    return Torques(
        figure, clip.dt, torque, tuple(stands), force, moment, pressure, both, marks, missing, outside, lower, upper
    )


def smoothed(clip: Clip, cutoff: float | None = CUTOFF) -> Clip:
    """The clip without what is faster than a cutoff frequency, Hz: Butterworth, forward and backward (Winter).

    Postures are filtered value by value; quaternions are made continuous before and of unit length after. Ends are
    extended by reflection through the end point. A clip whose frame rate is less than four times the cutoff, or of one
    frame, stays as it is.
    """
    rate = 1.0 / clip.dt
    if cutoff is None or rate < 4.0 * cutoff:
        return clip
    from scipy.signal import butter, sosfiltfilt  # it loads scipy.stats, which takes longer than a short clip

    # it runs forward and backward, so without delay and with twice this order (Winter)
    sections = butter(2, cutoff, fs=rate, output="sos")
    reach = min(len(clip) - 1, int(np.ceil(3.0 * rate / cutoff)))
    if reach < 1:
        return clip
    q = _continuous(clip)
    steady = sosfiltfilt(sections, q, axis=0, padtype="odd", padlen=reach)
    return clip.with_q(np.array([pin.normalize(clip.figure.model, posture) for posture in steady]))


def _continuous(clip: Clip) -> Array:
    """Postures whose quaternions do not change sign from frame to frame."""
    q: Array = clip.q.copy()
    for joint in clip.figure.model.joints:
        if joint.nq in (4, 7) and joint.nv in (3, 6):
            part = q[:, joint.idx_q + joint.nq - 4 : joint.idx_q + joint.nq]
            turns = np.sign(np.einsum("ij,ij->i", part[1:], part[:-1]))
            part[1:] *= np.cumprod(np.where(turns < 0.0, -1.0, 1.0))[:, None]
    return q


def _pressure(forces: Array, points: Array) -> Array:
    """Centre of pressure (3,) of forces on points: weighted by their vertical components; zero without load."""
    load = float(forces[:, 2].sum())
    if load <= 0.0:
        return np.zeros(3)
    found: Array = forces[:, 2] @ points / load
    return found


TORQUE = 0.02
"""Share of its bound by which a torque may be beyond it: what filters and the frames in which feet stand change."""

PLACE = 2e-3
"""Metres by which the zero moment point may be farther outside, for the same reason."""

FORCE = 0.05
"""Share of the weight by which the ground may lack more force."""


@dataclass(frozen=True, eq=False)
class LoadChange:
    """Loads before and after a change."""

    __repr__ = brief

    before: Torques  # torques of the clip as it was
    after: Torques  # torques of the answer; both are those of `wb.motion.torques`
    times: Array  # (m,) place of each frame of the answer in the frames before

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and largest torque (nv,) that a joint may need: its strength, or the most that it needed before."""
        torque = self.before.torque
        return np.minimum(self.before.lower, torque.min(axis=0)), np.maximum(self.before.upper, torque.max(axis=0))

    @property
    def beyond(self) -> Array:
        """(nv,) share by which the largest torque of each joint is beyond its bound; 0 where it is not."""
        lower, upper = self.bounds
        with np.errstate(divide="ignore", invalid="ignore"):
            over = np.maximum(self.after.torque.max(axis=0) / upper, self.after.torque.min(axis=0) / lower) - 1.0
        known = np.isfinite(self.before.lower) | np.isfinite(self.before.upper)
        return np.where(known, np.maximum(np.nan_to_num(over, posinf=0.0, neginf=0.0), 0.0), 0.0)

    @property
    def farther(self) -> Array:
        """(m,) by how much farther the zero moment point is outside of the support than it was before, metres.

        A frame between two of those before is compared with the worse of both, and a foot stands there before if it
        stands in both. It is 0 where other feet stand than before: the support is another one.
        """
        old, last = self.before, len(self.before.outside) - 1
        first, second = (np.clip(near(self.times).astype(int), 0, last) for near in (np.floor, np.ceil))
        same = ((old.stands[first] & old.stands[second]) == self.after.stands).all(axis=1)
        past = self.after.outside - np.maximum(old.outside[first], old.outside[second])
        found: Array = np.where(same, np.maximum(past, 0.0), 0.0)
        return found

    @property
    def unsupported(self) -> Array:
        """(m,) share of the weight by which the ground lacks more of the force that the motion needs than before.

        It is compared with the largest lack before within 0.1 s, as feet may leave the ground so much earlier or later.
        Feet that no longer stand give nothing, and a flight that is slowed needs a force.
        """
        old, new = (np.linalg.norm(loads.missing[:, :3], axis=1) for loads in (self.before, self.after))
        reach, figure = max(1, round(0.1 / self.after.dt)), self.after.figure
        near = sliding_window_view(np.pad(old, reach), 2 * reach + 1).max(axis=1)
        places = np.clip(np.rint(self.times).astype(int), 0, len(old) - 1)
        weight = pin.computeTotalMass(figure.model) * float(np.linalg.norm(figure.model.gravity.linear))
        found: Array = np.maximum(new - near[places], 0.0) / max(weight, np.finfo(float).tiny)
        return found

    @property
    def missed(self) -> list[str]:
        """Sentences on loads beyond their bounds: which, by how much, where, what is allowed, and what was before."""
        said, joint, frame = list[str](), int(np.argmax(self.beyond)), int(np.argmax(self.farther))
        if self.beyond[joint] > TORQUE:
            said.append(self._torque_missed(joint))
        unsupported, floating = self.unsupported, int(np.argmax(self.unsupported))
        if unsupported[floating] > FORCE:
            said.append(
                f"the ground lacks {unsupported[floating]:.0%} of the weight more than before at "
                f"{floating * self.after.dt:.2f} s, where {FORCE:.0%} are allowed, and too much in "
                f"{int((unsupported > FORCE).sum())} frames: feet have left the ground, or a flight is another one"
            )
        if self.farther[frame] > PLACE:
            said.append(
                f"the zero moment point is {1e3 * self.farther[frame]:.3g} mm farther outside of the feet than before "
                f"at {frame * self.after.dt:.2f} s, where {1e3 * PLACE:g} mm are allowed, and too far in "
                f"{int((self.farther > PLACE).sum())} frames; {self._support(frame)}"
            )
        return said

    def plot(self) -> Any:
        """Draw torques, forces of the ground and the zero moment point over time, a matplotlib figure.

        The torques are those of the four joints that come nearest to their strength, in parts of it. What was before is
        dashed, at the times of the answer's frames.
        """
        chart, (axes,) = new_chart(1, 3, (12.0, 2.8))
        shares = np.maximum(self.after.share.max(axis=0), self.before.share.max(axis=0))
        joints = [k for k in np.argsort(-shares)[:4].tolist() if shares[k] > 0.0]
        for loads, style, times in (
            (self.before, "--", np.interp(np.arange(len(self.before.torque)), self.times, np.arange(len(self.times)))),
            (self.after, "-", np.arange(len(self.times))),
        ):
            t = times * self.after.dt
            curves = [
                [(loads.joint_of(k), loads.share[:, k]) for k in joints],
                [(name, loads.force[:, k, 2]) for k, name in enumerate(loads.feet)],
                [("zero moment point", 1e3 * loads.outside)],
            ]
            for axis, each in zip(axes, curves, strict=True):
                for number, (name, values) in enumerate(each):
                    axis.plot(t, values, style, color=f"C{number}", label=plain(name) if style == "-" else None)
        for axis, said in zip(axes, ("torque [strength]", "force upwards [N]", "outside of feet [mm]"), strict=True):
            axis.set(xlabel="time [s]", ylabel=said)
            if axis.lines:
                axis.legend(fontsize="x-small")
        return chart

    def _torque_missed(self, joint: int) -> str:
        """The sentence on a torque that is beyond its bound."""
        old, (lower, upper), now = self.before, self.bounds, self.after.torque[:, joint]
        high = now.max() / upper[joint] >= now.min() / lower[joint]
        sign, bound, strength = (1.0, upper, old.upper) if high else (-1.0, -lower, -old.lower)
        needed, before = sign * now, max(float((sign * old.torque[:, joint]).max()), 0.0)
        kept = "beyond" if before > strength[joint] else "within"
        others = int((self.beyond > TORQUE).sum()) - 1
        return (
            f"{old.joint_of(joint)} needs {needed.max():.4g} N m at {int(needed.argmax()) * self.after.dt:.2f} s, "
            f"{self.beyond[joint]:.1%} more than its bound of {bound[joint]:.4g} N m, where {TORQUE:.0%} are allowed; "
            f"before it needed at most {before:.4g} N m, {kept} its strength of {strength[joint]:.4g} N m"
            + (f"; {others} more joint{'s are' if others > 1 else ' is'} beyond" if others else "")
        )

    def _support(self, frame: int) -> str:
        """Where the zero moment point of a frame is, and was."""
        now, was = 1e3 * self.after.outside[frame], 1e3 * (self.after.outside[frame] - self.farther[frame])
        feet = " and ".join(
            name for name, stands in zip(self.after.feet, self.after.stands[frame], strict=True) if stands
        )
        before = f"{was:.3g} mm" if was > 1e-3 else "within it"
        return f"it is {now:.3g} mm outside of the support of {feet} there, and was {before} before"

    def __str__(self) -> str:
        """One sentence."""
        was, now = self.before, self.after
        return (
            f"most torque {was.largest_share:.0%} of a strength before, {now.largest_share:.0%} after; zero moment "
            f"point up to {1e3 * was.outside.max():.0f} mm outside before, {1e3 * now.outside.max():.0f} mm after"
        )


def load_change(
    before: Torques, after: Clip, places: Array | None, strength: Strength, feet: Sequence[str]
) -> LoadChange:
    """Compare the loads of a clip before and after a change, whose frames are at places (m,) of those before."""
    places = np.arange(len(after), dtype=np.float64) if places is None else places
    return LoadChange(before, torques(after, feet=feet, strength=strength), places)
