"""`wb.avoid`: free a clip of collisions, by any method, judged independently of it."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import pairwise
from types import MappingProxyType

import numpy as np
import pinocchio as pin

from wholebody.assessment.motion import limit_violation
from wholebody.base.arrays import Array
from wholebody.base.checks import a, flag, instance, listed, shown
from wholebody.base.errors import InputError, UndefinedTermError, UnknownNameError
from wholebody.base.records import with_values
from wholebody.methods.control import ctrl_c_ends_all
from wholebody.motion.avoider import Avoider, MethodResult, Progress, Watch, check_input, has_setting
from wholebody.motion.checking import ClipCheck, check
from wholebody.motion.clip import Clip
from wholebody.motion.clip_torques import torques
from wholebody.motion.faults import DEPTH
from wholebody.motion.frame_terms import FrameTerms, Given, frame_terms
from wholebody.motion.load_change import LoadChange, load_change
from wholebody.motion.motion_bounds import MotionBounds, excess, resolved
from wholebody.motion.soles import usual_feet
from wholebody.motion.stance import StanceFeet, has_feet
from wholebody.motion.strength import Strength
from wholebody.scene.scene import Scene
from wholebody.tasks.base import Bound, filled

COLLISION = 1e-4  # m: a frame, or the motion between two, that is deeper collides
FASTER = 0.02  # of a speed that was given, by which it may be exceeded in a solved clip
HELD = 1e-3  # m, rad: by which what is held may be missed in a solved clip
ROUNDING = 1e-6  # rad, m: by which limits may be missed
SAME = 1e-9  # rad, m: a posture that is no farther from another one is the same

METHODS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "trajectory": ("wholebody.motion.trajectory.method", "Trajectory"),
        "frames": ("wholebody.motion.per_frame", "PerFrame"),
        "bisection": ("wholebody.motion.bisection.method", "Bisection"),
        "fade": ("wholebody.motion.fade", "Fade"),
    }
)
"""Methods by name: module and class of the settings."""


@dataclass(frozen=True, repr=False)
class AvoidanceReport:
    """What a method did to a clip, and what it left.

    Attributes:
        solved: whether the clip is free, limits hold and what is held is missed by at most 1 mm or 1 mrad, by a check
            that shares nothing with the methods.
        message: one sentence that says what is left, or that all is free.
        method: name of the method.
        seconds: wall time of the method, without the judgement.
        posture_solves: how many postures were solved for on their own.
        programs: how many quadratic programs were solved.
        frames_changed: how many postures are others than those of the clip before at the same place of its timing.
        missed: largest miss of a constraint in any frame, metres or radians.
        stretch: factor by which the clip was slowed most, anywhere; 1 where its timing is as it was.
        duration: of the answer, seconds.
        times: (m,) seconds of the clip as it was at which each frame of the answer is.
        before: the check of the clip as it was.
        after: the check of the answer.
        loads: torques and the zero moment point before and after, where `dynamics` was asked for; else None.
        beside: by how much a frame is held at most beside its place at another one, because it overlaps what it is
            held at there, metres; 0 where nothing does.
        jerk: largest root mean square jerk over half a second, in parts of the original's; see `MotionBounds`.
        speed: largest speed of a joint, in parts of the original's nearby; see `wb.motion.MotionBounds`.
        deviation: largest change of a posture that was free, radians or metres.
        smoothed: windows of frames that were too rough and were made smooth after the method.
        rough: whether jerk, speed or deviation are beyond their bounds, and nothing else is wrong.
    """

    solved: bool
    message: str
    method: str
    seconds: float
    posture_solves: int
    programs: int
    frames_changed: int
    missed: float
    stretch: float
    duration: float
    times: Array
    before: ClipCheck
    after: ClipCheck
    loads: LoadChange | None = None
    beside: float = 0.0
    jerk: float = 1.0
    speed: float = 1.0
    deviation: float = 0.0
    smoothed: int = 0
    rough: bool = False

    def __str__(self) -> str:
        """Three lines: what is left, before and after, and what it took."""
        was, now = self.before, self.after
        return (
            f"{'free' if self.solved else 'not free'}: {self.message}\n"
            f"frames in collision {was.colliding} before, {now.colliding} after; deepest {1e3 * was.deepest:.2f} mm "
            f"before, {1e3 * now.deepest:.2f} mm after; {now.dips} dips between frames\n"
            f"{self.method}: {self.seconds:.2f} s, {self.programs} programs, {self.posture_solves} postures; "
            f"{self.frames_changed} of {len(now.clip)} frames changed"
        )

    def __repr__(self) -> str:
        """One line."""
        return f"AvoidanceReport({self.method!r}, solved={self.solved}, {self.message!r})"


@dataclass(frozen=True, eq=False, repr=False)
class Avoided:
    """The answer of `avoid`.

    Attributes:
        clip: the clip that the method made.
        report: what is known of it.
    """

    clip: Clip
    report: AvoidanceReport

    def __str__(self) -> str:
        """The name of the clip, and the three lines of its report."""
        return f"{self.clip.name}, {self.report}"

    def __repr__(self) -> str:
        """One line."""
        return f"Avoided({self.clip.name!r}, {self.report!r})"


def avoider_named(name: str) -> Avoider:
    """A method with its default settings.

    Raises:
        UnknownNameError: there is no such method.
    """
    if name not in METHODS:
        raise UnknownNameError("method of avoidance", name, METHODS)
    module, kind = METHODS[name]
    made: Avoider = getattr(import_module(module), kind)()
    return made


def as_avoider(given: object) -> Avoider:
    """A method from its name, or a configured one as it is.

    Raises:
        UnknownNameError: there is no such method.
        InputError: it is neither.
    """
    if isinstance(given, str):
        return avoider_named(given)
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
        method: "trajectory", "frames", "fade", "bisection", or configured: `wb.motion.Trajectory(clearance=0.005)`.
        constraints: what holds in every frame. What a term takes from the start it takes from the original posture of
            its own frame: `Hold("left_hand", relative_to="right_hand")` keeps the grip that each frame has.
        hold_feet: keep the feet of a figure that has some where they stand, as `wb.motion.StanceFeet()` does, unless
            `constraints` has a `wb.motion.StanceFeet` of its own; False lets them slide.
        dynamics: keep the torques of joints within the strength of a person (a man of median strength if True; effort
            limits of a robot), and the zero moment point within the support. What the clip exceeds already is exceeded
            by no more: no joint needs more than its strength or than its largest torque before, and in no frame is the
            zero moment point farther outside than it was. Contacts come first; the report says what is left. The method
            "trajectory" can do this.
        keep_ends: keep the first and the last posture as they are where they are free.
        progress: called with an `AvoidProgress` now and then; the method ends with what it has if it returns True.

    Returns:
        The new clip and a report. A clip that could not be freed is an answer too: `report.solved` is False, and
        `report.message` says what is left.

    Raises:
        InputError: the scene's figure has other joints than the clip's, or a constraint does not fit.
        UnknownNameError: there is no such method, or a constraint names what the figure does not have.
    """
    instance(clip, Clip, "avoid: clip", "read one with wb.read_clip(path, figure)")
    scene = Scene(clip.figure) if scene is None else scene
    check_input(clip, scene, progress)
    chosen = as_avoider(method)
    given: tuple[Given, ...] = tuple(listed(constraints, "avoid: constraints", "[wb.Freeze('root')]"))
    if flag(hold_feet, "avoid: hold_feet") and not any(isinstance(term, StanceFeet) for term in given):
        given = (*given, StanceFeet()) if has_feet(scene.figure) else given
    strong = _strength(dynamics)
    if strong is not None:
        if not has_setting(chosen, "dynamics"):
            raise InputError(f"avoid: the method {chosen.name} does not take dynamics; give method='trajectory'")
        chosen = replace(chosen, dynamics=strong)  # type: ignore[type-var]
    strong = chosen.dynamics
    feet = usual_feet(scene.figure, given)
    loads = None if strong is None else torques(_carried(clip, scene), feet=feet, strength=strong)
    flag(keep_ends, "avoid: keep_ends")
    was = check(clip, scene, depth=COLLISION)
    asked, given = _bounds(clip, given, was, frame_terms(scene, clip.q, clip.dt, given, chosen.clearance), keep_ends)
    terms = frame_terms(scene, clip.q, clip.dt, given, chosen.clearance)
    watch = Watch(progress)
    told = None if progress is None else lambda now: watch.tell(now.share, now.note)
    began = time.perf_counter()

    def reported(result: MethodResult) -> AvoidanceReport:
        change = None
        if strong is not None and loads is not None:
            places = None if result.times is None else result.times / clip.dt
            change = load_change(loads, _carried(clip.with_q(result.q), scene), places, strong, feet)
        return _report(was, clip.with_q(result.q), terms, result, chosen.name, asked, change)

    try:
        with ctrl_c_ends_all():
            result = chosen.avoid(clip, scene, given, told)
        seconds, report = time.perf_counter() - began, reported(result)
    except UndefinedTermError as error:  # terms of one's own are finite at the original postures, if nowhere else
        why = str(error) if error.q is None else error.told_of(f"near frame {_nearest(clip, error.q)}")
        result = MethodResult(clip.q.copy(), message=f"the postures stay as they were: {why}")
        seconds, report = time.perf_counter() - began, replace(reported(result), solved=False)
    # what is not free, or held, is not worth the time; a new timing, or loads, would be others after it
    if report.rough and result.times is None and strong is None and not watch.ended:
        from wholebody.motion.smoothing import smoothed  # it loads scipy.sparse

        began = time.perf_counter()
        with ctrl_c_ends_all(), suppress(UndefinedTermError):  # what it was before stays
            found = smoothed(clip, result.q, asked, terms, chosen.clearance, watch)
            smooth = with_values(result, q=found.q, programs=result.programs + found.programs)
            other = reported(smooth)
            if found.windows and (other.solved or other.rough):
                result, report = smooth, replace(other, smoothed=found.windows)
        seconds += time.perf_counter() - began
    return Avoided(clip.with_q(result.q), replace(report, seconds=seconds))


