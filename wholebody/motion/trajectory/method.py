"""The method "trajectory": all frames around what collides at once, by sequential quadratic programming."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, Mask
from wholebody.base.checks import listed
from wholebody.base.records import with_values
from wholebody.figures.state import State
from wholebody.motion.avoider import MethodResult, Progress, Watch, check_input
from wholebody.motion.clip import Clip
from wholebody.motion.faults import faults
from wholebody.motion.frame_terms import FrameTerms, Given, between, frame_terms, said
from wholebody.motion.soles import standing_feet, usual_feet
from wholebody.motion.strength import Strength
from wholebody.motion.trajectory.banded_qp import Answer, BandedQP, banded_solver
from wholebody.motion.trajectory.loads import ClipLoads
from wholebody.motion.trajectory.retiming import Timing, allowance, slowed, speed_bounds, timing
from wholebody.motion.trajectory.window_run import ClipRun, WindowResult, WindowSettings
from wholebody.motion.windows import Window, windows
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace

RELOADED = 3  # programs of a timing: in each the ground's forces are split as the one before makes them
CORRECTIONS = 6  # of the loads of rows; more = fewer loads beyond their bounds, longer where they cannot keep to them
CORRECTING = (0.2, 0.1)  # s: smoothness of their answers, the next where one gets no farther; smoother = nearer to the
# rows, as filters change less of it
WORTH = 0.9  # of what loads are beyond their bounds: a correction that leaves more gets no farther
MEASURED = 1.5e-3  # m: as far a load may be beyond its bound, see `loads.LENGTH`; `avoid` allows 2e-3
LOOKED = 0.1  # share of the progress that looking for collisions counts for


@dataclass(frozen=True)
class Trajectory:
    """All frames at once: the least deviation from the original, and the least acceleration of that deviation.

    Frames are changed in windows around what collides; all others stay as they are, bit by bit.

    Attributes:
        clearance: least distance of every pair, metres.
        time: seconds: how far a push at one frame spreads to its neighbours; larger = smoother, farther off. None is
            0.1 s at first. Where an answer has over 1.2 of the jerk of the original, 0.15 s follow, else 0.04 s if that
            brings it nearer with no more jerk than this. With `dynamics` it stays 0.1 s.
        margin: seconds before and after a collision in which frames may be changed.
        solver: of the quadratic programs: "banded", which is the package's own and the fastest, "piqp", "osqp", or None
            for "banded".
        iterations: most steps of one run of a window; a step takes one to three quadratic programs.
        stretch: factor by which the clip may be slowed, at most and anywhere, so that joints keep to their speed
            limits. The postures stay on their path, and the clip gets more frames of the same time step. 1 keeps the
            timing; joints that the clip moves faster than their limits then stay as fast.
        dynamics: strength of the person, to keep torques within it and the zero moment point within the support, or no
            farther beyond than they are in the original clip; None for any torques.

    Raises:
        InputError: a value out of range.
        UnknownNameError: there is no such solver.
        MissingPackageError: the solver is not installed.
    """

    clearance: float = 0.0
    time: float | None = None
    margin: float = 0.5
    solver: str | None = None
    iterations: int = 40
    stretch: float = 1.0
    dynamics: Strength | None = None

    def __post_init__(self) -> None:
        """Check the settings."""
        checks.settle(self, "clearance", checks.number(self.clearance, "Trajectory: clearance", 0.0, 0.5, "m"))
        if self.time is not None:
            checks.settle(self, "time", checks.number(self.time, "Trajectory: time", 0.0, 100.0, "s"))
        checks.settle(self, "margin", checks.number(self.margin, "Trajectory: margin", 0.0, 100.0, "s"))
        checks.settle(self, "iterations", checks.whole(self.iterations, "Trajectory: iterations", 1, 10_000))
        checks.settle(self, "stretch", checks.number(self.stretch, "Trajectory: stretch", 1.0, 100.0))
        if self.dynamics is not None:
            checks.instance(self.dynamics, Strength, "Trajectory: dynamics", "give wb.motion.Strength(percentile=50)")
        banded_solver(self.solver)

    @property
    def name(self) -> str:
        """Name for tables."""
        return "trajectory" if self.solver is None else f"trajectory/{self.solver}"

    def avoid(self, clip: Clip, scene: Scene, constraints: Iterable[Given], progress: Progress | None) -> MethodResult:
        """Free a clip; see `wholebody.motion.avoider.Avoider`."""
        check_input(clip, scene, progress)
        constraints = tuple(listed(constraints, "avoid: constraints", "[wb.Freeze('root')]"))
        terms, watch = frame_terms(scene, clip.q, clip.dt, constraints, self.clearance), Watch(progress)
        _, solve = banded_solver(self.solver)
        settings = WindowSettings(self.clearance, self.time, self.iterations)
        with scene.borrow() as workspace:
            loads = None
            if self.dynamics is not None:
                stands = standing_feet(clip, usual_feet(scene.figure, constraints))
                loads = ClipLoads.original(
                    Clip(scene.figure, clip.q, clip.dt), stands, self.dynamics, terms, self.stretch
                )
            run = ClipRun(settings, terms, workspace, solve, clip.q, self.stretch, loads)
            q, missed = self._freed(run, terms, workspace, clip.q, watch)
            new = None if watch.ended else self._timing(q, terms, workspace.state, solve, loads)
            if new is None:

                def again_with(loads: ClipLoads, time: float) -> ClipRun:
                    smoother = with_values(settings, time=time)
                    return ClipRun(smoother, terms, workspace, solve, clip.q, self.stretch, loads)

                q, used = self._measured(again_with, terms, workspace, clip.q, q, loads, watch)
                return MethodResult(q, run.posture_solves, run.programs + used, _said(watch, terms, missed))
            # On the same path nothing is new but chords, which cut its corners; what they touch is freed from there.
            slower = terms.at(new.times)
            passed = between(scene.model, q, new.times / clip.dt)
            loads = None if loads is None else loads.of(passed, new.times)
            again = ClipRun(settings, slower, workspace, solve, passed, 1.0, loads)
            beyond = None if loads is None else loads.beyond()
            q, left = self._freed(again, slower, workspace, passed, watch, beyond)

            def slower_with(loads: ClipLoads, time: float) -> ClipRun:
                smoother = with_values(settings, time=time)
                return ClipRun(smoother, slower, workspace, solve, passed, 1.0, loads)

            q, used = self._measured(slower_with, slower, workspace, passed, q, loads, watch)
        return MethodResult(
            q, run.posture_solves + again.posture_solves, run.programs + again.programs + used,
            _said(watch, terms, [*missed, *left, slower.left_out]), times=new.times, stretch=new.largest,
        )  # fmt: skip

    def _measured(
        self, run_with: Callable[[ClipLoads, float], ClipRun], terms: FrameTerms, workspace: Workspace,
        reference: Array, q: Array, loads: ClipLoads | None, watch: Watch,
    ) -> tuple[Array, int]:  # fmt: skip
        """Postures whose loads keep to their bounds as `torques` measures them, as far as a few corrections get.

        Rows are corrected by what the measurement of the present postures is more than theirs, and the frames around
        what is beyond its bounds are computed again.

        Args:
            run_with: makes a run with loads and a smoothness, seconds.
            terms: of the reference.
            workspace: of this run alone.
            reference: (n, nq) postures that deviations are from.
            q: (n, nq) free postures.
            loads: of the reference; None where they are not looked at.
            watch: is told of every window.

        Returns:
            (n, nq) the best postures that were found, and how many quadratic programs were solved.
        """
        if loads is None:
            return q, 0
        depths, _, gaps = faults(workspace, terms, reference, self.clearance)
        corrected = loads.corrected(q)
        worst, programs, times = corrected.of(q).worst(), 0, list(CORRECTING)
        margin = max(3, round(self.margin / terms.dt))
        for _ in range(CORRECTIONS):
            beyond = worst > MEASURED
            if not beyond.any() or not times or watch.ended:
                break
            run = run_with(corrected, times[0])
            changed: Mask = beyond | (q != reference).any(axis=1)
            other = np.array(q)
            for window in windows(changed, margin):
                if beyond[window.first : window.end].any():
                    told = self._teller(watch, 1.0, 0.0, f"loads of frames {window.first} to {window.end - 1}")
                    freed = run.window(window, depths, gaps, told, q[window.first : window.end])
                    other[window.first : window.end] = freed.q
            programs += run.programs
            _, wrong, dipping = faults(workspace, terms, other, self.clearance)
            again = loads.corrected(other)
            now = again.of(other).worst()
            if wrong.any() or dipping or now.max() > WORTH * worst.max():
                times.pop(0)
            else:
                q, corrected, worst = other, again, now
        return q, programs

    def _freed(
        self, run: ClipRun, terms: FrameTerms, workspace: Workspace, reference: Array, watch: Watch,
        beyond: Mask | None = None,
    ) -> tuple[Array, list[str]]:  # fmt: skip
        """Postures (n, nq) that are free, as near as can be to reference postures (n, nq), and what is missed.

        Frames (n,) that are beyond something else are changed too.
        """
        q: Array = np.array(reference)
        watch.tell(0.0, "looking for collisions")
        depths, wrong, gaps = faults(workspace, terms, reference, self.clearance)
        wrong[[frame + end for frame in gaps for end in (0, 1)]] = True
        if beyond is not None:
            wrong |= beyond
        found = windows(wrong, max(3, round(self.margin / terms.dt)))
        total, done = max(1, sum(map(len, found))), 0
        missed: dict[Window, str] = {}
        while found:
            window = found.pop(0)
            begun, note = done, f"frames {window.first} to {window.end - 1}"
            cancelled = self._teller(watch, begun / total, len(window) / total, note)
            freed = run.window(window, depths, gaps, cancelled)
            q[window.first : window.end] = freed.q
            if freed.missed and not watch.ended:
                window, freed = self._kept_back(run, window, freed, q, depths, gaps, cancelled)
                q[window.first : window.end] = freed.q
                found = [other for other in found if not window.first <= other.first < window.end]
                missed = {other: said for other, said in missed.items() if not window.first <= other.first < window.end}
            if watch.ended:
                break
            if freed.missed:
                missed[window] = f"frames {window.first} to {window.end - 1}: {freed.missed}"
            done += len(window)
        return q, list(missed.values())

    def _kept_back(
        self, run: ClipRun, window: Window, freed: WindowResult, q: Array, depths: Array, gaps: list[int],
        cancelled: Callable[[float], bool],
    ) -> tuple[Window, WindowResult]:  # fmt: skip
        """A window that was not freed once more, on one side of what it passes for good.

        A limb that passes through a thin thing and comes back much later, or never, has to stay where it is until then.
        So the window is made as long as that, whatever windows lie in it.

        Args:
            run: of the clip.
            window: that was not freed.
            freed: what was found for it.
            q: (n, nq) postures of the clip, with these.
            depths: as for `ClipRun.window`.
            gaps: as for `ClipRun.window`.
            cancelled: told the share done.
        """
        margin = max(3, round(self.margin / run.dt))
        for kept, changed in run.kept_back(window, q):
            changed[window.first : window.end] = True
            wider = next(one for one in windows(changed, margin) if one.first <= window.first < one.end)
            again = run.window(wider, depths, gaps, cancelled, kept[wider.first : wider.end])
            if not again.missed:
                return wider, again
        return window, freed

    def _timing(
        self, q: Array, terms: FrameTerms, state: State, solve: Callable[[BandedQP], Answer], loads: ClipLoads | None
    ) -> Timing | None:
        """The new timing of postures (n, nq); None where it stays."""
        stretch = allowance(len(q), self.stretch)
        if stretch <= 1.0 or len(q) < 2:
            return None
        model, gaps = terms.scene.model, range(len(q) - 1)
        steps = np.array([pin.difference(model, q[gap], q[gap + 1]) for gap in gaps])
        bounds = [terms.step_bounds(gap, state) for gap in gaps]
        most = speed_bounds(steps, np.array([one[0] for one in bounds]), np.array([one[1] for one in bounds]))
        b = slowed(most, terms.dt, stretch, solve)
        if loads is not None:
            path = loads.of(q)
            for _ in range(RELOADED):
                b = slowed(most, terms.dt, stretch, solve, path.timed(b))
        return timing(b, terms.dt)

    def _teller(self, watch: Watch, begun: float, share: float, note: str) -> Callable[[float], bool]:
        return lambda part: watch.tell(LOOKED + (1.0 - LOOKED) * (begun + share * part), note)


def _said(watch: Watch, terms: FrameTerms, missed: list[str]) -> str:
    return "the caller ended it" if watch.ended else said(terms, *missed)
