"""Loads of a clip before and after a change: the judgement of `avoid(..., dynamics=True)`, apart from every method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array, Indices, Mask
from wholebody.figures.figure import Figure
from wholebody.motion.clip import Clip
from wholebody.motion.frame_terms import FrameTerms, between
from wholebody.motion.inverse_dynamics import InverseDynamics, Stand
from wholebody.motion.strength import Strength
from wholebody.motion.torques import CUTOFF, Torques, clip_torques, smoothed

FRICTION = 0.8
TORQUE = 0.02
"""Share of its bound by which a torque may be beyond it: what the filter of recordings and rounding change."""

PLACE = 2e-3
"""Metres by which the zero moment point may be farther outside, for the same reason."""


@dataclass(frozen=True, eq=False)
class LoadChange:
    """Loads before and after.

    Attributes:
        before: torques of the clip as it was.
        after: torques of the answer, on the feet that stood before.
        times: (m,) place of each frame of the answer in the frames before.
    """

    before: Torques
    after: Torques
    times: Array

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

        A frame between two of those before is compared with the worse of both.
        """
        outside, last = self.before.outside, len(self.before.outside) - 1
        was = [outside[np.clip(near(self.times).astype(int), 0, last)] for near in (np.floor, np.ceil)]
        found: Array = np.maximum(self.after.outside - np.maximum(*was), 0.0)
        return found

    @property
    def kept(self) -> bool:
        """Whether no load is beyond its bound."""
        return float(self.beyond.max(initial=0.0)) <= TORQUE and float(self.farther.max(initial=0.0)) <= PLACE

    def __str__(self) -> str:
        """One sentence."""
        was, now = self.before, self.after
        said = (
            f"most torque {was.largest_share:.0%} of a strength before, {now.largest_share:.0%} after; zero moment "
            f"point up to {1e3 * was.outside.max():.0f} mm outside before, {1e3 * now.outside.max():.0f} mm after"
        )
        if self.kept:
            return said
        joint, frame = int(np.argmax(self.beyond)), int(np.argmax(self.farther))
        if self.beyond[joint] > TORQUE:
            said += f"; {self.before.joint_of(joint)} needs {self.beyond[joint]:.0%} more than its bound"
        if self.farther[frame] > PLACE:
            said += f"; in frame {frame} the zero moment point is {1e3 * self.farther[frame]:.0f} mm farther outside"
        return said


def load_change(
    before: Clip, after: Clip, times: Array | None, stands: Mapping[str, Mask], strength: Strength,
    terms: FrameTerms,
) -> LoadChange:  # fmt: skip
    """Compare the loads of two clips. The feet of both stand in the same places, those that are held beside them too.

    The clip before is filtered, as recordings are noisy; a slowed clip, when it is slowed. What was changed is no
    recording; see `on_filtered`.

    Args:
        before: the clip as it was.
        after: what was made of it.
        times: (m,) seconds of the clip before at which each frame of the other one is; None for the same ones.
        stands: foot -> (n,) frames before in which it stands.
        strength: of the person.
        terms: what was held, of the clip before.
    """
    places = np.arange(len(before), dtype=np.float64) if times is None else times / before.dt
    frames = standing_frames(places, np.sum([np.zeros(len(before)), *stands.values()], axis=0))
    marks = {foot: each[frames] for foot, each in stands.items()}
    dynamics = InverseDynamics(before.figure, tuple(stands), FRICTION)
    steady = smoothed(before, CUTOFF)
    _, soles = soles_of(dynamics, steady.q, stands, terms)
    old = clip_torques(steady, stands, strength, FRICTION, None)
    original = before.q if times is None else between(before.figure.model, before.q, places)
    changed = after.with_q(on_filtered(before.figure, original, after.q, before.dt))
    new = clip_torques(changed, marks, strength, FRICTION, None, [soles[frame] for frame in frames.tolist()])
    return LoadChange(old, new, places)


def on_filtered(figure: Figure, original: Array, changed: Array, dt: float) -> Array:
    """(n, nq) postures whose loads are those of changed postures of a recording.

    Differences of a recording amplify its noise, so it is filtered. Filtering what was changed would hide how fast it
    changes; so the change is taken as it is, on top of the filtered recording.

    Args:
        figure: of the postures.
        original: (n, nq) of the recording.
        changed: (n, nq) made of them.
        dt: seconds from frame to frame.
    """
    model, steady = figure.model, smoothed(Clip(figure, original, dt), CUTOFF).q
    each = zip(steady, original, changed, strict=True)
    return np.array([pin.integrate(model, base, pin.difference(model, was, now)) for base, was, now in each])


def standing_frames(places: Array, feet: Array) -> Indices:
    """(m,) frames of a clip whose standing feet are those at places between its frames.

    A foot stands from the first frame in which it stands to the last one. So it stands between two frames if it stands
    in both: a foot that leaves the ground after a frame bears nothing a quarter of a frame later. So of the two frames
    it is the one in which fewer feet stand, or else the nearer one.

    Args:
        places: (m,) in frames.
        feet: (n,) how many feet stand in each frame.
    """
    near, below, above = (np.clip(to(places).astype(int), 0, len(feet) - 1) for to in (np.rint, np.floor, np.ceil))
    fewer = np.where(feet[below] < feet[above], below, above)
    found: Indices = np.where(feet[below] == feet[above], near, fewer)
    return found


def soles_of(
    dynamics: InverseDynamics, q: Array, stands: Mapping[str, Mask], terms: FrameTerms
) -> tuple[list[Stand], list[Stand]]:
    """Where each of postures (n, nq) stands, and where it stands while its feet are held; often the same objects.

    Args:
        dynamics: with the feet that stand.
        q: the postures.
        stands: foot -> (n,) frames in which it stands.
        terms: what is held.
    """
    own = [dynamics.stand(posture, [bool(marks[k]) for marks in stands.values()]) for k, posture in enumerate(q)]
    joints = dynamics.soles.joints
    return own, [stand.shifted([terms.shift(k, joint) for joint in joints]) for k, stand in enumerate(own)]
