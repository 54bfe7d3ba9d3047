"""The recursion of figure 3.2 of the thesis: predict a middle frame, interpolate beside it, go into both halves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.figures.state import State
from wholebody.motion.bisection.prediction import Prediction, Predictor, path_planes
from wholebody.motion.windows import runs
from wholebody.tasks import Plane


class Group(NamedTuple):
    """Consecutive frames, the last one included.

    Attributes:
        first: the first frame.
        last: the last frame.
        middle: the frame that bisects what collides.
    """

    first: int
    last: int
    middle: int


def collision_groups(bad: Mask, low: int, high: int, share: float = 0.0, least: int = 1) -> list[Group]:
    """Groups of the frames that collide between two frames that stay.

    Each maximal run is widened on both sides by a share of its number of frames, rounded, and to the least number of
    frames, as far as there is room. Runs whose wider groups overlap, or have no frame in between, become one group.

    Args:
        bad: (n,) which frames collide.
        low: the frame before the first one that may change.
        high: the frame after the last one that may change.
        share: of the number of frames in a run, by which it is widened to each side.
        least: number of frames that a group has at least, where there is room.
    """
    first, last = low + 1, high - 1
    found: list[tuple[int, int, list[tuple[int, int]]]] = []
    for run in runs(bad[first : last + 1]):
        begin, end = first + run.first, first + run.end - 1
        wide = _widened(begin, end, round((end - begin + 1) * share), least, first, last)
        covered = [(begin, end)]
        while found and wide[0] <= found[-1][1] + 1:
            before = found.pop()
            wide = min(before[0], wide[0]), max(before[1], wide[1])
            covered = before[2] + covered
        found.append((*wide, covered))
    return [Group(begin, end, _middle(covered)) for begin, end, covered in found]


def _widened(begin: int, end: int, buffer: int, least: int, first: int, last: int) -> tuple[int, int]:
    begin, end = max(first, begin - buffer), min(last, end + buffer)
    lacking = least - (end - begin + 1)
    if lacking > 0:
        begin = max(first, begin - (lacking + 1) // 2)
        end = min(last, max(end, begin + least - 1))
        begin = max(first, min(begin, end - least + 1))
    return begin, end


def _middle(covered: list[tuple[int, int]]) -> int:
    """The middle one of the frames that collide."""
    frames = [frame for begin, end in covered for frame in range(begin, end + 1)]
    return frames[(len(frames) - 1) // 2]


Kind = Literal["linear", "quadratic"]


def linear(model: pin.Model, a: int, b: int, qa: Array, qb: Array, frame: int) -> Array:
    """Posture (nq,) of a frame on the geodesic from frame a to frame b > a (eq. 3.1 of the thesis)."""
    return np.asarray(pin.interpolate(model, qa, qb, (frame - a) / (b - a)))


def quadratic(model: pin.Model, a: int, m: int, b: int, qa: Array, qm: Array, qb: Array, frame: int) -> Array:
    """Posture (nq,) of a frame on the parabola through the postures of frames a < m < b.

    The parabola is one of displacements from the middle posture: its Lagrange form has the values of
    ``difference(qm, qa)``, zero and ``difference(qm, qb)`` at the three frames. No fraction has a zero below, as the
    three frames differ.
    """
    before, after = pin.difference(model, qm, qa), pin.difference(model, qm, qb)
    at_a = (frame - m) * (frame - b) / ((a - m) * (a - b))
    at_b = (frame - a) * (frame - m) / ((b - a) * (b - m))
    return np.asarray(pin.integrate(model, qm, at_a * before + at_b * after))


def fill(model: pin.Model, q: Array, a: int, m: int, b: int, kind: Kind) -> None:
    """Interpolate the frames between a, m and b of q (n, nq) in place; a = m or m = b leaves out that side."""
    ends = q[[a, m, b]].copy()
    for frame in range(a + 1, b):
        if frame == m:
            continue
        if kind == "quadratic" and a < m < b:
            q[frame] = quadratic(model, a, m, b, ends[0], ends[1], ends[2], frame)
        elif frame < m:
            q[frame] = linear(model, a, m, ends[0], ends[1], frame)
        else:
            q[frame] = linear(model, m, b, ends[1], ends[2], frame)


def key_frames(model: pin.Model, q: Array, moving: Mask, deviation: float) -> tuple[int, ...]:
    """Frames between which linear interpolation misses no frame by more than a deviation.

    An interval is split at the frame that is missed most (Ramer 1972; Douglas and Peucker 1973), from the whole motion
    on. The first and the last frame are among them.

    Args:
        model: Pinocchio's model.
        q: (n, nq) postures.
        moving: (nv,) the degrees of freedom that count.
        deviation: radians and metres.
    """
    found, waiting = {0, len(q) - 1}, [(0, len(q) - 1)]
    while waiting:
        a, b = waiting.pop()
        missed = [
            np.abs(pin.difference(model, linear(model, a, b, q[a], q[b], k), q[k])[moving]).max(initial=0.0)
            for k in range(a + 1, b)
        ]
        if missed and max(missed) > deviation:
            worst = a + 1 + int(np.argmax(missed))
            found.add(worst)
            waiting += [(a, worst), (worst, b)]
    return tuple(sorted(found))


class RecursionSettings(NamedTuple):
    """What the recursion needs of the method's settings.

    Attributes:
        planes: frames with plane constraints.
        share: of the frames of a group, by which it is widened to each side.
        least: least number of frames in a group, where there is room.
        interpolation: "linear" or "quadratic".
        short: programs after which a prediction is ended where others may be tried; None for none. Nine in ten take at
            most 20. Where none of the starts leads to a free posture in so many, the search goes on from the nearest of
            the postures that they found, in the last of the ways: before, more is let go.
        far: radians and metres; a prediction that goes farther may be a poor local answer, and others are tried.
    """

    planes: tuple[str, ...]
    share: float
    least: int
    interpolation: Kind
    short: int | None
    far: float = 0.3


class Recursion:
    """One way of freeing one clip.

    Every frame that was predicted is a key: it never changes again here, and groups end at keys. So each group has
    fewer frames than the one that it is a part of, and the recursion ends after at most one prediction a frame, whether
    predictions succeed or not.

    Attributes:
        q: (n, nq) the present postures.
        bad: (n,) which of them overlap.
        keys: frames that were predicted and are free, and evaluation points.
        stuck: frames whose prediction failed.
    """

    def __init__(self, predictor: Predictor, settings: RecursionSettings) -> None:
        """Begin at the original postures."""
        run = predictor.run
        self._run, self._predictor, self._settings = run, predictor, settings
        self._state, self._whole = State(run.scene.model), True
        self.q = np.array(run.terms.q)
        self.bad: Mask = np.array([not predictor.free(posture) for posture in self.q])
        self.at_first = int(self.bad.sum())
        self.keys: set[int] = set()
        self.stuck: set[int] = set()

    def free(self, evaluation: Iterable[int], *, whole: bool = True) -> None:
        """Free the evaluation points and both ends, then everything between them.

        Args:
            evaluation: frames.
            whole: go on where a frame cannot be freed; else that ends it.
        """
        self._whole = whole
        last = len(self.q) - 1
        points = sorted({0, last, *evaluation})
        corrected = [frame for frame in points if self.bad[frame]]
        for frame in corrected:
            self._key(frame)
            if self._ended():
                return
        for frame in reversed(corrected[:-1]):
            if self._run.ended:
                return
            self._again(frame)
        self.keys.update(points)
        for frame in corrected:
            if frame not in self.stuck:
                self._fill_around(frame)
        for low, high in pairwise(points):
            self._between(low, high)

    def _ended(self) -> bool:
        return self._run.ended or bool(self.stuck and not self._whole)

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
        while waiting and not self._ended():
            low, high = waiting.pop()
            for group in collision_groups(self.bad, low, high, self._settings.share, self._settings.least):
                if not self._ended() and self._bisect(group):
                    waiting += [(group.first - 1, group.middle), (group.middle, group.last + 1)]

    def _bisect(self, group: Group) -> bool:
        """Predict the middle and interpolate the others; whether the middle is free now."""
        if not self._key(group.middle):
            return False
        self._fill(group.first - 1, group.middle, group.last + 1)
        return True

    def _key(self, frame: int) -> bool:
        """Predict the posture of a frame with planes; where that fails or goes far, the least effort of several."""
        if self._run.watch.tell(self.share_done(), f"frame {frame}"):
            return False
        planes = path_planes(self._run.scene.figure, self.q, frame, self._swinging(frame), self._state)
        short = self._settings.short
        found = [self._predicted(frame, self.q[frame], planes, short)]
        if not found[0].good or self._predictor.farthest(frame, found[0].q) > self._settings.far:
            found += [self._predicted(frame, start, [], short) for start in self._beside(frame)]
            if planes and not any(prediction.good for prediction in found):
                found.append(self._predicted(frame, self.q[frame], [], short))
            if short is not None and self._whole and not any(prediction.good for prediction in found):
                nearest = min(found, key=lambda prediction: self._predictor.depth(prediction.q))
                found.append(self._predicted(frame, nearest.q, []))
        good = [prediction for prediction in found if prediction.good]
        if not good:
            self.stuck.add(frame)
            return False
        self.q[frame] = min((each.q for each in good), key=lambda q: self._predictor.effort(frame, q))
        self.bad[frame] = False
        self.keys.add(frame)
        return True

    def _again(self, frame: int) -> None:
        """Predict an evaluation point that went far from the side of the points after it, which were not known then."""
        if frame in self.stuck or self._predictor.farthest(frame, self.q[frame]) <= self._settings.far:
            return
        for start in self._beside(frame)[-1:]:
            found = self._predicted(frame, start, [], self._settings.short)
            if found.good and self._predictor.effort(frame, found.q) < self._predictor.effort(frame, self.q[frame]):
                self.q[frame] = found.q

    def _swinging(self, frame: int) -> list[str]:
        """Frames with plane constraints on which no foot stands: what stands is held, and need not be in the plane."""
        figure, model = self._run.scene.figure, self._run.scene.model
        feet = [model.frames[figure.frame_id(foot)].parentJoint for foot in self._run.terms.stands[frame]]
        stood_on = {joint for foot in feet for joint in model.supports[foot]}
        planes = self._settings.planes
        return [name for name in planes if model.frames[figure.frame_id(name)].parentJoint not in stood_on]

    def _predicted(self, frame: int, start: Array, planes: Sequence[Plane], most: int | None = None) -> Prediction:
        return self._predictor.predict(frame, self._run.terms.within(frame, start), planes, most=most)

    def _beside(self, frame: int) -> list[Array]:
        """Starts from the nearest free frames: their deviations from the original ones, on the original of this one."""
        model, original = self._run.scene.model, self._run.terms.q
        free = np.flatnonzero(~self.bad)
        near = [int(side) for side in (*free[free < frame][-1:], *free[free > frame][:1])]
        away = [pin.difference(model, original[side], self.q[side]) for side in near]
        starts = [np.asarray(pin.integrate(model, original[frame], step)) for step in away if step.any()]
        return starts or [self.q[side] for side in near]

    def _fill(self, a: int, m: int, b: int) -> None:
        """Interpolate between keys; joints that no key changed keep their original curves."""
        model, original = self._run.scene.model, self._run.terms.q
        fill(model, self.q, a, m, b, self._settings.interpolation)
        changes = [np.abs(pin.difference(model, original[key], self.q[key])) for key in {a, m, b}]
        changed = np.max(changes, axis=0) > 1e-4  # rad, m: what moves less was not needed
        kept = [
            slice(joint.idx_q, joint.idx_q + joint.nq)
            for joint in model.joints[1:]
            if not changed[joint.idx_v : joint.idx_v + joint.nv].any()
        ]
        for frame in range(a + 1, b):
            if frame != m:
                for values in kept:
                    self.q[frame, values] = original[frame, values]
                self.q[frame] = self._run.terms.within(frame, self.q[frame])
                self.bad[frame] = not self._predictor.free(self.q[frame])

    def share_done(self) -> float:
        """Share of the frames that overlapped at first which no longer do."""
        return 1.0 - int(self.bad.sum()) / max(1, self.at_first)


def hold_between(recursion: Recursion, predictor: Predictor) -> None:
    """Move interpolated frames to the nearest posture in which everything holds, in place, where one is found.

    Steps of the tracker find most; what they do not find is predicted.
    """
    run = predictor.run
    changed = np.flatnonzero((run.terms.q != recursion.q).any(axis=1)).tolist()
    for number, frame in enumerate(changed):
        q = recursion.q[frame]
        if predictor.holds(frame, q):
            continue
        if run.watch.tell(number / len(changed), f"holds of frame {frame}"):
            break
        nearest = run.follower.frame(frame, q, goal=q)
        if not predictor.good(frame, nearest):
            nearest, good = predictor.predict(frame, q, effort_from=q)
            if not good:
                continue
        recursion.q[frame] = nearest
