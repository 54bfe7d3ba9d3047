"""The recursion of figure 3.2 of the thesis: predict a middle frame, interpolate beside it, go into both halves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from wholebody.arrays import Array, Mask
from wholebody.figures.state import State
from wholebody.motion.avoider import Watch
from wholebody.motion.bisection.groups import Group, collision_groups
from wholebody.motion.bisection.interpolation import Kind, fill
from wholebody.motion.bisection.path_planes import path_planes
from wholebody.motion.bisection.prediction import Predictor
from wholebody.motion.bisection.stays import Stays
from wholebody.scene import Scene


class Recursion:
    """One run on one clip.

    Every frame that was predicted is a key: it never changes again here, and groups end at keys. So each group has
    fewer frames than the one that it is a part of, and the recursion ends after at most one prediction a frame, whether
    predictions succeed or not.

    Attributes:
        q: (n, nq) the present postures.
        bad: (n,) which of them overlap.
        keys: frames that were predicted and are free, and evaluation points.
        joints: frames with plane constraints.
        stuck: frames whose prediction failed, and what overlaps there.
        predictions: number of postures that were solved for.
        programs: number of quadratic programs of these.
    """

    def __init__(
        self,
        scene: Scene,
        predictor: Predictor,
        stays: Stays,
        joints: Sequence[str],
        share: float,
        least: int,
        kind: Kind,
        watch: Watch,
    ) -> None:
        """Take the settings; `joints` are the frames with plane constraints."""
        self._scene, self._predictor, self._stays, self.joints = scene, predictor, stays, tuple(joints)
        self._share, self._least, self._kind, self._watch = share, least, kind, watch
        self._state = State(scene.model)
        self.q = np.array(predictor.original)
        self.bad: Mask = np.array([not predictor.free(posture) for posture in self.q])
        self.at_first = int(self.bad.sum())
        self.keys: set[int] = set()
        self.stuck: dict[int, str] = {}
        self.predictions = self.programs = 0

    def run(self, evaluation: Iterable[int]) -> None:
        """Free the evaluation points and both ends, then everything between them."""
        last = len(self.q) - 1
        points = sorted({0, last, *evaluation})
        corrected = [frame for frame in points if self.bad[frame]]
        for frame in corrected:
            self._key(frame)
        self.keys.update(points)
        for frame in corrected:
            if frame not in self.stuck:
                self._fill_around(frame)
        for low, high in pairwise(points):
            self._between(low, high)

    def _fill_around(self, frame: int) -> None:
        """Interpolate frames that overlap beside a corrected point, up to the first free one or another key."""
        for step in (-1, 1):
            end = frame + step
            while 0 <= end < len(self.q) and self.bad[end] and end not in self.keys:
                end += step
            if 0 <= end < len(self.q):
                self._fill(min(frame, end), frame, max(frame, end))

    def _between(self, low: int, high: int) -> None:
        """Free the frames between two that stay."""
        waiting = [(low, high)]
        while waiting and not self._watch.ended:
            low, high = waiting.pop()
            for group in collision_groups(self.bad, low, high, self._share, self._least):
                if self._bisect(group):
                    waiting += [(group.first - 1, group.middle), (group.middle, group.last + 1)]

    def _bisect(self, group: Group) -> bool:
        """Predict the middle and interpolate the others; whether the middle is free now."""
        if not self._key(group.middle):
            return False
        self._fill(group.first - 1, group.middle, group.last + 1)
        return True

    def _key(self, frame: int) -> bool:
        """Predict the posture of a frame: with planes, then without, then from the nearest free postures beside it."""
        if self._watch.tell(self.share_done(), f"frame {frame}"):
            return False
        planes = path_planes(self._scene.figure, self.q, frame, self.joints, self._state)
        free = np.flatnonzero(~self.bad)
        starts = [self.q[frame], *(self.q[side] for side in (*free[free < frame][-1:], *free[free > frame][:1]))]
        attempts = [(starts[0], planes)] if planes else []
        attempts += [(start, []) for start in starts]
        for start, through in attempts:
            found = self._predictor.predict(frame, self._stays.applied(frame, start), through)
            self.predictions += 1
            self.programs += found.programs
            if found.good:
                self.q[frame], self.bad[frame] = found.q, False
                self.keys.add(frame)
                return True
        self.stuck[frame] = self._predictor.deepest(found.q) or "what is held there cannot hold"
        return False

    def _fill(self, a: int, m: int, b: int) -> None:
        fill(self._scene.model, self.q, a, m, b, self._kind)
        for frame in range(a + 1, b):
            if frame != m:
                self.q[frame] = self._stays.applied(frame, self.q[frame])
                self.bad[frame] = not self._predictor.free(self.q[frame])

    def applied(self, frame: int, q: Array) -> Array:
        """A posture of a frame with what stays there; see `Stays`."""
        return self._stays.applied(frame, q)

    def share_done(self) -> float:
        """Share of the frames that overlapped at first which no longer do."""
        return 1.0 - int(self.bad.sum()) / max(1, self.at_first)


def changed_frames(original: Array, q: Array) -> list[int]:
    """Frames (n, nq) that differ."""
    return [int(frame) for frame in np.flatnonzero((original != q).any(axis=1))]
