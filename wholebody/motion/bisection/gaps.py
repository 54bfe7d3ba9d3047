"""After the recursion: what is held is made to hold in interpolated frames, and dips between frames are removed."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.motion.avoider import Watch
from wholebody.motion.bisection.prediction import Prediction, Predictor
from wholebody.motion.bisection.recursion import Recursion
from wholebody.scene import Scene
from wholebody.workspace import Workspace

PLACES = 9  # postures of a gap at which the depth of a dip is measured
ADDED = 5e-4  # m: what the margin of a pair gets beyond the depth of its dip; arcs between frames are shorter
FAR = 0.1  # m: a pair farther apart at one of the two frames needs no margin there
THROUGH = 2e-3  # m: a deeper dip is no arc between two postures that touch, but passes through something
WIDENINGS = 3  # of margins at a gap, before its frames are predicted from each other
VISITS = 5  # of a gap; what did not help so often does not help


def hold_between(recursion: Recursion, predictor: Predictor, changed: list[int], watch: Watch) -> list[int]:
    """Move interpolated frames to the nearest posture in which everything holds; returns those that have none."""
    failed = []
    for number, frame in enumerate(changed):
        q = recursion.q[frame]
        if predictor.holds(frame, q):
            continue
        if watch.tell(number / len(changed), f"holds of frame {frame}"):
            break
        found = predictor.predict(frame, q, effort_from=q)
        recursion.predictions += 1
        recursion.programs += found.programs
        if found.good:
            recursion.q[frame] = found.q
        else:
            failed.append(frame)
    return failed


class Gaps:
    """Sweeps between consecutive frames; a gap that dips is a group of its two frames, which get larger margins.

    Attributes:
        left: gaps that still dip, by the frame before, and the pair in words.
    """

    def __init__(
        self,
        scene: Scene,
        recursion: Recursion,
        predictor: Predictor,
        workspace: Workspace,
        overlap: float,
        watch: Watch,
    ) -> None:
        """Take the run's parts; `overlap` is the depth that a sweep ignores, metres."""
        self._scene, self._recursion, self._predictor = scene, recursion, predictor
        self._workspace, self._overlap, self._watch = workspace, overlap, watch
        self._margins: list[dict[int, float]] = [{} for _ in recursion.q]
        self._visits = np.zeros(max(0, len(recursion.q) - 1), dtype=int)
        self.left: dict[int, str] = {}

    def close(self) -> None:
        """Sweep all gaps and remove dips."""
        waiting = list(range(len(self._recursion.q) - 1))[::-1]
        stuck = set(self._recursion.stuck)
        while waiting and not self._watch.ended:
            gap = waiting.pop()
            pair = self._dip(gap)
            if pair is None:
                self.left.pop(gap, None)
                continue
            first, second = (self._workspace.owners[piece] for piece in self._workspace.table.pairs[pair])
            self.left[gap] = f"{first} and {second}"
            bad = self._recursion.bad
            if bad[gap] or bad[gap + 1] or {gap, gap + 1} & stuck or self._visits[gap] >= VISITS:
                continue
            self._visits[gap] += 1
            self._watch.tell(1.0 - len(waiting) / len(bad), f"between frames {gap} and {gap + 1}")
            moved = self._close(gap, pair)
            waiting += [near for near in (gap + 1, gap, gap - 1) if 0 <= near < len(self._visits)] if moved else []

    def _dip(self, gap: int) -> int | None:
        """The pair that dips first in a gap."""
        q = self._recursion.q
        found = self._workspace.sweep.first_contact(q[gap], q[gap + 1], tolerance=self._overlap)
        return None if found is None else found.index

    def _depth(self, gap: int, pair: int) -> float:
        """Deepest overlap of a pair in a gap, metres."""
        deepest = 0.0
        for share in np.linspace(0.0, 1.0, PLACES):
            near = self._workspace.near(self._between(gap, float(share)), 0.0)
            deepest = max(deepest, float(-near.distance[near.number == pair].min(initial=0.0)))
        return deepest

    def _between(self, gap: int, share: float) -> Array:
        q = self._recursion.q
        return np.asarray(pin.interpolate(self._scene.model, q[gap], q[gap + 1], share))

    def _close(self, gap: int, pair: int) -> bool:
        """Predict the frames of a gap anew; whether one of them is new.

        A shallow dip is an arc between two postures beside each other, and both get a larger margin. A deep one passes
        through something: then one frame is predicted from the other, on the same side.
        """
        depth, visit = self._depth(gap, pair), int(self._visits[gap])
        if depth > THROUGH or visit > WIDENINGS:
            frame, beside = (gap + 1, gap) if visit < VISITS else (gap, gap + 1)
            start = self._recursion.applied(frame, self._recursion.q[beside])
            return self._move(frame, self._predictor.predict(frame, start))
        moved = False
        for frame in (gap, gap + 1):
            q, margins = self._recursion.q[frame], self._margins[frame]
            margins[pair] = max(margins.get(pair, 0.0), self._distance(q, pair)) + depth + ADDED
            moved |= self._move(frame, self._predictor.predict(frame, q, margins=margins, effort_from=q))
        return moved

    def _move(self, frame: int, found: Prediction) -> bool:
        self._recursion.predictions += 1
        self._recursion.programs += found.programs
        if found.good:
            self._recursion.q[frame] = found.q
        return found.good

    def _distance(self, q: Array, pair: int) -> float:
        """Distance of a pair in a posture, metres; 0 where it is far."""
        near = self._workspace.near(q, FAR)
        found = near.distance[near.number == pair]
        return max(0.0, float(found[0])) if len(found) else 0.0
