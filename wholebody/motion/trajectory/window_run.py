"""One window of a clip from the original postures to free ones, looked at between frames too.

An attempt solves the window's program, sweeps the motions between frames, adds rows at the places where they dip, and
goes on from its answer until nothing dips. Attempts begin at the original postures, then on one side of what these
pass. One whose shortfall stays, or that passes through a thing, is on the wrong side: others are tried before it goes
on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import chain
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import millimetres
from wholebody.geometry.continuous.swept_depth import Depths
from wholebody.motion.avoider import Run, followed
from wholebody.motion.clip import Clip
from wholebody.motion.faults import Faults, deepest_shares, dipping
from wholebody.motion.measures import jerk_ratio
from wholebody.motion.trajectory.deviations import Chart, Objective
from wholebody.motion.trajectory.loads import ClipLoads, WindowLoads
from wholebody.motion.trajectory.nodes import MET, NEAREST, Node, NodeEvaluator
from wholebody.motion.trajectory.program import ONE_STEP, Limits
from wholebody.motion.trajectory.sqp import FAR, End, WindowProgram
from wholebody.motion.windows import Window

NEARLY = 0.03  # rad, m: first trust region of the rounds after the first; few rows are near enough to count then


FIRST = 0.1  # s: smoothness of the first answer; where it is shorter, more attempts end on a wrong side
JERK = 1.2  # parts of the original's; an answer with more is made smoother
ITERATIONS = 40  # most steps of one run; a step takes one to three programs


class WindowResult(NamedTuple):
    """Postures (n, nq) of a window; what did not succeed, empty where all did; whether rows are missed by little."""

    q: Array
    missed: str
    little: bool = True


class _Way(NamedTuple):
    """How an attempt goes: trust regions other than those of the settings, and whether it ends as others are left."""

    radius: float | None = None
    largest: float | None = None
    early: bool = False


class _Attempt(NamedTuple):
    """Deviations that one attempt ended with, the places between frames that it had, and whether it ended early."""

    x: Array
    worst: float = np.inf
    dipping: int = 0
    objective: float = np.inf
    early: bool = False
    between: tuple[Node, ...] = ()

    @property
    def free(self) -> bool:
        """Whether all is met, and nothing dips."""
        return self.worst <= MET and not self.dipping

    @property
    def rank(self) -> tuple[float, bool, float]:
        """The best attempt has the least."""
        return max(self.worst, MET), self.dipping > 0, self.objective


class _Window(NamedTuple):
    """One window: its frames, their rows and limits, gaps that are looked at always, and the caller's interest."""

    window: Window
    chart: Chart
    evaluator: NodeEvaluator
    limits: Limits
    always: set[int]
    cancel: Callable[[float], bool]
    around: Array  # (clip's frames, nq): what lies beyond the window stays so
    seams: tuple[bool, bool]  # whether the clip goes on before and after it

    def moved(self, x: Array) -> list[int]:
        """Gaps beside frames with a deviation (n, nv), and those that are looked at always."""
        return [gap for gap in range(len(x) - 1) if gap in self.always or x[gap : gap + 2].any()]

    def deviations(self, q: Array) -> Array:
        """(n, nv) deviations of postures (n, nq), within limits."""
        x = np.array([self.chart.deviation(frame, posture) for frame, posture in enumerate(q)])
        return np.asarray(np.clip(x, self.limits.lower, self.limits.upper))


