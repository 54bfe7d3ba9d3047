"""The protocol of methods that free a clip: what each of them gets, and what it returns.

`avoid` sets up one `Run`, has the method make postures of it, repairs what the method leaves to the shared repair, and
judges the answer. So a method has no judge, repair or report of its own. `keep_back` and `followed` keep postures on
one side of what the original motion passes through, which no rows of contact bring a limb out of.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.figures.state import State
from wholebody.figures.strength import Strength
from wholebody.methods.qp.method import QP
from wholebody.motion.clip import Clip
from wholebody.motion.faults import Faults, depth, dip_depth, faults
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.windows import Window, windows
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace
from wholebody.tasks import Posture
from wholebody.tasks.base import Bound, Constraint, Goal, filled


class AvoidProgress(NamedTuple):
    """Called while a clip is freed: the share done so far, from 0 to 1, and what is being done."""

    share: float
    note: str


Progress = Callable[[AvoidProgress], Any]  # called now and then; if it returns True, the method ends with what it has


class Watch:
    """Tells the caller how far a method is, and remembers in `ended` whether the caller ended it."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress, self.ended = progress, False

    def tell(self, share: float, note: str) -> bool:
        """Report; whether to end now."""
        if self._progress is not None and self._progress(AvoidProgress(min(max(share, 0.0), 1.0), note)) is True:
            self.ended = True
        return self.ended

    def teller(self, begun: float, share: float, note: str) -> Callable[[float], bool]:
        """Reports how far a part of the clip is, by the share of it; looking for collisions counts for a tenth."""
        return lambda part: self.tell(0.1 + 0.9 * (begun + share * part), note)


@dataclass
class Work:
    """Quadratic programs, and postures on their own, that were solved so far."""

    programs: int = 0
    posture_solves: int = 0
    _left_out: dict[str, set[int]] = field(default_factory=dict, init=False, repr=False)

    def leave_out(self, frame: int, said: str) -> None:
        """Keep what a problem of a frame says of a default that makes no sense there; see `Problem.left_out`."""
        if said:
            self._left_out.setdefault(said, set()).add(frame)

    @property
    def left_out(self) -> str:
        """Which defaults were left out in postures that were solved for, and in which frames; "" where none was."""
        found = []
        for said, frames in self._left_out.items():
            more = f" and {len(frames) - 1} others" if len(frames) > 1 else ""
            found.append(f"{said} (frame {min(frames)}{more})")
        return "; ".join(found)


class Follower:
    """Follows the original motion frame by frame."""

    def __init__(self, terms: FrameTerms, clearance: float, work: Work) -> None:
        """Set up for what is held in the frames of a clip, and a least distance of every pair, metres."""
        self._terms, self._clearance, self._work = terms, clearance, work
        q = terms.scene.figure.clamp(terms.q[0])
        self._problem = Problem(terms.scene, q, goals=[Posture(terms.q[0])], measures=(), clearance=0.0)
        bounds = [term.resolve(terms.scene, q) for term in terms.given if isinstance(term, Bound)]
        still = [bound for bound in bounds if np.isfinite(bound.bounds(State(terms.scene.model), None)).any()]
        self._problem.bounds = tuple(still)
        self._goal = Posture(terms.q[0]).resolve(terms.scene, q)
        self._tracker = QP(restarts=0).tracker(self._problem, terms.dt)

    def frame(self, number: int, q: Array) -> Array:
        """The posture (nq,) of a frame, after three steps at most from q (nq,) towards the original one."""
        terms, problem = self._terms, self._problem
        if terms.kept(number):
            return np.array(terms.q[number])
        problem.clearances = np.full_like(problem.clearances, self._clearance)
        q = terms.within(number, q)
        target = terms.q[number]
        near = filled(self._goal, target=target, resolved_target=target)
        held = terms.held(number)
        problem.goals = (near, *(term for term in held if isinstance(term, Goal)))
        problem.constraints = tuple(term for term in held if isinstance(term, Constraint))
        for _ in range(3):  # more come nearer to the original where much is in the way, for dearer frames
            step = self._tracker.step(q)
            self._work.programs += 1
            q = step.q
            if np.abs(step.displacement).max(initial=0.0) <= 1e-3:  # rad, m: the remainder is small
                break
        return q

    def freed(self, number: int, q: Array) -> Array:
        """A posture (nq,) of a frame without overlap, near a posture (nq,) that may overlap, by a solve of its own."""
        terms, work = self._terms, self._work
        held = terms.held(number)
        goals = [term for term in held if isinstance(term, Goal)]
        others = [term for term in held if not isinstance(term, Goal)]
        bounds = [term for term in terms.given if isinstance(term, Bound)]
        problem = Problem(terms.scene, terms.scene.figure.clamp(q), goals=goals, constraints=[*others, *bounds])
        work.leave_out(number, problem.left_out)
        problem.clearances = np.full_like(problem.clearances, self._clearance)
        solution = QP(restarts=0).solve(problem)
        work.posture_solves += 1
        work.programs += sum(solution.programs.values())
        return solution.q


