"""Loads of a clip before and after a change: what is beyond strength or support, in words and as curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import sliding_window_view

from wholebody.base.arrays import Array, Mask, brief
from wholebody.base.errors import millimetres
from wholebody.motion.clip_torques import Torques

TORQUE = 0.02
"""Share of its bound by which a torque may be beyond it: what filters and the frames in which feet stand change."""

PLACE = 2e-3  # metres by which the zero moment point may be farther outside, for the same reason

FORCE = 0.05  # share of the weight by which the ground may lack more force


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
        torque = self.before.strained
        return np.minimum(self.before.lower, torque.min(axis=0)), np.maximum(self.before.upper, torque.max(axis=0))

    @property
    def beyond(self) -> Array:
        """(nv,) share by which the largest torque of each joint is beyond its bound; 0 where it is not."""
        lower, upper = self.bounds
        with np.errstate(divide="ignore", invalid="ignore"):
            over = np.maximum(self.after.strained.max(axis=0) / upper, self.after.strained.min(axis=0) / lower) - 1.0
        known = np.isfinite(self.before.lower) | np.isfinite(self.before.upper)
        return np.where(known, np.maximum(np.nan_to_num(over, posinf=0.0, neginf=0.0), 0.0), 0.0)

    @property
    def farther(self) -> Array:
        """(m,) by how much farther [m] the zero moment point is out than before, or than the worse of two frames."""
        # 0 where other feet stand than before, or other parts touch: the support is another one
        old, last = self.before, len(self.before.outside) - 1
        first, second = (np.clip(near(self.times).astype(int), 0, last) for near in (np.floor, np.ceil))
        was, now = (_marks(loads, (*old.feet, *self.after.feet)) for loads in (old, self.after))
        same = ((was[first] & was[second]) == now).all(axis=1)
        past = self.after.outside - np.maximum(old.outside[first], old.outside[second])
        return np.asarray(np.where(same, np.maximum(past, 0.0), 0.0))

    @property
    def unsupported(self) -> Array:
        """(m,) share of the weight that the ground lacks beyond the most that it lacked before within 0.1 s."""
        old, new = (np.linalg.norm(loads.missing[:, :3], axis=1) for loads in (self.before, self.after))
        reach, figure = max(1, round(0.1 / self.after.dt)), self.after.figure
        near = sliding_window_view(np.pad(old, reach), 2 * reach + 1).max(axis=1)
        places = np.clip(np.rint(self.times).astype(int), 0, len(old) - 1)
        weight = pin.computeTotalMass(figure.model) * float(np.linalg.norm(figure.model.gravity.linear))
        return np.asarray(np.maximum(new - near[places], 0.0) / max(weight, np.finfo(float).tiny))

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
                f"the zero moment point is {millimetres(self.farther[frame])} farther outside of the feet than before "
                f"at {frame * self.after.dt:.2f} s, where {1e3 * PLACE:g} mm are allowed, and too far in "
                f"{int((self.farther > PLACE).sum())} frames; {self._support(frame)}"
            )
        return said

    def _torque_missed(self, joint: int) -> str:
        old, (lower, upper), now = self.before, self.bounds, self.after.strained[:, joint]
        high = now.max() / upper[joint] >= now.min() / lower[joint]
        sign, bound, strength = (1.0, upper, old.upper) if high else (-1.0, -lower, -old.lower)
        needed, before = sign * now, max(float((sign * old.strained[:, joint]).max()), 0.0)
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
        now, was = self.after.outside[frame], self.after.outside[frame] - self.farther[frame]
        feet = " and ".join(
            name for name, stands in zip(self.after.feet, self.after.stands[frame], strict=True) if stands
        )
        before = millimetres(was) if was > 1e-6 else "within it"
        return f"it is {millimetres(now)} outside of the support of {feet} there, and was {before} before"

    def __str__(self) -> str:
        was, now = self.before, self.after
        return (
            f"most torque {was.largest_share:.0%} of a strength before, {now.largest_share:.0%} after; zero moment "
            f"point up to {1e3 * was.outside.max():.0f} mm outside before, {1e3 * now.outside.max():.0f} mm after"
        )


class LoadCurves(NamedTuple):
    """One chart: its title, the unit, and lines with a name and a value a frame (n,)."""

    title: str
    unit: str
    lines: list[tuple[str, Array]]


def telling(loads: Sequence[Torques]) -> list[int]:
    """The columns of `torque` of the four joints nearest to their strength, or else need the largest torques."""
    most = np.max([each.share.max(axis=0) for each in loads], axis=0)
    if not most.any():
        most = np.max([np.abs(each.torque).max(axis=0) for each in loads], axis=0)
        most[: 6 if loads[0].figure.root == "free" else 0] = 0.0  # what is missing
    return [column for column in np.argsort(-most)[:4].tolist() if most[column] > 0.0]


def load_curves(loads: Torques, columns: Sequence[int]) -> tuple[LoadCurves, LoadCurves, LoadCurves]:
    """Torques of some columns, in parts of strength where one is known; forces on feet; the zero moment point."""
    known = bool(columns) and bool(np.isfinite(loads.share[:, columns]).all() and loads.share[:, columns].any())
    values, unit = (100.0 * loads.share, "% of strength") if known else (loads.torque, "N m")
    forces = [(name, np.linalg.norm(loads.force[:, k], axis=1)) for k, name in enumerate(loads.feet)]
    return (
        LoadCurves("torque", unit, [(loads.joint_of(column), values[:, column]) for column in columns]),
        LoadCurves("force", "N", forces),
        LoadCurves("zero moment point outside of the feet", "mm", [("zero moment point", 1e3 * loads.outside)]),
    )


def _marks(loads: Torques, names: Sequence[str]) -> Mask:
    """(n, names) which of these feet and other parts bear in each frame."""
    found: Mask = np.zeros((len(loads.stands), len(names)), dtype=bool)
    for number, name in enumerate(names):
        if name in loads.feet:
            found[:, number] = loads.stands[:, loads.feet.index(name)]
    return found
