"""The recursion of figure 3.2 of the thesis: predict a middle frame, interpolate beside it, go into both halves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.figures.state import State
from wholebody.motion.avoider import Watch
from wholebody.motion.bisection.groups import Group, collision_groups
from wholebody.motion.bisection.interpolation import Kind, fill
from wholebody.motion.bisection.prediction import Prediction, Predictor, path_planes
from wholebody.motion.following import Follower
from wholebody.motion.frame_terms import FrameTerms
from wholebody.scene.scene import Scene
from wholebody.tasks import Plane

SAME = 1e-4
"""Radians and metres: a joint that a prediction moves less was not needed, and keeps its curve."""

FAR = 0.3
"""Radians and metres: a prediction that goes farther may be a poor local answer, and others are tried beside it."""


SHORT = 25
"""Programs of "qp" after which a prediction is ended, as another start has others: nine in ten take at most 20. Where
none of the starts leads to a free posture in so many, the search goes on from the nearest of the postures that they
found, in the last of the ways: before, more is let go."""


class Stays:
    """Applies to any posture of a frame what must not change: frozen joints, bounds on the deviation, joint limits."""

    def __init__(self, scene: Scene, original: Array, terms: FrameTerms, frozen: tuple[str, ...]) -> None:
        """Find the bounds of every frame; `original` is (n, nq)."""
        self._figure, self._original = scene.figure, original
        state = State(scene.model)
        dofs = scene.figure.dofs(frozen)
        self._low, self._high = np.empty((len(original), scene.model.nv)), np.empty((len(original), scene.model.nv))
        for frame in range(len(original)):
            self._low[frame], self._high[frame] = terms.bounds(frame, state)[:2]
        self._low[:, dofs] = self._high[:, dofs] = 0.0
        self._bounded = bool(np.isfinite(self._low).any() or np.isfinite(self._high).any())

    def applied(self, frame: int, q: Array) -> Array:
        """A copy of a posture (nq,) of a frame, within the bounds and the joint limits; frozen joints are exact."""
        model, original = self._figure.model, self._original[frame]
        if self._bounded:
            low, high = self._low[frame], self._high[frame]
            away = pin.difference(model, original, q)
            if ((away < low) | (away > high)).any():
                q = np.asarray(pin.integrate(model, original, np.clip(away, low, high)))
            q = np.array(q)
            for joint in model.joints[1:]:
                dofs = slice(joint.idx_v, joint.idx_v + joint.nv)
                if (low[dofs] == 0.0).all() and (high[dofs] == 0.0).all():
                    values = slice(joint.idx_q, joint.idx_q + joint.nq)
                    q[values] = original[values]
        return self._figure.clamp(q)


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
        short: int | None,
    ) -> None:
        """Take the settings; `joints` are the frames with plane constraints.

        `short` is the number of iterations after which a prediction is ended where others may be tried; None for none.
        """
        self._short = short
        self._scene, self._predictor, self._stays, self.joints = scene, predictor, stays, tuple(joints)
        self._share, self._least, self._kind, self._watch = share, least, kind, watch
        self._state, self._whole = State(scene.model), True
        self.q = np.array(predictor.original)
        self.bad: Mask = np.array([not predictor.free(posture) for posture in self.q])
        self.at_first = int(self.bad.sum())
        self.keys: set[int] = set()
        self.stuck: dict[int, str] = {}
        self.predictions = self.programs = 0

    def run(self, evaluation: Iterable[int], *, whole: bool = True) -> None:
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
            if self._watch.ended:
                return
            self._again(frame)
        self.keys.update(points)
        for frame in corrected:
            if frame not in self.stuck:
                self._fill_around(frame)
        for low, high in pairwise(points):
            self._between(low, high)

    def _ended(self) -> bool:
        return self._watch.ended or bool(self.stuck and not self._whole)

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
            for group in collision_groups(self.bad, low, high, self._share, self._least):
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
        if self._watch.tell(self.share_done(), f"frame {frame}"):
            return False
        planes, short = path_planes(self._scene.figure, self.q, frame, self._swinging(frame), self._state), self._short
        found = [self._predicted(frame, self.q[frame], planes, short)]
        if not found[0].good or self._predictor.farthest(frame, found[0].q) > FAR:
            found += [self._predicted(frame, start, [], short) for start in self._beside(frame)]
            if planes and not any(prediction.good for prediction in found):
                found.append(self._predicted(frame, self.q[frame], [], short))
            if short is not None and self._whole and not any(prediction.good for prediction in found):
                nearest = min(found, key=lambda prediction: self._predictor.depth(prediction.q))
                found.append(self._predicted(frame, nearest.q, []))
        good = [prediction for prediction in found if prediction.good]
        if not good:
            self.stuck[frame] = self._predictor.deepest(found[0].q) or "what is held there cannot hold"
            return False
        self.q[frame] = min((each.q for each in good), key=lambda q: self._predictor.effort(frame, q))
        self.bad[frame] = False
        self.keys.add(frame)
        return True

    def _again(self, frame: int) -> None:
        """Predict an evaluation point that went far from the side of the points after it, which were not known then."""
        if frame in self.stuck or self._predictor.farthest(frame, self.q[frame]) <= FAR:
            return
        for start in self._beside(frame)[-1:]:
            found = self._predicted(frame, start, [], self._short)
            if found.good and self._predictor.effort(frame, found.q) < self._predictor.effort(frame, self.q[frame]):
                self.q[frame] = found.q

    def _swinging(self, frame: int) -> list[str]:
        """Frames with plane constraints on which no foot stands: what stands is held, and need not be in the plane."""
        figure, model = self._scene.figure, self._scene.model
        feet = [model.frames[figure.frame_id(foot)].parentJoint for foot in self._predictor.terms.stands[frame]]
        stood_on = {joint for foot in feet for joint in model.supports[foot]}
        return [name for name in self.joints if model.frames[figure.frame_id(name)].parentJoint not in stood_on]

    def _predicted(self, frame: int, start: Array, planes: Sequence[Plane], most: int | None = None) -> Prediction:
        found = self._predictor.predict(frame, self._stays.applied(frame, start), planes, most=most)
        self.predictions += 1
        self.programs += found.programs
        return found

    def _beside(self, frame: int) -> list[Array]:
        """Starts from the nearest free frames: their deviations from the original ones, on the original of this one."""
        model, original = self._scene.model, self._predictor.original
        free = np.flatnonzero(~self.bad)
        near = [int(side) for side in (*free[free < frame][-1:], *free[free > frame][:1])]
        away = [pin.difference(model, original[side], self.q[side]) for side in near]
        starts = [np.asarray(pin.integrate(model, original[frame], step)) for step in away if step.any()]
        return starts or [self.q[side] for side in near]

    def _fill(self, a: int, m: int, b: int) -> None:
        """Interpolate between keys; joints that no key changed keep their original curves."""
        model, original = self._scene.model, self._predictor.original
        fill(model, self.q, a, m, b, self._kind)
        changes = [np.abs(pin.difference(model, original[key], self.q[key])) for key in {a, m, b}]
        changed = np.max(changes, axis=0) > SAME
        kept = [
            slice(joint.idx_q, joint.idx_q + joint.nq)
            for joint in model.joints[1:]
            if not changed[joint.idx_v : joint.idx_v + joint.nv].any()
        ]
        for frame in range(a + 1, b):
            if frame != m:
                for values in kept:
                    self.q[frame, values] = original[frame, values]
                self.q[frame] = self._stays.applied(frame, self.q[frame])
                self.bad[frame] = not self._predictor.free(self.q[frame])

    def share_done(self) -> float:
        """Share of the frames that overlapped at first which no longer do."""
        return 1.0 - int(self.bad.sum()) / max(1, self.at_first)


def changed_frames(original: Array, q: Array) -> list[int]:
    """Frames (n, nq) that differ."""
    return [int(frame) for frame in np.flatnonzero((original != q).any(axis=1))]


def hold_between(
    recursion: Recursion, predictor: Predictor, follower: Follower, changed: list[int], watch: Watch
) -> list[int]:
    """Move interpolated frames to the nearest posture in which everything holds; returns those that have none.

    Steps of the tracker find most; what they do not find is predicted.
    """
    failed = []
    for number, frame in enumerate(changed):
        q = recursion.q[frame]
        if predictor.holds(frame, q):
            continue
        if watch.tell(number / len(changed), f"holds of frame {frame}"):
            break
        nearest = follower.frame(frame, q, goal=q)
        if predictor.good(frame, nearest):
            recursion.q[frame] = nearest
            continue
        found = predictor.predict(frame, q, effort_from=q)
        recursion.predictions += 1
        recursion.programs += found.programs
        if found.good:
            recursion.q[frame] = found.q
        else:
            failed.append(frame)
    return failed
