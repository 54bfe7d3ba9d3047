"""The judge of clips that were freed: it looks at all pairs, and shares nothing with the methods.

A clip is solved if nothing overlaps by more than 0.1 mm in its frames and between them, joint limits hold, what is held
is missed by at most 1 mm or 1 mrad, speeds that were given by at most 2 %, and jerk, speed and deviation are within
`MotionBounds`. What must give way is seen from the original postures, before anything is computed: see `foreseen`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin

from wholebody.assessment.motion import limit_violation
from wholebody.base.arrays import Array
from wholebody.base.errors import millimetres
from wholebody.figures.model_check import joint_of
from wholebody.motion.avoider import MethodResult, Work
from wholebody.motion.checking import ClipCheck, check
from wholebody.motion.clip import Clip
from wholebody.motion.faults import DEPTH
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.load_change import LoadChange
from wholebody.motion.measures import MotionBounds, excess
from wholebody.tasks import Hold
from wholebody.tasks.base import filled

COLLISION = 1e-4  # m: a frame, or the motion between two, that is deeper collides
HELD = 1e-3  # m, rad: by which what is held may be missed in a solved clip
ROUNDING = 1e-6  # rad, m: by which limits may be missed


@dataclass(frozen=True, repr=False)
class AvoidanceReport:
    """What a method did to a clip, and what it left.

    Attributes:
        solved: whether the clip is free, limits hold, and what is held and asked is met, by a check of its own.
        message: one sentence that names the remaining faults, or says that all is free.
        method: name of the method.
        seconds: wall time of the method, without the judgement.
        posture_solves, programs: how many postures were solved for on their own, and quadratic programs.
        frames_changed: how many postures are others than those of the clip before at the same place of its timing.
        missed: largest miss of a constraint in any frame, metres or radians.
        stretch: factor by which the clip was slowed most, anywhere; 1 where its timing is as it was.
        duration: of the answer, seconds.
        times: (m,) seconds of the clip as it was at which each frame of the answer is.
        before, after: the check of the clip as it was, and of the answer.
        loads: torques and the zero moment point before and after, where `dynamics` was asked for; else None.
        beside: by how much a grip that overlaps is held at most beside its place, metres; 0 where none does.
        jerk, speed: largest jerk over half a second, and speed of a joint, in parts of the original's nearby; see
            `wb.motion.MotionBounds`.
        deviation: largest change of a posture that was free, radians or metres.
        smoothed: windows of frames that were too rough and were made smooth after the method.
        rough: whether jerk, speed or deviation are beyond their bounds, and nothing else is wrong.

    Examples:
        >>> report = wb.avoid(clip, scene).report
        >>> report.solved, report.frames_changed
        (True, 0)
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
        """Three lines: the faults, before and after, and what it took."""
        was, now = self.before, self.after
        return (
            f"{'free' if self.solved else 'not free'}: {self.message}\n"
            f"frames in collision {was.colliding} before, {now.colliding} after; deepest {1e3 * was.deepest:.2f} mm "
            f"before, {1e3 * now.deepest:.2f} mm after; {now.dips} dips between frames\n"
            f"{self.method}: {self.seconds:.2f} s, {self.programs} programs, {self.posture_solves} postures; "
            f"{self.frames_changed} of {len(now.clip)} frames changed"
        )

    def __repr__(self) -> str:
        return f"AvoidanceReport({self.method!r}, solved={self.solved}, {self.message!r})"


@dataclass(frozen=True, eq=False, repr=False)
class Avoided:
    """The answer of `avoid`: the clip that the method made, and the report on it.

    Examples:
        >>> answer = wb.avoid(clip, scene)
        >>> len(answer.clip) == len(clip)
        True
    """

    clip: Clip
    report: AvoidanceReport

    def __str__(self) -> str:
        """The name of the clip, and the three lines of its report."""
        return f"{self.clip.name}, {self.report}"

    def __repr__(self) -> str:
        return f"Avoided({self.clip.name!r}, {self.report!r})"


