"""Loads of a clip before and after a change: the judgement of `avoid(..., dynamics=True)`, apart from every method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wholebody.base.arrays import Array
from wholebody.motion.clip import Clip
from wholebody.motion.clip_torques import Torques, torques
from wholebody.motion.strength import Strength

TORQUE = 0.02
"""Share of its bound by which a torque may be beyond it: what filters and the frames in which feet stand change."""

PLACE = 2e-3
"""Metres by which the zero moment point may be farther outside, for the same reason."""


@dataclass(frozen=True, eq=False)
class LoadChange:
    """Loads before and after.

    Attributes:
        before: torques of the clip as it was.
        after: torques of the answer; both are those of `wb.motion.torques`.
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
    before: Torques, after: Clip, places: Array | None, strength: Strength, feet: Sequence[str]
) -> LoadChange:
    """Compare the loads of a clip before and after a change, both as `wb.motion.torques` measures them.

    Args:
        before: torques of the clip as it was.
        after: what was made of it.
        places: (m,) place of each frame of it in the frames before; None for the same ones.
        strength: of the person.
        feet: segments that may stand.
    """
    places = np.arange(len(after), dtype=np.float64) if places is None else places
    return LoadChange(before, torques(after, feet=feet, strength=strength), places)