def _nearest(clip: Clip, q: Array) -> int:
    """The frame whose posture is nearest to one (nq,)."""
    return int(np.argmin([np.linalg.norm(pin.difference(clip.figure.model, frame, q)) for frame in clip.q]))


def _carried(clip: Clip, scene: Scene) -> Clip:
    """A clip of the scene's figure, with what it carries."""
    return Clip(scene.figure, clip.q, clip.dt, clip.name)


def _bounds(
    clip: Clip, given: tuple[Given, ...], was: ClipCheck, terms: FrameTerms, keep_ends: bool
) -> tuple[MotionBounds, tuple[Given, ...]]:
    """The bounds on jerk, speed and deviation, resolved for a clip, and the terms with them in place of others.

    Raises:
        InputError: two are given.
    """
    stated = [term for term in given if isinstance(term, MotionBounds)]
    if len(stated) > 1:
        raise InputError("avoid: constraints has two wb.motion.MotionBounds; give one")
    asked = stated[0] if stated else MotionBounds()
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
    for gap, pair in enumerate(pairwise(clip.q)):
        if any(isinstance(term, Bound) for term in terms.given) and terms.past_speed(gap, *pair, state) > 0.0:
            passed[gap : gap + 2] = True
    asked = resolved(asked, free, passed)
    return asked, (*(term for term in given if not isinstance(term, MotionBounds)), asked)


