"""One window of a clip from the original postures to free ones, looked at between frames too."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import Enum
from itertools import chain
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.motion.clip import Clip
from wholebody.motion.dips import FEW, depths_between, dipping, dips, sampled_dips
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.measures import jerk_ratio
from wholebody.motion.one_side import PASSED
from wholebody.motion.trajectory.banded_qp import Answer, BandedQP
from wholebody.motion.trajectory.chart import Chart
from wholebody.motion.trajectory.loads import ClipLoads, WindowLoads
from wholebody.motion.trajectory.nodes import NEAREST, Node, NodeEvaluator
from wholebody.motion.trajectory.objective import Objective
from wholebody.motion.trajectory.program import ONE_STEP, Limits
from wholebody.motion.trajectory.sqp import LARGEST, MET, RADIUS, SQPResult, WindowProgram
from wholebody.motion.trajectory.starts import Carried
from wholebody.motion.windows import Window
from wholebody.scene.workspace import Workspace

ROUNDS = 12  # of sweeping and adding places between frames
SIDES = (0.0, -0.005, 0.005)  # shares of a gap beside its deepest place that become nodes with it
NEARLY = 0.03  # rad, m: first trust region of the rounds after the first; few rows are near enough to count then
SHORTER = 0.3  # of the largest step: after the second round, each round takes shorter ones
SHORTEST = 5e-4  # rad, m: but none is asked for shorter ones than these; larger = more that dips elsewhere
GROWN = 2.0  # of the objective: what grows by more in a later round is on the wrong side of what it passes
BRIEF = 40  # frames: shorter windows are looked at between frames at their optimum only; fewer = more wrong sides
NOTHING = 1e-9  # rad, m: a deviation no larger is none
TIME = 0.1  # s: smoothness of the first answer; where it is shorter, more attempts end on a wrong side
ROUGHER, SMOOTHER = 0.4, 1.5  # of that time, in the second answer
JERK = 1.2  # of the original's: an answer with more is made smoother
SMOOTH_SHARE = 0.03  # of the squared deviation: acceleration that costs less leaves little to gain
WORTH = 0.05  # of the objective: less smoothness whose first step brings less is not gone on with
REACH = 3  # frames on each side of a window whose jerk it changes


class WindowSettings(NamedTuple):
    """What windows need of the method's settings.

    Attributes:
        clearance: least distance of every pair, metres.
        time: seconds that a push spreads over; None for what the jerk of the answer asks for.
        iterations: most steps of one run.
    """

    clearance: float
    time: float | None
    iterations: int


class WindowResult(NamedTuple):
    """Postures of a window.

    Attributes:
        q: (n, nq) postures.
        missed: what did not succeed; empty where all did.
    """

    q: Array
    missed: str


class _Way(Enum):
    """How an attempt goes: from what is free but for dips, from an answer, to its end, or with others left to try."""

    CAREFUL = "careful"
    SECOND = "second"
    USUAL = "usual"
    EARLY_EXIT = "early exit"


class _Attempt(NamedTuple):
    """Deviations that one attempt ended with, the places between frames that it had, and whether it ended early."""

    x: Array
    worst: float
    dipping: int
    objective: float
    early: bool = False
    between: tuple[Node, ...] = ()

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """The best attempt has the least."""
        return self.worst > MET, self.dipping > 0, self.objective if self.worst <= MET else self.worst


def _begun(x: Array, between: tuple[Node, ...] = ()) -> _Attempt:
    """An attempt that has not begun, at deviations (n, nv), with places between frames."""
    return _Attempt(x, np.inf, 0, np.inf, between=between)


class ClipRun:
    """Frees windows of one clip.

    Attributes:
        programs: how many quadratic programs were solved.
    """

    def __init__(
        self, settings: WindowSettings, terms: FrameTerms, workspace: Workspace, solve: Callable[[BandedQP], Answer],
        reference: Array, rate: float = 1.0, loads: ClipLoads | None = None,
    ) -> None:  # fmt: skip
        """Take what is needed.

        Args:
            settings: of the method.
            terms: original postures, and what is held.
            workspace: of this run alone.
            solve: solves one program.
            reference: (n, nq) postures that the deviations are from.
            rate: factor of the speed limits, for a clip that will be slowed by as much.
            loads: of the reference postures, if they are to keep to their bounds.
        """
        self._settings, self._terms, self._workspace, self._solve = settings, terms, workspace, solve
        self._reference, self._rate, self._loads = reference, rate, loads
        self._carried = Carried(terms, settings.clearance)
        self._programs = 0
        self._weights = np.ones(workspace.model.nv)

    @property
    def programs(self) -> int:
        """How many quadratic programs were solved."""
        return self._programs + self._carried.programs

    @property
    def posture_solves(self) -> int:
        """How many postures were solved for on their own."""
        return self._carried.posture_solves

    @property
    def dt(self) -> float:
        """Seconds from frame to frame."""
        return self._terms.dt

    def kept_back(self, window: Window, q: Array) -> Iterable[tuple[Array, Mask]]:
        """Postures of the clip that stay on one side of what motions of a window pass, for as long as it takes.

        Args:
            window: which frames.
            q: (n, nq) postures of the clip.

        Returns:
            (n, nq) postures, and which of them (n,) are kept back: of the reference, and of q; none where that is not
            found.
        """
        for begun in (self._reference, q):
            gaps = dipping(self._workspace, begun, range(window.first, window.end - 1))
            kept = self._carried.beside(Window(0, len(q)), begun, gaps, self._workspace)
            changed: Mask = (kept != begun).any(axis=1)
            if changed.any():
                yield kept, changed

    def window(
        self, window: Window, depths: Array, gaps: Iterable[int], cancel: Callable[[float], bool],
        begun: Array | None = None,
    ) -> WindowResult:  # fmt: skip
        """Free one window.

        Args:
            window: which frames.
            depths: (frames of the clip,) how deep each original posture is.
            gaps: frames of the clip whose original motion to the next one dips.
            cancel: told the share done; true ends the attempt, and the window stays as it was.
            begun: (frames of the window, nq) postures to begin with; None for the original ones, and others after them.
        """
        terms = self._terms
        chart = Chart(self._workspace.model, np.array(self._reference[window.first : window.end]))
        seams = window.first > 0, window.end < len(terms.q)
        time = TIME if self._settings.time is None else self._settings.time
        objective = Objective(len(window), self._weights, time, terms.dt, seams)
        limits = self._limits(window, chart, seams)
        held = [terms.held(frame) for frame in range(window.first, window.end)]
        loads = None if self._loads is None else WindowLoads(self._loads, window.first, len(window))
        evaluator = NodeEvaluator(self._workspace, chart, held, self._settings.clearance, loads)
        always = {gap - window.first for gap in gaps}
        best: _Attempt | None = None
        ended_early: list[_Attempt] = []
        if begun is None:
            starts = ((_begun(x), _Way.EARLY_EXIT) for x in self._starts(window, chart, limits, depths, always))
        else:
            starts = ((_begun(x), _Way.CAREFUL) for x in [_deviations(chart, begun, limits)])
        for start, way in chain(starts, ((start, _Way.USUAL) for start in ended_early)):
            attempt = self._attempt(start, chart, evaluator, objective, limits, always, cancel, way)
            if attempt is None:
                return WindowResult(chart.original, "")
            if attempt.early:
                ended_early.append(attempt)
                continue
            best = attempt if best is None or attempt.rank < best.rank else best
            if best.worst <= MET and not best.dipping:
                break
        assert best is not None
        missed = ""
        if best.worst > MET or best.dipping:
            dipping = f", and {best.dipping} motions between frames dip" if best.dipping else ""
            missed = f"{1e3 * best.worst:.3g} mm or mrad are missed{dipping}"
        elif self._settings.time is None and self._loads is None:  # torques come of accelerations: these stay least
            best = self._again(best, window, chart, evaluator, limits, always, cancel)
        changed = np.abs(best.x).max(axis=1) > NOTHING
        q = chart.original.copy()
        q[changed] = chart.postures(best.x)[changed]
        return WindowResult(q, missed)

    def _again(
        self, found: _Attempt, window: Window, chart: Chart, evaluator: NodeEvaluator, limits: Limits, always: set[int],
        cancel: Callable[[float], bool],
    ) -> _Attempt:  # fmt: skip
        """An answer once more, as smooth as its jerk asks for.

        With more jerk than `JERK` it is made smoother. With less it is made less smooth and so nearer to the original,
        where smoothness costs deviation. Either is kept where its jerk is no more than `JERK`. So jerk is a bound, and
        the deviation what is minimised.
        """
        jerk, square = self._jerk(window, chart, found.x), 0.5 * float((found.x**2).sum())
        rough = jerk > JERK
        if not rough and found.objective < (1.0 + SMOOTH_SHARE) * square:
            return found
        time = TIME * (SMOOTHER if rough else ROUGHER)
        seams = window.first > 0, window.end < len(self._reference)
        objective = Objective(len(window), self._weights, time, self.dt, seams)
        begun = found
        if not rough:
            first = self._step(found, evaluator, objective, limits)
            little = first.objective > (1.0 - WORTH) * objective.value(found.x)
            if little or self._jerk(window, chart, first.x) > JERK:
                return found
            begun = _begun(first.x, found.between)
        other = self._attempt(begun, chart, evaluator, objective, limits, always, cancel, _Way.SECOND)
        if other is None or other.worst > MET or other.dipping:
            return found
        now = self._jerk(window, chart, other.x)
        better = now <= JERK and (rough or (other.x**2).sum() < 2.0 * square)
        return other if better else found

    def _step(self, begun: _Attempt, evaluator: NodeEvaluator, objective: Objective, limits: Limits) -> SQPResult:
        """One step from an answer."""
        program = WindowProgram(evaluator, objective, limits, self._solve, 1)
        program.add(begun.between)
        found = program.run(begun.x, lambda number, worst: False, NEARLY, NEARLY)
        self._programs += found.programs
        return found

    def _jerk(self, window: Window, chart: Chart, x: Array) -> float:
        """Of the frames that deviations (n, nv) of a window change the jerk of, in parts of the original's."""
        first, end = max(0, window.first - REACH), min(len(self._reference), window.end + REACH)
        before, after = self._reference[first:end], self._reference[first:end].copy()
        after[window.first - first : window.end - first] = chart.postures(x)
        figure = self._terms.scene.figure
        return jerk_ratio(Clip(figure, before, self.dt), Clip(figure, after, self.dt))

    def _starts(self, window: Window, chart: Chart, limits: Limits, depths: Array, always: set[int]) -> Iterable[Array]:
        """Deviations (n, nv) to begin with.

        None; frames kept on one side of what motions between them pass; what following gives, from the deepest frame
        and both ends, the least first. Attempts that end early are gone on with after all others.
        """
        none = np.zeros((len(window), self._workspace.model.nv))
        yield none
        if not (limits.lower < limits.upper).any():
            return  # nothing can move
        if always:
            q = self._carried.beside(window, chart.original, always, self._workspace)
            x = _deviations(chart, q, limits)
            if x.any():
                yield x
        deepest = window.first + int(np.argmax(depths[window.first : window.end]))
        for q in self._carried.outwards(window, (deepest, window.first, window.end - 1)):
            yield _deviations(chart, q, limits)

    def _attempt(
        self, begun: _Attempt, chart: Chart, evaluator: NodeEvaluator, objective: Objective, limits: Limits,
        always: set[int], cancel: Callable[[float], bool], way: _Way,
    ) -> _Attempt | None:  # fmt: skip
        program = WindowProgram(evaluator, objective, limits, self._solve, self._settings.iterations)
        program.add(begun.between)
        x = begun.x
        found, radius = None, NEARLY if way in (_Way.CAREFUL, _Way.SECOND) else RADIUS
        largest = NEARLY if way is _Way.CAREFUL else LARGEST
        most, dipped = self._settings.iterations, set[int]()

        def told(count: int, worst: float) -> bool:
            return cancel(count / most)

        for number in range(ROUNDS):
            dear = GROWN * found.objective if found is not None and found.programs else np.inf
            # from the third round on it is nearly free: what is missed then is seldom on the wrong side
            ends = dear if way is _Way.EARLY_EXIT and number < 2 else None
            # what passes a thing between two frames is on the wrong side: seen where little is missed in frames, long
            # before the optimum
            rough = way is _Way.EARLY_EXIT and not number and len(x) > BRIEF
            found = program.run(x, told, radius, largest, ends, rough)
            self._programs += found.programs
            if found.roughly:
                passed = self._passed(chart, found.x, always)
                if passed > ONE_STEP:  # rows there would push it on
                    return _Attempt(found.x, found.worst, 0, found.objective, True, program.between)
                if passed <= PASSED:
                    found = program.run(found.x, told, radius, largest, ends)
                    self._programs += found.programs
            radius = NEARLY
            if number:  # what is free already is to stay where it is, or it dips elsewhere
                largest = max(SHORTER * min(largest, NEARLY), SHORTEST)
                radius = largest
            if found.cancelled:
                return None
            x = found.x
            if found.early:
                return _Attempt(x, found.worst, 0, found.objective, True, program.between)
            q, gaps = chart.postures(x), _moved(x, always)
            swept = dips(self._workspace, q, gaps)
            near = [(gap, share + side) for gap, shares in swept.items() for share in shares for side in SIDES]
            near += [(gap, share) for gap in swept if gap in dipped for share in FEW]  # what dips again, everywhere
            dipped |= swept.keys()
            met = found.met or found.roughly
            if near and met:
                near += sampled_dips(self._workspace, q, gaps)
            if not near or not met:
                left = len({gap for gap, _ in near})
                return _Attempt(x, found.worst, left, found.objective, between=program.between)
            before = len(program.nodes)
            program.add([Node(gap, float(np.clip(share, NEAREST, 1.0 - NEAREST))) for gap, share in near])
            if len(program.nodes) == before:
                break
        assert found is not None
        return _Attempt(x, found.worst, len({gap for gap, _ in near}), found.objective)

    def _passed(self, chart: Chart, x: Array, always: set[int]) -> float:
        """How deep motions between frames with deviations (n, nv) pass through something, metres."""
        return max(depths_between(self._workspace, chart.postures(x), _moved(x, always)).values(), default=0.0)

    def _limits(self, window: Window, chart: Chart, seams: tuple[bool, bool]) -> Limits:
        """Bounds on deviations and on their changes; at a seam nothing moves."""
        count, nv = len(chart), chart.model.nv
        lower, upper = chart.bounds(self._terms.scene.figure.limits)
        steps, slowest, fastest = chart.steps, np.zeros((count - 1, nv)), np.zeros((count - 1, nv))
        for frame in range(count):
            low, high = self._terms.bounds(window.first + frame, self._workspace.state)[:2]
            away = pin.difference(chart.model, self._terms.q[window.first + frame], chart.original[frame])
            lower[frame], upper[frame] = np.maximum(lower[frame], low - away), np.minimum(upper[frame], high - away)
            if frame < count - 1:
                limits_here = self._terms.step_bounds(window.first + frame, self._workspace.state)
                slowest[frame], fastest[frame] = (self._rate * bound for bound in limits_here)
        for seam, frame in zip(seams, (0, -1), strict=True):
            if seam:
                lower[frame], upper[frame] = 0.0, 0.0
        # where the original is faster than a limit, it may stay as fast
        return Limits(lower, upper, np.minimum(slowest, steps) - steps, np.maximum(fastest, steps) - steps)


def _moved(x: Array, always: set[int]) -> list[int]:
    """Gaps beside frames with a deviation (n, nv), and those that are looked at always."""
    return [gap for gap in range(len(x) - 1) if gap in always or x[gap : gap + 2].any()]


def _deviations(chart: Chart, q: Array, limits: Limits) -> Array:
    """(n, nv) deviations of postures (n, nq), within limits."""
    x = np.array([chart.deviation(frame, posture) for frame, posture in enumerate(q)])
    found: Array = np.clip(x, limits.lower, limits.upper)
    return found
