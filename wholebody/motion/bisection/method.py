"""The method "bisection": settings, and one run on a clip."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import choice, listed, number, settle, text, whole
from wholebody.figures.figure import Figure
from wholebody.methods.base import Method
from wholebody.methods.qp.method import QP
from wholebody.methods.solve import method_for_motions
from wholebody.motion.avoider import MethodResult, Progress, Watch, check_input
from wholebody.motion.bisection.interpolation import Kind, key_frames
from wholebody.motion.bisection.prediction import ANKLES, ELBOWS, Predictor
from wholebody.motion.bisection.recursion import SHORT, Recursion, Stays, changed_frames, hold_between
from wholebody.motion.clip import Clip
from wholebody.motion.following import Follower
from wholebody.motion.frame_terms import FrameTerms, Given, frame_terms, said
from wholebody.motion.repair import Repairer
from wholebody.scene.scene import Scene
from wholebody.tasks import Freeze

OVERLAP = 5e-5
"""Depth up to which a frame is free, and by which a gap may be deeper, metres: together the 0.1 mm of `wb.check`."""

CHARACTER = 0.2
"""Radians and metres: what interpolation between evaluation points may miss of the original. Less follows the original
more closely and predicts more postures."""

MOST = 50
"""Programs of one prediction: nine in ten take at most 20. More = a little less effort, and much more time where planes
and what is held contradict each other."""

MOST_FRAMES = 1_000_000
MOST_BUFFER = 1000.0  # percent
MOST_ROOM = 0.1  # m
NAMED = 6  # runs of frames that a message lists


@dataclass(frozen=True)
class Bisection:
    """Keyframe interpolation by recursive bisection, with posture prediction (Degenhardt 2014).

    Frames that overlap make groups. The middle frame of a group gets the posture of least effort from the original one
    that is free; the others of the group are interpolated; then both halves are looked at again. What still dips
    between two frames gets rows of contact there. Postures outside of the groups and their buffers stay as they are.

    Attributes:
        evaluation: frames that characterise the motion. They are corrected first and never interpolated; so are the
            first and the last frame. None for the frames from which linear interpolation misses no original posture by
            more than `CHARACTER`; () for none but both ends.
        buffer: percentage of the frames of a group by which it is widened to each side before it is interpolated.
        least: least number of frames in a group, where there is room.
        interpolation: "linear" or "quadratic", between the frames beside the group and its middle.
        planes: frames of the figure, such as "left_elbow" and "left_wrist", that leave their path only sideways where a
            posture is predicted; None for elbows and ankles, where the figure has them.
        frozen: joints and groups that stay as they are; None for a free root, unless a frame cannot be freed so.
            ("root", "lower_body") moves the upper body alone.
        room: least distance in predicted postures of what overlapped, metres.
        method: predicts postures: a name or a method such as `wb.QP(solver="daqp")`. "qp" is
            `wb.QP(restarts=0, iterations=50)`, ended after 25 programs where another start or way is left: a free
            root too is let go where no start frees a frame in so many.
    """

    evaluation: tuple[int, ...] | None = None
    buffer: float = 50.0
    least: int = 3
    interpolation: Kind = "linear"
    planes: tuple[str, ...] | None = None
    frozen: tuple[str, ...] | None = None
    room: float = 0.005
    method: str | Method = "qp"

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            InputError: a setting out of range.
            UnknownNameError: no such method.
        """
        if self.evaluation is not None:
            frames = listed(self.evaluation, "Bisection: evaluation", "[0, 12, 40]")
            checked = tuple(whole(frame, "Bisection: evaluation", 0, MOST_FRAMES) for frame in frames)
            object.__setattr__(self, "evaluation", checked)
        settle(self, "buffer", number(self.buffer, "Bisection: buffer", 0.0, MOST_BUFFER, "percent"))
        settle(self, "least", whole(self.least, "Bisection: least", 1, MOST_FRAMES))
        choice(self.interpolation, ("linear", "quadratic"), "Bisection: interpolation")
        for name in ("planes", "frozen"):
            given = getattr(self, name)
            if given is not None:
                names = listed(given, f"Bisection: {name}", "['left_elbow']")
                object.__setattr__(self, name, tuple(text(entry, f"Bisection: {name}") for entry in names))
        settle(self, "room", number(self.room, "Bisection: room", 0.0, MOST_ROOM, "m"))
        method_for_motions(self.method)

    @property
    def name(self) -> str:
        """Name for tables."""
        return "bisection"

    @property
    def clearance(self) -> float:
        """It keeps pairs from overlapping, and no farther."""
        return 0.0

    @property
    def dynamics(self) -> None:
        """It looks at no torques."""

    def avoid(self, clip: Clip, scene: Scene, constraints: Iterable[Given], progress: Progress | None) -> MethodResult:
        """Free a clip; see `wholebody.motion.avoider.Avoider`.

        Raises:
            InputError: an evaluation point beyond the clip's frames, or a constraint that is none.
            UnknownNameError: a plane, a frozen joint or a constraint names what the figure does not have.
        """
        check_input(clip, scene, progress)
        figure, watch = scene.figure, Watch(progress)
        for frame in self.evaluation or ():
            whole(frame, f"Bisection: evaluation, {clip.name}", 0, len(clip) - 1)
        original = np.array([figure.clamp(q) for q in clip.q])
        terms = frame_terms(scene, original, clip.dt, constraints)
        usual = tuple(name for name in (*ELBOWS, *ANKLES) if name in figure.frames)
        joints = usual if self.planes is None else self.planes
        for joint in joints:
            figure.frame_id(joint)
        method = QP(restarts=0, iterations=MOST) if self.method == "qp" else method_for_motions(self.method)
        ways = self._frozen(figure)
        predictions = programs = 0  # of a way that was given up
        with scene.borrow() as workspace:
            for frozen in ways:
                stays = Stays(scene, original, terms, frozen)
                predictor = Predictor(scene, original, terms, frozen, method, self.room, OVERLAP, workspace)
                recursion = Recursion(
                    scene, predictor, stays, joints, self.buffer / 100.0, self.least, self.interpolation, watch,
                    SHORT if self.method == "qp" else None,
                )  # fmt: skip
                recursion.run(self._points(figure, original, frozen), whole=frozen == ways[-1])
                if frozen == ways[-1] or watch.ended or not recursion.stuck:
                    break
                predictions, programs = recursion.predictions, recursion.programs
            frozen_too = _with_frozen(terms, frozen)
            follower = Follower(frozen_too, self.clearance)
            missed = hold_between(recursion, predictor, follower, changed_frames(original, recursion.q), watch)
            repairer = Repairer(frozen_too, workspace)
            q = repairer.repair(recursion.q, watch)
            for frame in changed_frames(recursion.q, q):
                q[frame] = stays.applied(frame, q[frame])
            stuck = [frame for frame in sorted(recursion.stuck) if not predictor.good(frame, q[frame])]
            bad = [frame for frame in np.flatnonzero(recursion.bad).tolist() if not predictor.free(q[frame])]
            missed = [frame for frame in missed if not predictor.holds(frame, q[frame])]
        message = said(terms, _message(recursion, stuck, bad, missed, watch))
        predictions, programs = predictions + recursion.predictions, programs + recursion.programs
        return MethodResult(q, predictions, programs + follower.programs + repairer.programs, message)

    def _frozen(self, figure: Figure) -> tuple[tuple[str, ...], ...]:
        """What is frozen, and what else where a frame cannot be freed so."""
        if self.frozen is not None:
            return (self.frozen,)
        return (("root",), ()) if figure.root == "free" else ((),)

    def _points(self, figure: Figure, original: Array, frozen: tuple[str, ...]) -> tuple[int, ...]:
        """The evaluation points of a clip."""
        if self.evaluation is not None:
            return self.evaluation
        moving = np.ones(figure.model.nv, dtype=bool)
        moving[figure.dofs(frozen)] = False
        return key_frames(figure.model, original, moving, CHARACTER)