def _strength(dynamics: object) -> Strength | None:
    """What `dynamics=` asks for."""
    if isinstance(dynamics, Strength):
        return dynamics
    return Strength() if flag(dynamics, "avoid: dynamics") else None


def _report(
    was: ClipCheck, after: Clip, terms: FrameTerms, result: MethodResult, method: str, asked: MotionBounds,
    loads: LoadChange | None,
) -> AvoidanceReport:  # fmt: skip
    scene, before = terms.scene, was.clip
    now = check(after, scene, depth=COLLISION)
    times = before.times if result.times is None else result.times
    timed = terms if result.times is None else terms.at(times)
    seen = excess(before.with_q(timed.q), after, filled(asked, largest=timed.largest))
    state = scene.state(after.q[0])
    misses = [timed.worst(frame, state.update(q)) for frame, q in enumerate(after.q)]
    past = [timed.past_speed(frame, q, following, state) for frame, (q, following) in enumerate(pairwise(after.q))]
    faster = max(past, default=0.0)
    at = max(range(len(misses)), key=lambda frame: misses[frame].by)
    missed = misses[at].by
    beyond = limit_violation(scene.figure, after.q)
    left = [] if not result.message else [result.message]
    if now.colliding:
        frame = int(np.argmax(now.depth))
        where = f"{_deepest_pair(now, frame, between=False)} at {frame * after.dt:.2f} s"
        left.append(f"{now.colliding} frames collide, {1e3 * now.deepest:.3g} mm deep at most: {where}")
    if now.dips:
        ends = np.maximum(now.depth[:-1], now.depth[1:])
        gap = int(np.argmax(np.where(ends <= now.tolerance, now.between, 0.0)))
        where = f"{_deepest_pair(now, gap, between=True)} from {gap * after.dt:.2f} s on"
        left.append(f"{now.dips} motions between frames dip, {1e3 * now.between[gap]:.3g} mm deep at most: {where}")
    if beyond > ROUNDING:
        left.append(f"a joint limit is missed by {beyond:.3g} rad or m")
    if missed > HELD:
        left.append(f"{misses[at].name} is missed by {missed:.3g} m or rad, at {at * after.dt:.2f} s")
    if faster > FASTER:
        left.append(
            f"a speed that was given is exceeded by {faster:.1%} of it, at {past.index(faster) * after.dt:.2f} s"
        )
    left += seen.said
    held = faster <= FASTER and beyond <= ROUNDING and missed <= HELD and (loads is None or loads.kept)
    held = held and now.free
    solved = held and not seen.said
    if loads is not None and not loads.kept:
        left.append("loads are beyond their bounds")
    if not (solved or left):
        left = ["something collides between two frames that collide"]
    message = "; ".join(left)
    if solved:
        said = f"; {method} says: {result.message}" if result.message else ""
        message = f"nothing collides, in the frames and between them, to 0.1 mm{said}"
    if result.times is not None:
        message += f"; slowed from {before.duration:.2f} to {after.duration:.2f} s, by {result.stretch:.3g} at most"
        fast = now.speeds[0] if now.speeds else None
        if fast is not None:
            message += f"; {fast.joint} is still faster than its limit of {fast.limit:.3g} rad/s or m/s"
    if terms.beside:
        away = f"{1e3 * terms.beside:.3g} mm"
        message += f"; parts held at each other are too near in the clip: they are held up to {away} beside"
    if loads is not None:
        message += f"; {loads}"
    changed = int((np.abs(after.q - timed.q) > SAME).any(axis=1).sum())
    return AvoidanceReport(
        solved, message, method, 0.0, result.posture_solves, result.programs, changed, missed, result.stretch,
        after.duration, times, was, now, loads, terms.beside, seen.jerk, seen.speed, seen.deviation,
        rough=held and not solved,
    )  # fmt: skip


def _deepest_pair(found: ClipCheck, place: int, *, between: bool) -> str:
    """The pair that is deepest in a frame, or in the gap after it."""
    return max(found.contacts, key=lambda each: (each.between if between else each.depth)[place]).names