def judged(
    was: ClipCheck, terms: FrameTerms, asked: MotionBounds, result: MethodResult, work: Work, method: str,
    loads: LoadChange | None = None,
) -> AvoidanceReport:  # fmt: skip
    """The report on what a method made of a clip, of its check before, what holds in it, and the settings."""
    before, after = was.clip, was.clip.with_q(result.q)
    now = check(after, terms.scene, depth=COLLISION)
    times = before.times if result.times is None else result.times
    timed = terms if result.times is None else terms.at(times)
    seen = excess(before.with_q(timed.q), after, filled(asked, largest=timed.largest))
    missed, said = _missed(timed, after)
    said += [] if loads is None else loads.missed
    held = not said
    solved = now.free and held and not seen.said
    left = [result.message] if result.message else []
    left += [*_collisions(now), *said, *seen.said]
    if solved:
        noted = f"; {method} says: {result.message}" if result.message else ""
        message = f"nothing collides, in the frames and between them, to 0.1 mm{noted}"
    else:
        message = "; ".join(left or ["something collides between two frames that collide"])
        if now.free and loads is not None and loads.missed and result.times is None and not loads.before.flies:
            message += "; less is needed of a slower clip, Trajectory(stretch=2)"
    message += "".join(f"; {part}" for part in _added(before, now, terms, result, loads))
    return AvoidanceReport(
        solved=solved,
        message=message,
        method=method,
        seconds=0.0,
        posture_solves=work.posture_solves,
        programs=work.programs,
        frames_changed=int((np.abs(after.q - timed.q) > 1e-9).any(axis=1).sum()),  # more than rounding
        missed=missed,
        stretch=result.stretch,
        duration=after.duration,
        times=times,
        before=was,
        after=now,
        loads=loads,
        beside=terms.beside,
        jerk=seen.jerk,
        speed=seen.speed,
        deviation=seen.deviation,
        rough=now.free and held and not solved,
    )


def _missed(terms: FrameTerms, clip: Clip) -> tuple[float, list[str]]:
    """By how much what is held is missed most, metres or radians, and sentences on what is missed by too much."""
    state, said = terms.scene.state(clip.q[0]), list[str]()
    misses = [terms.worst(frame, state.update(q)) for frame, q in enumerate(clip.q)]
    past = [terms.past_speed(frame, q, following) for frame, (q, following) in enumerate(pairwise(clip.q))]
    beyond, faster = limit_violation(terms.scene.figure, clip.q), max(past, default=0.0)
    at = max(range(len(misses)), key=lambda frame: misses[frame].by)
    if not beyond <= ROUNDING:
        said.append(f"a joint limit is missed by {beyond:.3g} rad or m")
    if not misses[at].by <= HELD:
        said.append(f"{misses[at].name} is missed by {misses[at].by:.3g} m or rad, at {at * clip.dt:.2f} s")
    if not faster <= 0.02:
        when = f"{past.index(faster) * clip.dt:.2f} s"
        said.append(f"a speed that was given is exceeded by {faster:.1%} of it, at {when}")
    return misses[at].by, said


def _collisions(now: ClipCheck) -> list[str]:
    """Sentences on frames that collide, and on motions that dip between free frames."""
    said, dt = list[str](), now.clip.dt
    if now.colliding:
        frame = int(np.argmax(now.depth))
        where = f"{_deepest_pair(now, frame, between=False)} at {frame * dt:.2f} s"
        said.append(f"{now.colliding} frames collide, {millimetres(now.deepest)} deep at most: {where}")
    if now.dips:
        ends = np.maximum(now.depth[:-1], now.depth[1:])
        gap = int(np.argmax(np.where(ends <= now.tolerance, now.between, 0.0)))
        where = f"{_deepest_pair(now, gap, between=True)} from {gap * dt:.2f} s on"
        said.append(f"{now.dips} motions between frames dip, {millimetres(now.between[gap])} deep at most: {where}")
    return said


def _added(
    before: Clip, now: ClipCheck, terms: FrameTerms, result: MethodResult, loads: LoadChange | None
) -> list[str]:
    """What is said of every answer, solved or not: its timing, grips that are held beside, loads."""
    said = list[str]()
    if result.times is not None:
        after = now.clip.duration
        said.append(f"slowed from {before.duration:.2f} to {after:.2f} s, by {result.stretch:.3g} at most")
        if now.speeds:
            fast = now.speeds[0]
            said.append(f"{fast.joint} is still faster than its limit of {fast.limit:.3g} rad/s or m/s")
    if terms.beside:
        away = millimetres(terms.beside)
        said.append(f"parts held at each other are too near in the clip: they are held up to {away} beside")
    if loads is not None:
        said.append(str(loads))
    return said


def _deepest_pair(found: ClipCheck, place: int, *, between: bool) -> str:
    """The pair that is deepest in a frame, or in the gap after it."""
    return max(found.contacts, key=lambda each: (each.between if between else each.depth)[place]).names


def foreseen(terms: FrameTerms, was: ClipCheck, keep_ends: bool) -> str:
    """Sentences with their mends: what is held inside things, jumps that collide, ends that cannot be kept; or ""."""
    return "; ".join(
        said for said in (_held(terms, was), terms.sunk, _jumps(was), _ends(was) if keep_ends else "") if said
    )


