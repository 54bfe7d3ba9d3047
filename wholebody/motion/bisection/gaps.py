"""After the recursion: what is held is made to hold in interpolated frames, and dips between frames are removed."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.motion.avoider import Watch
from wholebody.motion.bisection.path_planes import path_planes
from wholebody.motion.bisection.prediction import Prediction, Predictor
from wholebody.motion.bisection.recursion import Recursion
from wholebody.scene import Scene
from wholebody.workspace import Workspace

PLACES = 9  # postures of a gap at which the depth of a dip is measured
ADDED = 5e-4  # m: what the margin of a pair gets beyond the depth of its dip; arcs between frames are shorter
FAR = 0.1  # m: a pair farther apart at one of the two frames needs no margin there
SHALLOW = 2e-3  # m: a deeper dip is no arc between two postures that touch
MARGINS, MIDDLES, FORWARD, BACKWARD = 3, 2, 2, 1  # visits of a gap by each way to close it, before the next way
BESIDE = 2  # frames to each side of a gap that get a share of its displacement, so that no frame jumps


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
        self._widened, self._passes = np.zeros((2, max(0, len(recursion.q) - 1)), dtype=int)
        self.left: dict[int, str] = {}

    def close(self) -> None:
        """Sweep all gaps and remove dips, from the first frame on."""
        bad, gaps = self._recursion.bad, len(self._passes)
        waiting = set(range(gaps))
        while waiting and not self._watch.ended:
            gap = min(waiting)
            waiting.remove(gap)
            pair = self._dip(gap)
            if pair is None:
                self.left.pop(gap, None)
                continue
            first, second = (self._workspace.owners[piece] for piece in self._workspace.table.pairs[pair])
            self.left[gap] = f"{first} and {second}"
            if bad[gap] or bad[gap + 1] or self._passes[gap] >= MIDDLES + FORWARD + BACKWARD:
                continue
            self._watch.tell(1.0 - len(waiting) / gaps, f"between frames {gap} and {gap + 1}")
            for frame in self._closed(gap, pair):
                waiting |= {near for near in (frame - 1, frame) if 0 <= near < gaps}

    def _dip(self, gap: int) -> int | None:
        """The pair that dips first in a gap."""
        q = self._recursion.q
        found = self._workspace.sweep.first_contact(q[gap], q[gap + 1], tolerance=self._overlap)
        return None if found is None else found.index

    def _deepest(self, gap: int, pair: int) -> tuple[float, float]:
        """Deepest overlap of a pair in a gap, metres, and the share of the way at which it is."""
        found = (0.0, 0.5)
        for share in np.linspace(0.0, 1.0, PLACES)[1:-1].tolist():
            near = self._workspace.near(self._between(gap, share), 0.0)
            found = max(found, (float(-near.distance[near.number == pair].min(initial=0.0)), share))
        return found

    def _between(self, gap: int, share: float) -> Array:
        q = self._recursion.q
        return np.asarray(pin.interpolate(self._scene.model, q[gap], q[gap + 1], share))

    def _closed(self, gap: int, pair: int) -> list[int]:
        """Change frames at a gap; returns those that changed.

        A shallow dip is an arc between two postures that nearly touch: both get a larger margin. A deeper one passes
        through something: the posture in between is predicted, and the frames beside get its displacement. What is
        still on two sides of something after that gets on one: a frame is predicted from the one before it, or after.
        """
        depth, share = self._deepest(gap, pair)
        if depth <= SHALLOW and self._widened[gap] < MARGINS:
            self._widened[gap] += 1
            return self._widen(gap, pair, depth)
        self._passes[gap] += 1
        if self._passes[gap] <= MIDDLES:
            return self._displace(gap, share)
        frame, beside = (gap + 1, gap) if self._passes[gap] <= MIDDLES + FORWARD else (gap, gap + 1)
        start = self._recursion.applied(frame, self._recursion.q[beside])
        return self._moved(frame, self._counted(self._predictor.predict(frame, start)))

    def _widen(self, gap: int, pair: int, depth: float) -> list[int]:
        """Predict both frames of a gap with a larger margin of a pair."""
        moved = []
        for frame in (gap, gap + 1):
            q, margins = self._recursion.q[frame], self._margins[frame]
            margins[pair] = max(margins.get(pair, 0.0), self._distance(q, pair)) + depth + ADDED
            found = self._predictor.predict(frame, q, margins=margins, effort_from=q)
            moved += self._moved(frame, self._counted(found))
        return moved

    def _displace(self, gap: int, share: float) -> list[int]:
        """Predict a posture within a gap, and move the frames beside it as far as that one moved."""
        model, q, original = self._scene.model, self._recursion.q, self._predictor.original
        middle = self._between(gap, share)
        way = np.array([middle, q[gap + 1]])
        planes = path_planes(self._scene.figure, way, 0, self._recursion.joints, self._workspace.state)
        meant = np.asarray(pin.interpolate(model, original[gap], original[gap + 1], share))
        for through in (planes, []) if planes else ([],):
            found = self._counted(self._predictor.predict(gap, middle, through, original=meant, effort_from=middle))
            if found.free:
                break
        else:
            return []
        away = pin.difference(model, middle, found.q)
        moved = []
        for frame in range(max(0, gap - BESIDE), min(len(q), gap + 2 + BESIDE)):
            beyond = max(gap - frame, frame - gap - 1, 0)
            near = np.asarray(pin.integrate(model, q[frame], away * (1.0 - beyond / (BESIDE + 1))))
            near = self._recursion.applied(frame, near)
            if self._predictor.good(frame, near):
                q[frame] = near
                moved.append(frame)
            elif not beyond:
                moved += self._moved(frame, self._counted(self._predictor.predict(frame, near, effort_from=near)))
        return moved

    def _counted(self, found: Prediction) -> Prediction:
        self._recursion.predictions += 1
        self._recursion.programs += found.programs
        return found

    def _moved(self, frame: int, found: Prediction) -> list[int]:
        if not found.good:
            return []
        self._recursion.q[frame] = found.q
        return [frame]

    def _distance(self, q: Array, pair: int) -> float:
        """Distance of a pair in a posture, metres; 0 where it is far."""
        near = self._workspace.near(q, FAR)
        found = near.distance[near.number == pair]
        return max(0.0, float(found[0])) if len(found) else 0.0
