"""`wb.avoid`: free a clip of collisions, by any method, with one repair of what it leaves and one judge.

clip -> check -> method -> repair -> judge -> smoothing of what is too rough -> judge -> report
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from itertools import pairwise
from types import MappingProxyType

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import with_values
from wholebody.base.checks import a, flag, function, instance, listed, shown, warn
from wholebody.base.errors import InputError, UndefinedTermError, UnknownNameError
from wholebody.figures.strength import Strength
from wholebody.methods.control import ctrl_c_ends_all
from wholebody.motion.avoider import Avoider, MethodResult, Progress, Run, Watch, has_setting
from wholebody.motion.checking import ClipCheck, check
from wholebody.motion.clip import Clip, same_joints
from wholebody.motion.clip_torques import torques
from wholebody.motion.faults import DEPTH
from wholebody.motion.frame_terms import FrameTerms, Given, frame_terms
from wholebody.motion.judging import COLLISION, HELD, ROUNDING, AvoidanceReport, Avoided, foreseen, judged
from wholebody.motion.load_change import LoadChange
from wholebody.motion.measures import MotionBounds, resolved
from wholebody.motion.resting_hands import RestingHands
from wholebody.motion.stance import StanceFeet, has_feet, usual_feet
from wholebody.scene.scene import Scene
from wholebody.tasks import Freeze
from wholebody.tasks.base import Bound

METHODS: Mapping[str, str] = MappingProxyType({"trajectory": "Trajectory", "bisection": "Bisection"})
"""Methods by name: the classes of their settings in `wholebody.motion`."""


def as_avoider(given: object) -> Avoider:
    """A method from its name, or a configured one as it is; `UnknownNameError` or `InputError` for others."""
    if isinstance(given, str):
        if given not in METHODS:
            raise UnknownNameError("method of avoidance", given, METHODS)
        made: Avoider = getattr(import_module("wholebody.motion"), METHODS[given])()
        return made
    if isinstance(given, type) or not callable(getattr(given, "avoid", None)):
        raise InputError(
            f"avoid: method is {shown(given)}; give a name such as 'trajectory', or wb.motion.Trajectory()"
        )
    if lacking := [part for part in ("name", "clearance", "dynamics") if not hasattr(given, part)]:
        raise InputError(f"avoid: method is {a(type(given))} without {lacking[0]}; see wholebody.motion.avoider")
    return given  # type: ignore[return-value]


def avoid(
    clip: Clip,
    scene: Scene | None = None,
    *,
    method: str | Avoider = "trajectory",
    constraints: Iterable[Given] = (),
    hold_feet: bool = True,
    dynamics: bool | Strength = False,
    keep_ends: bool = False,
    progress: Progress | None = None,
) -> Avoided:
    """Free a clip of collisions of the figure with itself, with what it carries, and with what stands around.

    Jerk, speed and the deviation of postures that were free are bounded, by `MotionBounds()` unless `constraints`
    has one of its own. What a method leaves beyond these bounds is made smooth by the program of "trajectory".

    Args:
        clip: the original postures; they may collide and be beyond limits.
        scene: its figure with carried things, and the things around; None for the figure alone.
        method: "trajectory", "bisection", or configured: `wb.motion.Trajectory(clearance=0.005)`.
        constraints: what holds in every frame. What a term takes from the start it takes from the original posture of
            its own frame: `Hold("left_hand", relative_to="right_hand")` keeps the grip that each frame has. Hands that
            rest are held, as `wb.motion.RestingHands()` does, unless it has one of its own, or a `Hold` of the hand.
        hold_feet: keep the feet of a figure that has some where they stand, as `wb.motion.StanceFeet()` does, unless
            `constraints` has a `wb.motion.StanceFeet` of its own; False lets them slide.
        dynamics: keep the torques of joints within strength (the median of the person's sex and age if True; effort
            limits of a robot), and the zero moment point within the support. What the clip exceeds already is exceeded
            by no more: no joint needs more than its strength or than its largest torque before, and in no frame is the
            zero moment point farther outside than it was. Contacts come first; the report names the rest. The method
            "trajectory" can do this.
        keep_ends: keep the first and the last posture as they are where they are free.
        progress: called with an `AvoidProgress` now and then; the method ends with what it has if it returns True.

    What must give way is warned of before anything is computed: feet held and hands that rest inside things, a
    recording that jumps where it collides, and ends that are to be kept but overlap.

    Returns:
        The new clip and a report. A clip that could not be freed is an answer too: `report.solved` is False, and
        `report.message` names remaining faults.

    Raises:
        InputError: the scene's figure has other joints than the clip's, or a constraint does not fit.
        UnknownNameError: there is no such method, or a constraint names what the figure does not have.

    Examples:
        >>> inside = human.with_joints(standing, {"right_shoulder_abduction": -0.3})
        >>> freed = wb.avoid(wb.Clip(human, [standing, inside, standing], dt=0.5).resampled(0.1))
        >>> freed.report.solved
        True
    """
    instance(clip, Clip, "avoid: clip", "read one with wb.read_clip(path, figure)")
    scene = Scene(clip.figure) if scene is None else scene
    instance(scene, Scene, "avoid: scene", "make one with wb.Scene(clip.figure)")
    same_joints(clip, scene.figure, "avoid")
    if clip.things:
        raise InputError(
            f"avoid: {', '.join(clip.things)} of {clip.name} moves, and methods know things that stand; attach it to a "
            "segment with scene.attach and give Clip(clip.figure, clip.q, clip.dt)"
        )
    function(progress, "avoid: progress")
    chosen = as_avoider(method)
    if isinstance(dynamics, Strength) or flag(dynamics, "avoid: dynamics"):
        if not has_setting(chosen, "dynamics"):
            raise InputError(f"avoid: the method {chosen.name} does not take dynamics; give method='trajectory'")
        strength = dynamics if isinstance(dynamics, Strength) else Strength()
        chosen = replace(chosen, dynamics=strength)  # type: ignore[type-var]
    given: tuple[Given, ...] = tuple(listed(constraints, "avoid: constraints", "[wb.Freeze('root')]"))
    if flag(hold_feet, "avoid: hold_feet") and not any(isinstance(term, StanceFeet) for term in given):
        given = (*given, StanceFeet()) if has_feet(scene.figure) else given
    if not any(isinstance(term, RestingHands) for term in given):
        given = (*given, RestingHands())
    flag(keep_ends, "avoid: keep_ends")
    judge = _Judge(clip, scene, chosen, given, keep_ends)
    if judge.foreseen:
        warn(f"avoid: {clip.name}: {judge.foreseen}")
    with scene.borrow() as workspace:
        run = Run(clip, judge.terms, workspace, chosen.clearance, Watch(progress), judge.feet)
        began = time.perf_counter()
        try:
            with ctrl_c_ends_all():
                result = freed(chosen, run)
            seconds, report = time.perf_counter() - began, judge.report(result, run)
        except UndefinedTermError as error:  # terms of one's own are finite at the original postures, if nowhere else
            why = str(error)
            if error.q is not None:
                away = [np.linalg.norm(pin.difference(clip.figure.model, frame, error.q)) for frame in clip.q]
                why = error.at_posture(f"near frame {int(np.argmin(away))}")
            result = MethodResult(clip.q.copy(), message=f"the postures stay as they were: {why}")
            seconds, report = time.perf_counter() - began, replace(judge.report(result, run), solved=False)
        # only answers that are free and held are smoothed; a new timing, or loads, would be others after it
        if report.rough and result.times is None and chosen.dynamics is None and not run.ended:
            from wholebody.motion.repair import smoothed  # it loads scipy.sparse

            began = time.perf_counter()
            with ctrl_c_ends_all(), suppress(UndefinedTermError):  # what it was before stays
                q, windows = smoothed(run, result.q, judge.asked)
                smooth = with_values(result, q=q)
                other = judge.report(smooth, run)
                if windows and (other.solved or other.rough):
                    result, report = smooth, replace(other, smoothed=windows)
            seconds += time.perf_counter() - began
    return Avoided(clip.with_q(result.q), replace(report, seconds=seconds))


class _Judge:
    """What a clip is before it is freed, the feet it stands on, and the requirements of the answer."""

    def __init__(self, clip: Clip, scene: Scene, method: Avoider, given: tuple[Given, ...], keep_ends: bool) -> None:
        self._name, self._strength, self.feet = method.name, method.dynamics, usual_feet(scene.figure, given)
        self._clip = Clip(scene.figure, clip.q, clip.dt, clip.name)  # with what the figure carries
        self._loads = None
        if self._strength is not None:
            self._loads = torques(self._clip, scene, feet=self.feet, strength=self._strength)
        self._was = check(clip, scene, depth=COLLISION)
        terms = frame_terms(scene, clip.q, clip.dt, given, method.clearance)
        self.asked = _bounds(given, self._was, terms, keep_ends)
        self.terms = replace(terms, largest=self.asked.largest)
        self.foreseen = foreseen(self.terms, self._was, self.asked.keep_ends)

    def report(self, result: MethodResult, run: Run) -> AvoidanceReport:
        """What a method made of the clip."""
        change = None
        if self._loads is not None and self._strength is not None:
            places = np.arange(len(result.q), dtype=float) if result.times is None else result.times / self._clip.dt
            after = self._clip.with_q(result.q)
            loads = torques(after, self.terms.scene, feet=self.feet, strength=self._strength)
            change = LoadChange(self._loads, loads, places)
        report = judged(self._was, self.terms, self.asked, result, run.work, self._name, change)
        more = ["the caller ended it" if run.ended else "", run.work.left_out, "" if report.solved else self.foreseen]
        return replace(report, message="; ".join(filter(None, [report.message, *more])))


def freed(method: Avoider, run: Run) -> MethodResult:
    """What a method makes of a clip, with the shared repair of what it leaves to it."""
    result = method.avoid(run)
    if not result.repair or run.ended:
        return result
    from wholebody.motion.repair import repaired  # it loads scipy.sparse

    terms, frozen = run.terms, [Freeze(*result.frozen)] if result.frozen else []
    kept = run.of(replace(terms, given=(*terms.given, *frozen))) if frozen else run
    q = repaired(kept, result.q)
    for frame in np.flatnonzero((q != result.q).any(axis=1)).tolist():
        q[frame] = kept.terms.within(frame, q[frame])
    return with_values(result, q=q)


def _bounds(given: tuple[Given, ...], was: ClipCheck, terms: FrameTerms, keep_ends: bool) -> MotionBounds:
    stated = [term for term in given if isinstance(term, MotionBounds)]
    if len(stated) > 1:
        raise InputError("avoid: constraints has two wb.motion.MotionBounds; give one")
    asked, clip = stated[0] if stated else MotionBounds(), was.clip
    asked = replace(asked, keep_ends=True) if keep_ends else asked
    limits, state = terms.scene.figure.limits, terms.scene.state(clip.q[0])
    values = clip.q[:, limits.idx_q]
    beyond = np.maximum(limits.lower - values, values - limits.upper).max(axis=1, initial=0.0)
    free = (was.depth <= DEPTH) & (beyond <= ROUNDING)
    if terms.given or terms.holds:
        free &= [terms.worst(frame, state.update(q)).by <= HELD for frame, q in enumerate(clip.q)]
    passed = np.zeros(len(clip), dtype=bool)
    for gap in np.flatnonzero(was.between > was.tolerance):
        passed[gap : gap + 2] = True
    for gap, pair in enumerate(pairwise(clip.q)) if any(isinstance(term, Bound) for term in terms.given) else ():
        if terms.past_speed(gap, *pair) > 0.0:
            passed[gap : gap + 2] = True
    return resolved(asked, free, passed)