@dataclass(eq=False)
class Run:
    """One clip while it is freed."""

    clip: Clip  # the original
    terms: FrameTerms  # original postures, what holds in each of them, figure and things
    workspace: Workspace  # of this run alone
    clearance: float  # least distance of every pair, metres
    watch: Watch  # follows the progress
    feet: tuple[str, ...] = ()  # segments or frames on which the figure stands
    work: Work = field(default_factory=Work)  # counts programs and postures

    @property
    def scene(self) -> Scene:
        """Figure and things."""
        return self.terms.scene

    @property
    def ended(self) -> bool:
        """Whether the caller ended it."""
        return self.watch.ended

    @cached_property
    def follower(self) -> Follower:
        """Follows the original postures, one after the other."""
        return Follower(self.terms, self.clearance, self.work)

    def of(self, terms: FrameTerms) -> Run:
        """The same run of other postures, or with something else held."""
        return replace(self, terms=terms)

    def frames(self, seconds: float, least: int) -> int:
        """How many frames a time has, at least so many."""
        return max(least, round(seconds / self.terms.dt))

    def faults(self, q: Array, first: int = 0) -> Faults:
        """What is wrong with postures (n, nq) of the frames from `first` on."""
        return faults(self.workspace, self.terms, q, self.clearance, first)

    def windows(self, marked: Mask, seconds: float, least: int = 3) -> list[Window]:
        """Windows around marked frames (n,), with so many seconds and at least so many frames on both sides."""
        return windows(marked, self.frames(seconds, least))


class MethodResult(NamedTuple):
    """What a method makes of a clip."""

    q: Array  # (n, nq) postures
    repair: bool = False  # whether the shared repair corrects remaining faults
    frozen: tuple[str, ...] = ()  # joints and groups that the repair keeps as they are in the original postures
    message: str = ""  # what did not succeed, one sentence; empty where all did, or where the judge sees it by itself
    times: Array | None = None  # (n,) seconds of the clip as it was at which each frame is; None where the timing stays
    stretch: float = 1.0  # factor by which the clip was slowed most, anywhere


class Avoider(Protocol):
    """A method that frees clips: frozen settings."""

    @property
    def name(self) -> str:
        """Name for tables, and by which `avoid` finds it."""

    @property
    def clearance(self) -> float:
        """Least distance of every pair that it keeps, metres."""

    @property
    def dynamics(self) -> Strength | None:
        """The strength within which it keeps torques; None where it looks at none."""

    def avoid(self, run: Run) -> MethodResult:
        """Free a clip; where the caller ends the run, with what there is. InputError for settings that do not fit."""


def has_setting(method: object, name: str) -> bool:
    """Whether a method has a setting of a name, such as "dynamics", so that `dataclasses.replace` changes it."""
    return is_dataclass(method) and name in {each.name for each in fields(method)}


SHALLOW = 2e-3  # m: a deeper dip passes through something; others are arcs between postures in contact


def keep_back(run: Run, q: Array, gap: int, first: int = 0, *, cancelled: Callable[[], bool] | None = None) -> bool:
    """Keep postures q (n, nq) beside a gap on one side of what its motion passes, in place; whether there was any."""
    if dip_depth(run.workspace, q[gap], q[gap + 1]) <= SHALLOW:
        return False
    sides = {side: (_beside(run, q, gap, side, first), list[Array]()) for side in (1, -1)}
    while sides:
        for side, (postures, found) in list(sides.items()):  # in turn, so that the shorter motion ends both
            if cancelled is not None and cancelled():
                return False
            posture, joined = next(postures, (None, False))
            if posture is None:
                del sides[side]
                continue
            found.append(posture)
            if joined:
                begin = gap + 1 if side > 0 else gap + 1 - len(found)
                q[begin : begin + len(found)] = found[::side]
                return True
    return False


def followed(run: Run, window: Window, middle: int, begun: Array | None = None) -> Array:
    """Postures (n, nq) of a window, followed from a frame, at `begun` (nq,) or freed, until calm for 0.25 s."""
    terms = run.terms
    q = np.array(terms.q[window.first : window.end])
    q[middle - window.first] = run.follower.freed(middle, terms.q[middle]) if begun is None else begun
    for side, frames in ((1, range(middle + 1, window.end)), (-1, range(middle - 1, window.first - 1, -1))):
        calm = 0
        for frame in frames:
            here = run.follower.frame(frame, q[frame - side - window.first])
            q[frame - window.first] = here
            calm = calm + 1 if np.abs(here - terms.q[frame]).max() <= 1e-4 else 0
            if calm == run.frames(0.25, 2):
                break
    return q


def _beside(run: Run, q: Array, gap: int, side: int, first: int) -> Iterator[tuple[Array, bool]]:
    """Postures after (side 1) or before (-1) a gap, on the side of its end, and whether the next one joins as it is."""
    # They follow the original until the motion to the next frame passes nothing.
    workspace = run.workspace
    here, frame = (q[gap], gap + 1) if side > 0 else (q[gap + 1], gap)
    while 0 <= frame < len(q):
        there = run.follower.frame(first + frame, here)
        if max(depth(workspace, there), dip_depth(workspace, here, there)) > SHALLOW:
            return
        here, frame = there, frame + side
        yield here, not 0 <= frame < len(q) or dip_depth(workspace, here, q[frame]) <= SHALLOW
