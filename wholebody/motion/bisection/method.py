"""The method "bisection": its settings, and the recursion on one clip."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.base.checks import listed, text, whole
from wholebody.base.fields import Checked, Range
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.methods.base import Method
from wholebody.methods.qp.method import QP
from wholebody.methods.solve import method_for_motions
from wholebody.motion.avoider import MethodResult, Run
from wholebody.motion.bisection.prediction import Prediction, Predictor, path_planes
from wholebody.motion.clip import MOST_FRAMES
from wholebody.motion.windows import runs
from wholebody.tasks import Freeze, Plane

Kind = Literal["linear", "quadratic"]


def _frames(value: Any, what: str) -> tuple[int, ...]:
    return tuple(whole(frame, what, 0, MOST_FRAMES) for frame in listed(value, what, "[0, 12, 40]"))


def _names(value: Any, what: str) -> tuple[str, ...]:
    return tuple(text(name, what) for name in listed(value, what, "['left_elbow']"))


@dataclass(frozen=True)
class Bisection(Checked):
    """Keyframe interpolation by recursive bisection, with posture prediction (Degenhardt 2014).

    Frames that overlap make groups. The middle frame of a group gets the posture of least effort from the original one
    that is free; the others of the group are interpolated; then both halves are looked at again. What still dips
    between two frames gets rows of contact there. Postures outside of the groups and their buffers stay as they are.

    Attributes:
        evaluation: frames that characterise the motion. They are corrected first and never interpolated; so are the
            first and the last frame. None for the frames from which linear interpolation misses no original posture by
            more than 0.2 rad or m; () for none but both ends.
        buffer: percentage of the frames of a group by which it is widened to each side before it is interpolated.
        least: least number of frames in a group, where there is room.
        interpolation: "linear" or "quadratic", between the frames beside the group and its middle.
        planes: frames of the figure, such as "left_elbow" and "left_wrist", that leave their path only sideways where a
            posture is predicted; None for elbows and ankles, where the figure has them.
        frozen: joints and groups that stay as they are; None for a free root, unless a frame cannot be freed so.
            ("root", "lower_body") moves the upper body alone.
        room: least distance in predicted postures of what overlapped, metres.
        method: predicts postures: a name or a method such as `wb.methods.QP(solver="daqp")`. "qp" is
            `wb.methods.QP(restarts=0, iterations=50)`, ended after 25 programs where another start remains: a
            free root too is let go where no start frees a frame in so many.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> wb.avoid(clip, scene, method=wb.motion.Bisection(buffer=30.0)).report.solved
        True
    """

    name: ClassVar[str] = "bisection"
    clearance: ClassVar[float] = 0.0
    dynamics: ClassVar[None] = None

    evaluation: Annotated[tuple[int, ...], _frames] | None = None
    buffer: Annotated[float, Range(0.0, 1000.0, "percent")] = 50.0
    least: Annotated[int, Range(1, MOST_FRAMES, whole=True)] = 3
    interpolation: Kind = "linear"
    planes: Annotated[tuple[str, ...], _names] | None = None
    frozen: Annotated[tuple[str, ...], _names] | None = None
    room: Annotated[float, Range(0.0, 0.1, "m")] = 0.005
    method: str | Method = "qp"

    def __post_init__(self) -> None:
        super().__post_init__()
        method_for_motions(self.method)

    def avoid(self, run: Run) -> MethodResult:
        """Free a clip; see `wholebody.motion.avoider.Avoider`."""
        figure = run.scene.figure
        for frame in self.evaluation or ():
            whole(frame, f"Bisection: evaluation, {run.clip.name}", 0, len(run.clip) - 1)
        for name in self.planes or ():
            figure.frame_id(name)
        # more iterations give a little less effort, and take long where planes and what is held contradict each other
        method = QP(restarts=0, iterations=50) if self.method == "qp" else method_for_motions(self.method)
        run = run.of(replace(run.terms, q=np.array([figure.clamp(q) for q in run.terms.q])))
        # what is frozen, and what else where a frame cannot be freed so
        choices = ((tuple(figure.roots), ()) if figure.roots else ((),)) if self.frozen is None else (self.frozen,)
        for frozen in choices:
            given = (*run.terms.given, *([Freeze(*frozen)] if frozen else []))
            predictor = Predictor(run.of(replace(run.terms, given=given)), method, self.room)
            recursion = Recursion(predictor, self)
            recursion.free(self._points(figure, run.terms.q, frozen), whole=frozen == choices[-1])
            if frozen == choices[-1] or run.ended or not recursion.stuck:
                break
        return MethodResult(recursion.q, repair=True, frozen=frozen)

    def _points(self, figure: Figure, original: Array, frozen: tuple[str, ...]) -> tuple[int, ...]:
        if self.evaluation is not None:
            return self.evaluation
        moving = np.ones(figure.model.nv, dtype=bool)
        moving[figure.dofs(frozen)] = False
        return key_frames(figure.model, original, moving, 0.2)  # less predicts more postures, nearer to the original


class Recursion:
    """The recursion of figure 3.2 of the thesis: predict a middle frame, interpolate beside it, go into both halves.

    Groups end at frames that were predicted, so it ends after at most one prediction a frame.
    """

    def __init__(self, predictor: Predictor, settings: Bisection) -> None:
        run = predictor.run
        self._run, self._predictor, self._settings = run, predictor, settings
        figure = run.scene.figure
        swinging = (f"{side}_{part}" for part in ("elbow", "ankle") for side in ("left", "right"))
        usual = tuple(name for name in swinging if name in figure.frames)
        self._planes = usual if settings.planes is None else settings.planes
        self._short = 25 if settings.method == "qp" else None  # nine in ten predictions take at most 20 programs
        self._state, self._whole = State(run.scene.model), True
        self.q = np.array(run.terms.q)  # (n, nq) the present postures
        self.bad: Mask = np.array([not predictor.free(posture) for posture in self.q])  # (n,) which of them overlap
        self._at_first = max(1, int(self.bad.sum()))
        # keys: frames that were predicted and are free, and evaluation points; they do not change again
        self.keys: set[int] = set()
        self.stuck: set[int] = set()  # frames whose prediction failed

    def free(self, evaluation: Iterable[int], *, whole: bool = True) -> None:
        """Free the evaluation points and both ends, then all between; `whole`: also after a frame that is stuck."""
        self._whole = whole
        last = len(self.q) - 1
        points = sorted({0, last, *evaluation})
        corrected = [frame for frame in points if self.bad[frame]]
        for frame in corrected:
            self._key(frame)
            if self._ended():
                return
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
        waiting = [(low, high)]
        while waiting and not self._ended():
            low, high = waiting.pop()
            for group in collision_groups(self.bad, low, high, self._settings.buffer / 100.0, self._settings.least):
                if not self._ended() and self._key(group.middle):
                    self._fill(group.first - 1, group.middle, group.last + 1)
                    waiting += [(group.first - 1, group.middle), (group.middle, group.last + 1)]

    def _key(self, frame: int) -> bool:
        """Predict the posture of a frame with planes; where that fails or goes far, the least effort of several."""
        if self._run.watch.tell(1.0 - int(self.bad.sum()) / self._at_first, f"frame {frame}"):
            return False
        planes = path_planes(self._run.scene.figure, self.q, frame, self._swinging(frame), self._state)
        short = self._short
        found = [self._predicted(frame, self.q[frame], planes, short)]
        # rad, m: a prediction that goes farther may be a poor local answer
        if not found[0].good or self._predictor.farthest(frame, found[0].q) > 0.3:
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

    def _swinging(self, frame: int) -> list[str]:
        """Frames with plane constraints on which no foot stands: what stands is held, and need not be in the plane."""
        figure, model = self._run.scene.figure, self._run.scene.model
        feet = [model.frames[figure.frame_id(foot)].parentJoint for foot in self._run.terms.stands[frame]]
        stood_on = {joint for foot in feet for joint in model.supports[foot]}
        return [name for name in self._planes if model.frames[figure.frame_id(name)].parentJoint not in stood_on]

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


class Group(NamedTuple):
    """Consecutive frames, the last one included, and the one of them that bisects what collides."""

    first: int
    last: int
    middle: int


def collision_groups(bad: Mask, low: int, high: int, share: float = 0.0, least: int = 1) -> list[Group]:
    """Groups of colliding frames (n,) between two that stay, widened by a share and to `least`, and merged."""
    first, last = low + 1, high - 1
    found: list[tuple[int, int]] = []
    for run in runs(bad[first : last + 1]):
        begin, end = first + run.first, first + run.end - 1
        begin, end = _widened(begin, end, round((end - begin + 1) * share), least, first, last)
        while found and begin <= found[-1][1] + 1:
            before = found.pop()
            begin, end = min(before[0], begin), max(before[1], end)
        found.append((begin, end))
    marked = [begin + np.flatnonzero(bad[begin : end + 1]) for begin, end in found]
    return [Group(*ends, int(frames[(len(frames) - 1) // 2])) for ends, frames in zip(found, marked, strict=True)]


def _widened(begin: int, end: int, buffer: int, least: int, first: int, last: int) -> tuple[int, int]:
    begin, end = max(first, begin - buffer), min(last, end + buffer)
    lacking = least - (end - begin + 1)
    if lacking > 0:
        begin = max(first, begin - (lacking + 1) // 2)
        end = min(last, max(end, begin + least - 1))
        begin = max(first, min(begin, end - least + 1))
    return begin, end


def linear(model: pin.Model, a: int, b: int, qa: Array, qb: Array, frame: int) -> Array:
    """Posture (nq,) of a frame on the geodesic from frame a to frame b > a (eq. 3.1 of the thesis)."""
    return np.asarray(pin.interpolate(model, qa, qb, (frame - a) / (b - a)))


def quadratic(model: pin.Model, a: int, m: int, b: int, qa: Array, qm: Array, qb: Array, frame: int) -> Array:
    """Posture (nq,) of a frame on the parabola through frames a < m < b, of displacements from the middle posture."""
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
    """Frames of q (n, nq) between which interpolation misses no frame by more than a deviation, rad and m."""
    # Split where it is missed most (Ramer 1972; Douglas and Peucker 1973); `moving` (nv,) counts.
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
