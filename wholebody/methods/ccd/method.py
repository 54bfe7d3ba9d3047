"""The method ccd: it reaches by cyclic coordinate descent and removes overlap by the loop of the avatar paper."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Annotated, Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import posture
from wholebody.base.fields import Checked
from wholebody.geometry.continuous.passing_through import last_free
from wholebody.methods.base import CCD_TOLERANCE, Iterations, Restarts, Seed, TimeLimit, unseen
from wholebody.methods.ccd.reaching import Reach
from wholebody.methods.ccd.resolver import PERTURBATIONS, TOLERANCE, OverlapResolver
from wholebody.methods.ccd.terms import BY_DEFAULT, Paths, Request, read
from wholebody.methods.conclusion import Descends, DescentTracker, Ending
from wholebody.methods.contradictions import NEAREST, contradictions, least_left
from wholebody.methods.control import Control
from wholebody.methods.starts import Attempt, Multistart
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace
from wholebody.solution import TraceEntry

SHARE = 0.5  # of the tolerance, to which goals are met and overlap is removed, so that the assessment agrees


@dataclass
class _Trial:
    """A posture with its deepest overlap [m], the largest error of its goals, and whether its search converged."""

    q: Array
    overlap: float
    error: float
    converged: bool

    def better(self, other: _Trial, tolerance: float) -> bool:
        """Less overlap first, then the smaller error."""
        mine, theirs = max(self.overlap, tolerance), max(other.overlap, tolerance)
        return (mine, self.error) < (theirs, other.error)


@dataclass(frozen=True)
class CCD(Checked, Descends):
    """Cyclic coordinate descent: one joint at a time, each to its best value, from the tip inwards.

    Takes Point, Frame, Orientation and Relative goals. A goal on a chain of the figure moves the joints of that chain
    up to its frame; any other goal moves all joints between its frame and the root; the root itself stays. A Relative
    goal moves the joints of both frames by turns, but for those that move both. Limits hold, reach cones and ranges of
    motion if the problem has `ReachCones` and `RangeOfMotion`, clearances by the loop of Schmidl and Lin, which may
    turn other chains too. `Hold` relative to another frame is met as a `Relative` goal is, by the joints of both;
    any other `Hold` is taken if no moving joint can move its frame. `Freeze` and `StepLimit` are taken.
    Balance, which a person keeps by default, is left to the assessment.

    Other terms (Balance, Plane, Axis, CenterOfMass, measures) are refused by name. The method
    has no objective beside the goals. A problem without measures is taken although its default is `Effort()`: the
    descent begins at the start and stops at the first posture that meets the goals, which is near the start and not the
    nearest; `assessment.measure` gives its effort.

    Attributes:
        tolerance: metres and radians to which goals are met.
        iterations: most sweeps from one start.
        restarts: most further starts, anywhere within the limits.
        seed: of the restarts and of the order of the chains in overlap resolution.
        time_limit: seconds after which a solve ends with the best posture so far, infinite for no limit. Where None, it
            ends after four seconds of processor time.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> hand = wb.load("hand")
        >>> tip = wb.Problem(wb.Scene(hand), goals=[wb.Point("right_index_tip", (0.15, 0.03, -0.02))])
        >>> wb.solve(tip, wb.methods.CCD()).method
        'ccd'
    """

    name = "ccd"
    on_the_way = 1e-3  # m, rad
    tolerance: Annotated[float, CCD_TOLERANCE] = 1e-4
    iterations: Iterations = 400
    restarts: Restarts = 12
    seed: Seed = 0
    time_limit: TimeLimit = None

    def _check_terms(self, problem: Problem) -> None:
        read(problem)

    def _unseen(self, problem: Problem) -> tuple[str, ...]:
        """See `Descends._unseen`: the balance that people keep by default."""
        return unseen(problem, lambda term: isinstance(term, BY_DEFAULT))

    def _descend(self, problem: Problem, workspace: Workspace, control: Control) -> Ending:
        """See `Descends._descend`."""
        return _Search(self, problem, _Shared(problem.scene, workspace), control).end()

    def tracker(self, problem: Problem, dt: float) -> CCDTracker:
        """A tracker that searches anew at every step; frames during a motion to a millimetre.

        Raises:
            InputError: dt is not a positive finite number, or the scene changed after the problem was made.
        """
        return CCDTracker(self, problem, dt)


class CCDTracker(DescentTracker):
    """Follows by searches; it resolves overlap with things that were moved into the figure."""

    def __init__(self, method: CCD, problem: Problem, dt: float) -> None:
        super().__init__(method, problem, dt)
        self._shared = _Shared(problem.scene, self.workspace)
        self.overlap_resolutions(problem.start)  # makes its chains, which would take as long as ten frames

    def search(self, method: Any, problem: Problem, control: Control) -> Ending:
        """The end of a search."""
        return _Search(method, problem, self._shared, control).end()

    def overlap_resolutions(self, q: Array) -> Sequence[Array]:
        """The result of overlap resolution at the posture q (nq,), as far as bounds on velocities allow."""
        search = _Search(self._exact, self._begun(q), self._shared, Control(np.inf))
        return (self.bounded(q, search.pushed_out(posture(q, self.workspace.model.nq))),)


class _Shared:
    """What searches share that move the same joints: kinematics of the limbs, and what resolves overlap."""

    def __init__(self, scene: Scene, workspace: Workspace) -> None:
        self.workspace, self._scene = workspace, scene
        self._key: tuple[object, ...] = ()
        self.paths: Paths = {}

    def ready(self, request: Request, control: Control) -> tuple[Reach, OverlapResolver]:
        """Both, made anew if the request moves or keeps something else than the last one."""
        key = (request.joints, request.kept)
        if key != self._key:
            self._key = key
            self._reach = Reach(self._scene.figure, request, control)
            self._resolver = OverlapResolver(self._scene, self.workspace, request.kept)
        self._reach.begin(request, control)
        return self._reach, self._resolver


class _Search(Multistart[_Trial]):
    """One solve: starts, and from each of them reaching and overlap resolution in alternation."""

    def __init__(self, method: CCD, problem: Problem, shared: _Shared, control: Control) -> None:
        super().__init__(control)
        self._method, self._problem = method, problem
        self._request = read(problem, shared.workspace.state, shared.paths)
        self._reach, self._resolver = shared.ready(self._request, control)
        self._tolerance = min(TOLERANCE, SHARE * method.tolerance)
        self._resolver.begin(problem.clearances, self._tolerance, control)
        self._rng = np.random.default_rng(method.seed)
        self.sweeps = 0
        self._workspace = shared.workspace
        self.trace: list[TraceEntry] = []

    def end(self) -> Ending:
        """The end of the search."""
        best = self._closed(self.run())
        turns = len(self.trace)
        return Ending(
            best.q,
            best.converged,
            self.sweeps,
            tuple(self.trace),
            "from the start" if turns == 1 else f"at turn {turns}",
            unit="sweeps",
            contradictions=self.contradictions,
        )

    def run(self) -> _Trial:
        """The best result of all starts, or the first that meets goals and clearances."""
        self.search(self._attempts(self._problem.scene.figure.clamp(self._problem.start)))
        if self.solves(self.best):
            self.contradictions = ()
        return self.best if not self.control.over else replace(self.best, converged=False)

    def _attempts(self, start: Array) -> Iterator[Attempt[_Trial]]:
        self._resolver.query(start)
        free = start if self._resolver.deepest <= self._tolerance else None
        yield Attempt([start], lambda q: self._attempt(q, free, ""), "")
        self.contradictions = contradictions(self._problem, self._workspace)
        if not self.enough():
            starts = (self._reach.disturbed(start, inf, self._rng) for _ in range(self._method.restarts))
            yield Attempt(starts, lambda q: self._attempt(q, free, "restart"), "")

    def _closed(self, best: _Trial) -> _Trial:
        """A trial that misses the goals, or a posture between, where loops are closed and nothing overlaps.

        Without one, as time may end, the trial or the start, whose loops are less open.
        """
        if not self._request.loops or self.solves(best):
            return best
        self._reach.begin(replace(self._request, goals=self._request.loops), Control(np.inf))
        model, start = self._problem.scene.model, self._problem.scene.figure.clamp(self._problem.start)
        for share in (1.0, 0.5, 0.25, 0.1, 0.0):
            between = np.asarray(pin.interpolate(model, start, best.q, share))
            q, closed = self._reach.run(between, SHARE * self._method.tolerance, self._method.iterations)
            self._resolver.query(q)
            if closed.error <= self._method.tolerance and self._resolver.deepest <= self._tolerance:
                return replace(best, q=q)
        return min(best, replace(best, q=start), key=lambda one: self._reach.error(one.q))

    def better(self, one: _Trial, other: _Trial) -> bool:
        """See `Multistart.better`."""
        return one.better(other, self._tolerance)

    def solves(self, end: _Trial) -> bool:
        """See `Multistart.solves`."""
        return end.error <= SHARE * self._method.tolerance and end.overlap <= self._tolerance

    def enough(self) -> bool:
        """Whether the problem has no solution, or none nearer than the best result."""
        least = least_left(self.contradictions)
        return least is None or bool(least and self.best.error <= NEAREST * least)

    def pushed_out(self, q: Array) -> Array:
        """The result of overlap resolution at a posture q (nq,), or at one beside it, if that is better."""
        least, out = inf, q
        for size in (0.0, *PERTURBATIONS):
            perturbed = self._reach.disturbed(q, size, self._rng) if size else q
            pushed, left = self._resolver.resolve(perturbed, self._rng)
            if self._resolver.deepest < least:
                least, out = self._resolver.deepest, pushed
            if not left:
                break
        return out

    def _attempt(self, q: Array, free: Array | None, note: str) -> _Trial:
        """Reach and resolve overlap in alternation, until goals and clearances are met, or neither step gains."""
        best: _Trial | None = None
        for turn in range(6):
            before = q
            q, reached = self._reach.run(q, SHARE * self._method.tolerance, self._method.iterations)
            self.sweeps += reached.sweeps
            left = self._resolver.query(q)
            trial = _Trial(q, self._resolver.deepest, reached.error, reached.converged)
            if left:
                q, left = self._resolver.resolve(q, self._rng)
                trial = _Trial(q, self._resolver.deepest, self._reach.error(q), reached.converged)
            if left and free is not None:
                back = last_free(self._problem.scene.model, free, q, self._resolver.query, 12)  # halvings: to a 4000th
                self._resolver.query(back)
                trial = _Trial(back, self._resolver.deepest, self._reach.error(back), True)
            step = float(np.abs(pin.difference(self._problem.scene.model, before, q)).max(initial=0.0))
            self.trace.append(TraceEntry(trial.error, trial.overlap, 0.0, step, note if turn == 0 else "overlap"))
            self.control.tell(self.trace[-1])
            gained = best is None or trial.better(best, self._tolerance)
            if gained:
                best = trial
            if self.solves(trial) or not gained or self.control.over:
                break
        assert best is not None
        return best