def _held(terms: FrameTerms, was: ClipCheck) -> str:
    """What is held or frozen, with what it carries, where it is inside of a thing, so that no method can free it."""
    figure, model, parts, words = terms.scene.figure, terms.scene.model, list[str](), set[str]()
    carrier = {name: each.segment for name, each in terms.scene.objects.items() if each.segment is not None}
    carrier |= {name: name for name in figure.segments}
    stands = [{model.frames[figure.frame_id(name)].parentJoint for name in names} for names in terms.stands]
    still = [term for term in terms.given if isinstance(term, Hold) and term.relative_to is None]
    held = {model.frames[figure.frame_id(term.frame)].parentJoint for term in still}
    bounds = terms.bounds(0)
    kept = (bounds.lower == 0.0) & (bounds.upper == 0.0)
    moving = {
        j for j in range(1, model.njoints) if not kept[model.idx_vs[j] : model.idx_vs[j] + model.nvExtendeds[j]].all()
    }
    for contact in was.contacts:
        part, thing = contact.first, contact.second
        part, thing = (part, thing) if part in carrier else (thing, part)
        joints = [
            model.frames[figure.frame_id(str(carrier[one]))].parentJoint if one in carrier else 0
            for one in (part, thing)
        ]
        between = set(model.supports[joints[0]]) ^ set(model.supports[joints[1]])  # joints that can bring them apart
        frozen = bool(between) and not between & moving
        if part not in carrier or (contact.kind != "thing" and not frozen):
            continue
        joint = joints[0]
        standing = np.array([joint in here for here in stands])
        inside = (standing | (joint in held or frozen)) & (contact.depth > HELD)
        if inside.any():
            word = "stands" if (standing & inside).any() else "is held" if joint in held else "is frozen"
            words.add(word)
            first = f"first in frame {int(inside.argmax())}"
            parts.append(f"{part} {word} up to {1e3 * contact.depth[inside].max():.0f} mm inside {thing} ({first})")
    if not parts:
        return ""
    if "stands" in words:
        return (
            f"{', '.join(parts)}, and is held there; let feet slide by hold_feet=False, or retarget the recording with "
            "this scene, which puts feet on what is below them"
        )
    return f"{', '.join(parts)}; leave that {'Hold' if 'is held' in words else 'Freeze'} out"


def _jumps(was: ClipCheck) -> str:
    """Where the recording jumps while something collides, with what is worn on it."""
    model, q = was.clip.figure.model, was.clip.q
    steps = np.abs([pin.difference(model, *pair) for pair in pairwise(q)]).reshape(-1, model.nv)
    around = np.zeros_like(steps)
    around[1:], around[:-1] = steps[:-1], np.maximum(around[:-1], steps[1:])
    # a jump is so many times as long as the steps before and after it
    jumps = (steps > np.maximum(0.35, 4.0 * around)) & (was.between > was.tolerance)[:, None]  # rad, m: least
    if not jumps.any():
        return ""
    gap, column = np.unravel_index(int(np.where(jumps, steps, 0.0).argmax()), steps.shape)
    joint = model.names[joint_of(model, int(column))]
    met = max(was.contacts, key=lambda contact: contact.between[gap])
    more = int(jumps.any(axis=1).sum()) - 1
    also = f", and jumps {more} times more" if more else ""
    return (
        f"the recording jumps from frame {gap} to {gap + 1} ({joint} by {steps[gap, column]:.2g} rad or m) while "
        f"{met.first} and {met.second} overlap{also}, and the freed clip will jump too; cut it there (clip[:{gap + 1}] "
        f"and clip[{gap + 1}:]), or leave frames out and fill them in by resampled"
    )


def _ends(was: ClipCheck) -> str:
    """Which of the ends that are to be kept collide, and where the clip could begin or end."""
    free = np.flatnonzero(was.depth <= DEPTH)
    parts = []
    for word, frame in (("first", 0), ("last", len(was.depth) - 1)):
        if was.depth[frame] > DEPTH:
            worst = max(was.contacts, key=lambda contact: contact.depth[frame], default=None)
            pair = f" ({worst.first} and {worst.second})" if worst is not None else ""
            mend = "leave keep_ends out"
            if len(free):
                mend = f"give clip[{free[0]}:]" if word == "first" else f"give clip[:{free[-1] + 1}]"
            parts.append(
                f"the {word} posture overlaps by {1e3 * was.depth[frame]:.1f} mm{pair} and cannot be kept; {mend}"
            )
    return "; ".join(parts)