class ClipRun:
    """Frees windows of one clip."""

    def __init__(
        self, run: Run, reference: Array, time: float | None, rate: float | None = 1.0,
        loads: ClipLoads | None = None, near: float = NEARLY,
    ) -> None:  # fmt: skip
        """Take postures (n, nq), the spread of a push [s] or None, the `rate` of speeds, a trust region `near`."""
        self._run, self._reference = run, reference
        self._time, self._rate, self._loads, self._near = time, rate, loads, near

    def window(
        self, window: Window, found: Faults, cancel: Callable[[float], bool], begun: Array | None = None,
        around: Array | None = None, whole: bool = True, patient: bool = True,
    ) -> WindowResult:  # fmt: skip
        """Free one window, from `begun` (n, nq), among postures `around` beyond it; a `cancel` leaves it as it was."""
        # with `whole` false the last frame of a part is free; what ended early goes on only if `patient`
        around = begun if around is None else around
        own = self._of(window, found, cancel, around, (window.first > 0, whole and window.end < len(self._reference)))
        objective = self._objective(own, FIRST if self._time is None else self._time)
        starts: Iterable[tuple[_Attempt, _Way]]
        if begun is None:
            begins = self._starts(own, found.depths)
            if not patient and not self._goes_on(own):  # on its side of things all parts after it are too
                begins = _nearest_first(begins, objective)
            starts = ((_Attempt(x), _Way(early=True)) for x in begins)
        else:
            x = own.deviations(begun[window.first : window.end])
            between = tuple(self._places(own, x, self._dipping(own, x)))
            starts = [(_Attempt(x, between=between), _Way(self._near, self._near))]
        best: _Attempt | None = None
        ended_early: list[_Attempt] = []
        for start, way in chain(starts, ((start, _Way()) for start in _promising(ended_early))):
            attempt = self._attempt(start, own, objective, way)
            if attempt is None:
                return WindowResult(own.chart.original, "")
            if attempt.early and patient:
                ended_early.append(attempt)
                if attempt.worst > MET:
                    continue
            best = attempt if best is None or attempt.rank < best.rank else best
            if best.free:
                break
        assert best is not None
        missed = ""
        if not best.free:
            dip = f", and {best.dipping} motions between frames dip" if best.dipping else ""
            missed = f"{millimetres(best.worst)} or mrad are missed{dip}"
        elif self._time is None and self._loads is None:  # torques come of accelerations: these stay least
            best = self._again(best, own)
        changed = np.abs(best.x).max(axis=1) > 1e-9  # rad, m
        q = own.chart.original.copy()
        q[changed] = own.chart.postures(best.x)[changed]
        return WindowResult(q, missed, best.worst <= FAR)

    def _of(
        self, window: Window, found: Faults, cancel: Callable[[float], bool], begun: Array | None,
        seams: tuple[bool, bool],
    ) -> _Window:  # fmt: skip
        terms, around = self._run.terms, self._reference if begun is None else begun
        chart = Chart(self._run.workspace.model, np.array(self._reference[window.first : window.end]))
        ends = (window.first, window.end - 1)
        kept = None if begun is None else np.array([self._away(begun, frame) for frame in ends])
        limits = Limits.of(terms, chart, window.first, seams, self._rate, kept)
        held = [terms.held(frame) for frame in range(window.first, window.end)]
        loads = None if self._loads is None else WindowLoads(self._loads, window.first, len(window))
        evaluator = NodeEvaluator(self._run.workspace, chart, held, self._run.clearance, loads)
        gaps = {gap - window.first for gap in found.gaps}
        return _Window(window, chart, evaluator, limits, gaps, cancel, around, seams)

    def _away(self, q: Array, frame: int) -> Array:
        """(nv,) deviation of a frame of postures (n, nq); none beyond the clip."""
        model = self._run.workspace.model
        if not 0 <= frame < len(q):
            return np.zeros(model.nv)
        return np.asarray(pin.difference(model, self._reference[frame], q[frame]))

    def _objective(self, own: _Window, time: float) -> Objective:
        window, weights = own.window, np.ones(self._run.workspace.model.nv)
        beyond = (window.first - 2, window.first - 1, window.end, window.end + 1)
        ends = np.array([self._away(own.around, frame) for frame in beyond])
        return Objective(len(window), weights, time, self._run.terms.dt, own.seams, ends)

    def _again(self, found: _Attempt, own: _Window) -> _Attempt:
        """An answer once more, smoother where its jerk is not allowed, else less smooth and nearer to the original."""
        jerk, square = self._jerk(own, found.x), float((found.x**2).sum())
        rough = jerk > JERK
        # acceleration that costs less than a tenth of the squared deviation leaves little to gain
        if not rough and found.objective < 1.1 * 0.5 * square:
            return found
        objective = self._objective(own, FIRST * (1.5 if rough else 0.4))
        other = self._attempt(found, own, objective, _Way(NEARLY))
        if other is None or not other.free:
            return found
        better = self._jerk(own, other.x) <= JERK and (rough or (other.x**2).sum() < square)
        return other if better else found

    def _jerk(self, own: _Window, x: Array) -> float:
        """Of the frames that deviations (n, nv) of a window change the jerk of, in parts of the original's."""
        window, figure, dt = own.window, self._run.scene.figure, self._run.terms.dt
        first, end = max(0, window.first - 3), min(len(self._reference), window.end + 3 * own.seams[1])
        before, after = self._reference[first:end], own.around[first:end].copy()
        after[window.first - first : window.end - first] = own.chart.postures(x)
        return jerk_ratio(Clip(figure, before, dt), Clip(figure, after, dt))

    def _starts(self, own: _Window, depths: Array) -> Iterable[Array]:
        """Deviations (n, nv) to begin with: none; followed from the deepest frame and from both ends."""
        window, none = own.window, np.zeros((len(own.window), self._run.workspace.model.nv))
        movable, goes_on = bool((own.limits.lower < own.limits.upper).any()), self._goes_on(own)
        if movable and goes_on:  # others are seldom on the side of things that it is on
            yield own.deviations(followed(self._run, window, window.first, own.around[window.first]))
        yield none
        if not movable:
            return
        deepest = window.first + int(np.argmax(depths[window.first : window.end]))
        for middle in dict.fromkeys((deepest, window.first, window.end - 1)):
            if not (goes_on and middle == window.first):
                yield own.deviations(followed(self._run, window, middle))

    def _goes_on(self, own: _Window) -> bool:
        """Whether a window goes on from a posture that another one moved far, so to a side of something."""
        away = own.chart.deviation(0, own.around[own.window.first])
        return own.seams[0] and bool(np.abs(away).max() > NEARLY)

    def _attempt(self, begun: _Attempt, own: _Window, objective: Objective, way: _Way) -> _Attempt | None:
        """What iterations from an attempt lead to; None where the caller ends them."""
        work = self._run.work
        program = WindowProgram(own.evaluator, objective, own.limits, ITERATIONS)
        program.add(begun.between)
        x, radius = begun.x, way.radius

        def report(count: int, worst: float) -> bool:
            return own.cancel(count / ITERATIONS)

        for number in range(12):  # of sweeping and adding places between frames
            # from the third round on it is nearly free, and what is missed then seldom is on the wrong side
            found = program.run(x, report, radius, way.largest, way.early and number < 2)
            work.programs += found.programs
            if found.end is End.CANCELLED:
                return None
            x, radius = found.x, NEARLY
            if found.end is End.EARLY:
                return _Attempt(x, found.worst, 0, found.objective, True, program.between)
            dips = self._dipping(own, x)
            deepest = max((float(pairs.depth[0]) for pairs in dips.values()), default=0.0)
            if way.early and deepest > ONE_STEP:  # other starts are beside what it passes
                return _Attempt(x, found.worst, len(dips), found.objective, True, program.between)
            if not found.met:
                break
            before = len(program.nodes)
            program.add(self._places(own, x, dips))
            if len(program.nodes) == before:
                break
        return _Attempt(x, found.worst, len(dips), found.objective, between=program.between)

    def _dipping(self, own: _Window, x: Array) -> dict[int, Depths]:
        """Gaps of deviations x (n, nv) whose motions dip, and their pairs."""
        return dipping(self._run.workspace, own.chart.postures(x), own.moved(x))

    def _places(self, own: _Window, x: Array, found: Mapping[int, Depths]) -> list[Node]:
        """Places in the gaps of deviations x (n, nv) that dip at which they are deepest, and beside these."""
        shares = deepest_shares(self._run.workspace, own.chart.postures(x), found)
        places = [(gap, at + side) for gap, each in shares.items() for at in each for side in (0.0, -0.005, 0.005)]
        return [Node(gap, float(np.clip(share, NEAREST, 1.0 - NEAREST))) for gap, share in places]


def _promising(ended: Iterable[_Attempt]) -> Iterator[_Attempt]:
    """Attempts that ended early and are gone on with: those with a shortfall, and the best that passes a thing."""
    ended = sorted(ended, key=lambda one: one.rank)
    for number, attempt in enumerate(ended):
        if not number or attempt.worst > MET:
            yield attempt


def _nearest_first(starts: Iterable[Array], objective: Objective) -> Iterator[Array]:
    """The first of deviations (n, nv) to begin with, then the others, by what is minimised."""
    others = iter(starts)
    yield next(others)
    yield from sorted(others, key=objective.value)
