"""The method "bisection": settings, and one run on a clip."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import choice, listed, number, settle, text, whole
from wholebody.figures.figure import Figure
from wholebody.methods.base import Method
from wholebody.methods.qp.method import QP
from wholebody.methods.solve import method_for_motions
from wholebody.motion.avoider import MethodResult, Run
from wholebody.motion.bisection.prediction import SWINGING, Predictor
from wholebody.motion.bisection.recursion import Kind, Recursion, RecursionSettings, hold_between, key_frames
from wholebody.tasks import Freeze

MOST_FRAMES = 1_000_000


@dataclass(frozen=True)
class Bisection:
    """Keyframe interpolation by recursive bisection, with posture prediction (Degenhardt 2014).

    Frames that overlap make groups. The middle frame of a group gets the posture of least effort from the original one
    that is free; the others of the group are interpolated; then both halves are looked at again. What still dips
    between two frames gets rows of contact there. Postures outside of the groups and their buffers stay as they are.

    Attributes:
        evaluation: frames that characterise the motion. They are corrected first and never interpolated; so are the
            first and the last frame. None for the frames from which linear interpolation misses no original posture by
            more than `character`; () for none but both ends.
        buffer: percentage of the frames of a group by which it is widened to each side before it is interpolated.
        least: least number of frames in a group, where there is room.
        interpolation: "linear" or "quadratic", between the frames beside the group and its middle.
        planes: frames of the figure, such as "left_elbow" and "left_wrist", that leave their path only sideways where a
            posture is predicted; None for elbows and ankles, where the figure has them.
        frozen: joints and groups that stay as they are; None for a free root, unless a frame cannot be freed so.
            ("root", "lower_body") moves the upper body alone.
        room: least distance in predicted postures of what overlapped, metres.
        method: predicts postures: a name or a method such as `wb.QP(solver="daqp")`. "qp" is
            `wb.QP(restarts=0, iterations=50)`, ended after `short` programs where another start or way is left: a
            free root too is let go where no start frees a frame in so many.
        character: radians and metres that interpolation between evaluation points may miss of the original; less
            follows the original more closely and predicts more postures.
        short: programs after which a prediction of "qp" is ended where others may be tried.
    """

    evaluation: tuple[int, ...] | None = None
    buffer: float = 50.0
    least: int = 3
    interpolation: Kind = "linear"
    planes: tuple[str, ...] | None = None
    frozen: tuple[str, ...] | None = None
    room: float = 0.005
    method: str | Method = "qp"
    character: float = 0.2
    short: int = 25

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
        settle(self, "buffer", number(self.buffer, "Bisection: buffer", 0.0, 1000.0, "percent"))
        settle(self, "least", whole(self.least, "Bisection: least", 1, MOST_FRAMES))
        choice(self.interpolation, ("linear", "quadratic"), "Bisection: interpolation")
        for name in ("planes", "frozen"):
            given = getattr(self, name)
            if given is not None:
                names = listed(given, f"Bisection: {name}", "['left_elbow']")
                object.__setattr__(self, name, tuple(text(entry, f"Bisection: {name}") for entry in names))
        settle(self, "room", number(self.room, "Bisection: room", 0.0, 0.1, "m"))
        settle(self, "character", number(self.character, "Bisection: character", 0.0, 100.0))
        settle(self, "short", whole(self.short, "Bisection: short", 1, MOST_FRAMES))
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

    def avoid(self, run: Run) -> MethodResult:
        """Free a clip; see `wholebody.motion.avoider.Avoider`.

        Raises:
            InputError: an evaluation point beyond the clip's frames.
            UnknownNameError: a plane or a frozen joint names what the figure does not have.
        """
        figure = run.scene.figure
        for frame in self.evaluation or ():
            whole(frame, f"Bisection: evaluation, {run.clip.name}", 0, len(run.clip) - 1)
        usual = tuple(name for name in SWINGING if name in figure.frames)
        settings = RecursionSettings(
            usual if self.planes is None else self.planes, self.buffer / 100.0, self.least, self.interpolation,
            self.short if self.method == "qp" else None,
        )  # fmt: skip
        for name in settings.planes:
            figure.frame_id(name)
        # Nine in ten predictions take at most 20 programs. More give a little less effort and take much more time where
        # planes and what is held contradict each other.
        method = QP(restarts=0, iterations=50) if self.method == "qp" else method_for_motions(self.method)
        run = run.of(replace(run.terms, q=np.array([figure.clamp(q) for q in run.terms.q])))
        ways = self._frozen(figure)
        for frozen in ways:
            given = (*run.terms.given, *([Freeze(*frozen)] if frozen else []))
            predictor = Predictor(run.of(replace(run.terms, given=given)), method, self.room)
            recursion = Recursion(predictor, settings)
            recursion.free(self._points(figure, run.terms.q, frozen), whole=frozen == ways[-1])
            if frozen == ways[-1] or run.ended or not recursion.stuck:
                break
        hold_between(recursion, predictor)
        return MethodResult(recursion.q, repair=True, frozen=frozen)

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
        return key_frames(figure.model, original, moving, self.character)