def _with_frozen(terms: FrameTerms, frozen: tuple[str, ...]) -> FrameTerms:
    return replace(terms, given=(*terms.given, Freeze(*frozen))) if frozen else terms


def _message(recursion: Recursion, stuck: list[int], bad: list[int], missed: list[int], watch: Watch) -> str:
    """What did not succeed, in one sentence; empty where all did."""
    parts = []
    if stuck:
        others = f" and {len(stuck) - 1} others" if len(stuck) > 1 else ""
        parts.append(f"frame {stuck[0]}{others} could not be freed ({recursion.stuck[stuck[0]]})")
    if bad:
        parts.append(f"{_frames(bad)} still overlap{'s' if len(bad) == 1 else ''}")
    if missed:
        parts.append(f"what is held does not hold in {_frames(missed)}")
    if watch.ended:
        parts.append("it was ended before it was done")
    return "; ".join(parts)


def _frames(frames: list[int]) -> str:
    """Frames in words: "frames 3 to 7, 12"."""
    ends = (
        [frame for frame in frames if frame - 1 not in frames],
        [frame for frame in frames if frame + 1 not in frames],
    )
    parts = [f"{a}" if a == b else f"{a} to {b}" for a, b in zip(*ends, strict=True)]
    more = f" and {len(parts) - NAMED} more runs" if len(parts) > NAMED else ""
    return f"frame{'s' if len(frames) > 1 else ''} {', '.join(parts[:NAMED])}{more}"
