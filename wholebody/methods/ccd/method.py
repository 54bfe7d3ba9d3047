"""The method ccd: reaches by cyclic coordinate descent, overlap removed by the loop of the avatar paper."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.checks import posture
from wholebody.geometry.continuous.bisection import last_free
from wholebody.methods.base import SolvingTracker, UnsupportedTermError
from wholebody.methods.ccd.overlap_resolution.frames import PERTURBATIONS
from wholebody.methods.ccd.overlap_resolution.resolver import TOLERANCE, OverlapResolver
from wholebody.methods.ccd.reaching import Reach
from wholebody.methods.ccd.terms import read
from wholebody.methods.conclusion import Ending, concluded
from wholebody.methods.contradictions import NEAREST, Contradiction, contradictions, least_left
from wholebody.methods.control import Control, Progress, check_time_limit
from wholebody.methods.inputs import CCD_TOLERANCE, ITERATIONS, RESTARTS, SEED, check_problem, check_settings
from wholebody.problem import Problem
from wholebody.solution import Solution, TraceEntry
from wholebody.workspace import Workspace

DISTURBANCES = (0.0, 0.05, 0.2, 0.6)  # rad: of the first starts, from the posture at hand; later ones begin anywhere
ROUNDS = 6  # reaching and leaving overlap by turns, from one start
ON_THE_WAY = 1e-3  # m, rad: to which the frames of a motion meet their goals before the end
HALVINGS = 12  # of the way back to the start, which ends within a 4000th of it
SHARE = 0.5  # of the tolerance: to what goals are met and overlap is removed, so that the judge agrees


@dataclass
class _Trial:
    """A posture with its deepest overlap [m], the largest error of its goals, and whether its search came to rest."""

    q: Array
    overlap: float
    error: float
    rested: bool

    def better(self, other: _Trial, tolerance: float) -> bool:
        """Less overlap first, then the smaller error."""
        mine, theirs = max(self.overlap, tolerance), max(other.overlap, tolerance)
        return (mine, self.error) < (theirs, other.error)


@dataclass(frozen=True)
class CCD:
    """Cyclic coordinate descent: one joint at a time, each to its best, from the tip inwards.

    Takes Point, Frame and Orientation goals. A goal on a chain of the figure moves the joints of that chain up to its
    frame, any other goal all joints between its frame and the root; the root itself stays. Limits are kept always,
    reach cones where the problem asks for `ReachCones`, clearances by the loop of Schmidl and Lin, which may turn
    other chains too. `Hold` is taken where nothing that moves can move it, `Freeze` and `StepLimit` as they are.

    Everything else (Balance, Plane, Axis, CenterOfMass, Relative, measures) is refused by name. There is no objective
    beside the goals: a problem that gives no measures is taken as it is, although it then means `Effort()`, since the
    descent begins at the start and stops at the first posture that serves. That is near to the start and not the
    nearest; `assessment.measure` says what it costs.

    Attributes:
        tolerance: metres and radians to which goals are met.
        iterations: most sweeps from one start.
        restarts: most further starts, first near the posture at hand, then anywhere within the limits.
        seed: of the restarts and of the order in which chains leave overlap.
        time_limit: seconds after which a solve ends with the best posture so far, infinite for no limit. Where None, it
            ends after four seconds of processor time.
    """

    tolerance: float = 1e-4
    iterations: int = 400
    restarts: int = 12
    seed: int = 0
    time_limit: float | None = None

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            InputError: a setting out of range.
        """
        check_settings(self, tolerance=CCD_TOLERANCE, iterations=ITERATIONS, restarts=RESTARTS, seed=SEED)
        check_time_limit(self.time_limit)

    @property
    def name(self) -> str:
        """Name for tables."""
        return "ccd"

    def accepts(self, problem: Problem) -> str | None:
        """None where this method can take all terms; else the sentence that names those that it cannot."""
        try:
            read(check_problem(problem, "CCD.accepts: problem"))
        except UnsupportedTermError as error:
            return str(error)
        return None

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture.

        Goals out of reach and starts in penetration are answers, not errors.

        Args:
            problem: what is asked.
            progress: see `wholebody.methods.control.Progress`.

        Raises:
            UnsupportedTermError: the problem has terms that this method cannot take.
            InputError: the scene changed after the problem was stated.
        """
        check_problem(problem, "CCD.solve: problem")
        began = time.perf_counter()
        with problem.lend() as workspace, Control(self.time_limit, progress) as control:
            search = _Search(self, problem, workspace, control)
            best = search.run()
        turns = len(search.trace)
        ending = Ending(
            best.q,
            best.rested,
            search.sweeps,
            tuple(search.trace),
            "from the start" if turns == 1 else f"at turn {turns}",
            unit="sweeps",
            contradictions=search.contradictions,
        )
        return concluded(problem, ending, method=self.name, tolerance=self.tolerance, control=control, began=began)

    def tracker(self, problem: Problem, dt: float) -> SolvingTracker:
        """What follows the goals of a problem by solving every step anew; frames on the way to a millimetre.

        Raises:
            InputError: dt is not a positive finite number, or the scene changed after the problem was stated.
        """
        return _CCDTracker(self, problem, dt, replace(self, tolerance=ON_THE_WAY))

    def pushed_out(self, problem: Problem, q: Array) -> Array:
        """Where pushing the posture q (nq,) out of what it overlaps ends, whatever the goals are.

        It may be inside of something still, where nothing leads out.

        Raises:
            UnsupportedTermError: the problem has terms that this method cannot take.
            InputError: the scene changed after the problem was stated.
        """
        check_problem(problem, "CCD.pushed_out: problem")
        q = posture(q, problem.scene.model.nq)
        with problem.lend() as workspace:
            return _Search(self, problem, workspace, Control(np.inf)).pushed_out(q)


class _CCDTracker(SolvingTracker):
    """Follows by solves; pushes the figure out of what came into it."""

    def __init__(self, method: CCD, problem: Problem, dt: float, rough: CCD) -> None:
        super().__init__(method, problem, dt, rough)
        self._ccd = method

    def ways_out(self, q: Array) -> Sequence[Array]:
        """Where pushing the posture q (nq,) out ends."""
        return (self._ccd.pushed_out(self.problem, q),)


class _Search:
    """One solve: starts, and from each of them reaching and leaving overlap by turns."""

    def __init__(self, method: CCD, problem: Problem, workspace: Workspace, control: Control) -> None:
        self._method, self._problem, self._control = method, problem, control
        request = read(problem)
        self._reach = Reach(problem.scene.figure, request, control)
        self._tolerance = min(TOLERANCE, SHARE * method.tolerance)
        self._resolver = OverlapResolver(
            problem.scene,
            workspace,
            problem.clearances,
            fixed=request.fixed,
            cones=request.cones,
            tolerance=self._tolerance,
            control=control,
        )
        self._rng = np.random.default_rng(method.seed)
        self.sweeps = 0
        self.contradictions: tuple[Contradiction, ...] = ()
        self._workspace = workspace
        self.trace: list[TraceEntry] = []

    def run(self) -> _Trial:
        """The best of all starts, or the first that serves."""
        start = self._problem.scene.figure.clamp(self._problem.start)
        self._resolver.query(start)
        free = start if self._resolver.deepest <= self._tolerance else None
        best: _Trial | None = None
        for attempt in range(1 + self._method.restarts):
            size = DISTURBANCES[attempt] if attempt < len(DISTURBANCES) else inf
            q = start if attempt == 0 else self._reach.disturbed(start, size, self._rng)
            trial = self._attempt(q, free, "" if attempt == 0 else "restart")
            if best is None or trial.better(best, self._tolerance):
                best = trial
            if self._serves(best):
                self.contradictions = ()
            if self._serves(best) or self._control.over:
                break
            if attempt == 0:
                self.contradictions = contradictions(self._problem, self._workspace)
            least = least_left(self.contradictions)
            if least is None or (least and best.error <= NEAREST * least):
                break
        assert best is not None
        return best if not self._control.over else replace(best, rested=False)

    def pushed_out(self, q: Array) -> Array:
        """Where pushing a posture q (nq,) out ends, or pushing one a little beside it, where that leads farther out."""
        least, out = inf, q
        for size in (0.0, *PERTURBATIONS):
            perturbed = self._reach.disturbed(q, size, self._rng) if size else q
            pushed, left = self._resolver.resolve(perturbed, self._rng)
            if self._resolver.deepest < least:
                least, out = self._resolver.deepest, pushed
            if not left:
                break
        return out

    def _serves(self, trial: _Trial) -> bool:
        return trial.error <= SHARE * self._method.tolerance and trial.overlap <= self._tolerance

    def _attempt(self, q: Array, free: Array | None, note: str) -> _Trial:
        """Reach, leave overlap, reach again: until both hold, or neither gains."""
        best: _Trial | None = None
        for turn in range(ROUNDS):
            before = q
            q, reached = self._reach.run(q, SHARE * self._method.tolerance, self._method.iterations)
            self.sweeps += reached.sweeps
            left = self._resolver.query(q)
            trial = _Trial(q, self._resolver.deepest, reached.error, reached.rested)
            if left:
                q, left = self._resolver.resolve(q, self._rng)
                trial = _Trial(q, self._resolver.deepest, self._error(q), reached.rested)
            if left and free is not None:
                back = last_free(self._problem.scene.model, free, q, self._resolver.query, HALVINGS)
                self._resolver.query(back)
                trial = _Trial(back, self._resolver.deepest, self._error(back), True)
            step = float(np.abs(pin.difference(self._problem.scene.model, before, q)).max(initial=0.0))
            self.trace.append(TraceEntry(trial.error, trial.overlap, 0.0, step, note if turn == 0 else "overlap"))
            self._control.tell(self.trace[-1])
            gained = best is None or trial.better(best, self._tolerance)
            if gained:
                best = trial
            if self._serves(trial) or not gained or self._control.over:
                break
        assert best is not None
        return best

    def _error(self, q: Array) -> float:
        """Largest error of the goals at a posture q (nq,)."""
        return self._reach.run(q, inf, 0)[1].error
