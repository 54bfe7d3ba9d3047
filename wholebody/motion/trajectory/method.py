"""The method "trajectory": all frames around what collides at once, by sequential quadratic programming."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, Mask
from wholebody.base.fields import Checked, Range
from wholebody.figures.strength import Strength
from wholebody.motion.avoider import MethodResult, Run
from wholebody.motion.clip import Clip, between
from wholebody.motion.faults import Faults
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.stance import standing_feet
from wholebody.motion.trajectory.loads import ClipLoads
from wholebody.motion.trajectory.retiming import Timing, allowance, slowed, speed_bounds, timing
from wholebody.motion.trajectory.window_run import ClipRun, WindowResult
from wholebody.motion.windows import Window

LONG = 2.0  # s: a window over twice as long is freed in parts of this length
LOADED = 0.2  # s, smoothness with loads: a push that spreads farther accelerates less, and filters change less of it


@dataclass(frozen=True)
class Trajectory(Checked):
    """All frames at once: the least deviation from the original, and the least acceleration of that deviation.

    Frames are changed in windows around what collides; all others stay as they are, bit by bit.

    Attributes:
        clearance: least distance of every pair, metres.
        time: seconds: how far a push at one frame spreads to its neighbours; larger = smoother, farther off. None is
            0.1 s at first. Where an answer has over 1.2 of the jerk of the original, 0.15 s follow, else 0.04 s if that
            brings it nearer with no more jerk than this. With `dynamics` it is 0.2 s.
        margin: seconds before and after a collision in which frames may be changed.
        stretch: factor by which the clip may be slowed, at most and anywhere, so that joints keep to their speed
            limits. The postures stay on their path, and the clip gets more frames of the same time step. 1 keeps the
            timing; joints that the clip moves faster than their limits then stay as fast.
        dynamics: strength of the person, to keep torques within it and the zero moment point within the support, or no
            farther beyond than they are in the original clip; None for any torques.

    Raises:
        InputError: a value out of range.

    Examples:
        >>> wb.avoid(clip, scene, method=wb.motion.Trajectory(clearance=0.005)).report.solved
        True
    """

    name: ClassVar[str] = "trajectory"

    clearance: Annotated[float, Range(0.0, 0.5, "m")] = 0.0
    time: Annotated[float, Range(0.0, 100.0, "s")] | None = None
    margin: Annotated[float, Range(0.0, 100.0, "s")] = 0.5
    stretch: Annotated[float, Range(1.0, 100.0)] = 1.0
    dynamics: Strength | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.dynamics is not None:
            checks.instance(self.dynamics, Strength, "Trajectory: dynamics", "give wb.motion.Strength(percentile=50)")

    def avoid(self, run: Run) -> MethodResult:
        """Free a clip; see `wholebody.motion.avoider.Avoider`."""
        loads, q = None, run.terms.q
        if self.dynamics is not None:
            clip = Clip(run.scene.figure, q, run.terms.dt)
            loads = ClipLoads.original(clip, standing_feet(clip, run.feet), self.dynamics, run.terms, self.stretch)
        freed, missed = self._freed(run, run.terms.q, loads, self.stretch)
        new = None if run.ended else self._timing(freed, run.terms, loads)
        if new is None:
            q = self._measured(run, q, freed, loads, self.stretch)
            if missed and loads is None:
                return MethodResult(q, repair=True)
            return MethodResult(q, message="; ".join(missed))
        # On the same path nothing is new but chords, which cut its corners; what they touch is freed from there.
        slower = run.of(run.terms.at(new.times))
        passed = between(run.scene.model, freed, new.times / run.terms.dt)
        loads = None if loads is None else loads.of(passed, new.times)
        q, left = self._freed(slower, passed, loads, 1.0, None if loads is None else loads.beyond())
        q = self._measured(slower, passed, q, loads, 1.0)
        return MethodResult(q, message="; ".join((*missed, *left)), times=new.times, stretch=new.largest)

    def _measured(self, run: Run, reference: Array, q: Array, loads: ClipLoads | None, rate: float) -> Array:
        """The best postures (n, nq) whose loads keep to their bounds as `torques` measures them, from free ones q."""
        # Rows are corrected by the measured excess, and frames around violations are recomputed.
        if loads is None:
            return q
        faults, corrected = run.faults(reference), loads.corrected(q)
        worst = corrected.of(q).worst()
        for _ in range(6):  # more leave fewer loads beyond their bounds, and take longer where these cannot be kept
            beyond = worst > 1.5e-3  # m, see `loads.LENGTH`; the judge allows 2e-3
            if not beyond.any() or run.ended:
                break
            windows = ClipRun(run, reference, LOADED, rate, corrected)
            changed: Mask = beyond | (q != reference).any(axis=1)
            other = np.array(q)
            for window in run.windows(changed, self.margin):
                if beyond[window.first : window.end].any():
                    report = run.watch.teller(1.0, 0.0, f"loads of frames {window.first} to {window.end - 1}")
                    freed = windows.window(window, faults, report, q)
                    other[window.first : window.end] = freed.q
            again = loads.corrected(other)
            now = again.of(other).worst()
            if run.faults(other).number or now.max() > 0.9 * worst.max():
                break
            q, corrected, worst = other, again, now
        return q

    def _freed(
        self, run: Run, reference: Array, loads: ClipLoads | None, rate: float, beyond: Mask | None = None
    ) -> tuple[Array, list[str]]:
        """Postures (n, nq) that are free, near reference postures (n, nq), and what is missed; `beyond` change too."""
        windows = ClipRun(run, reference, LOADED if loads and self.time is None else self.time, rate, loads)
        q: Array = np.array(reference)
        run.watch.tell(0.0, "looking for collisions")
        faults = run.faults(reference)
        found = run.windows(faults.frames if beyond is None else faults.frames | beyond, self.margin)
        total, done, missed = max(1, sum(map(len, found))), 0, list[str]()
        for window in found:
            report = run.watch.teller(done / total, len(window) / total, f"frames {window.first} to {window.end - 1}")
            if loads is None:
                freed = _in_parts(run, windows, window, q, faults, report)
            else:  # loads of a frame are those of its neighbours too
                freed = windows.window(window, faults, report)
            q[window.first : window.end] = freed.q
            if run.ended:
                break
            if freed.missed:
                missed.append(f"frames {window.first} to {window.end - 1}: {freed.missed}")
            done += len(window)
        return q, missed

    def _timing(self, q: Array, terms: FrameTerms, loads: ClipLoads | None) -> Timing | None:
        """The new timing of postures (n, nq); None where it stays."""
        stretch = allowance(len(q), self.stretch)
        if stretch <= 1.0 or len(q) < 2:
            return None
        model, gaps = terms.scene.model, range(len(q) - 1)
        steps = np.array([pin.difference(model, q[gap], q[gap + 1]) for gap in gaps])
        slowest, fastest = (np.array(bounds) for bounds in zip(*map(terms.step_bounds, gaps), strict=True))
        most = speed_bounds(steps, slowest, fastest)
        b = slowed(most, terms.dt, stretch)
        if loads is not None:
            path = loads.of(q)
            for _ in range(3):  # the ground's forces are split as the timing before makes them
                b = slowed(most, terms.dt, stretch, path.timed(b))
        return timing(b, terms.dt)


def _in_parts(
    run: Run, windows: ClipRun, window: Window, reference: Array, faults: Faults, report: Callable[[float], bool]
) -> WindowResult:
    """A window freed part by part, each from the one before, or with it where it is not freed."""
    length, shared = run.frames(LONG, 2), run.frames(LONG / 4.0, 1)
    q, firsts, end, missed = np.array(reference), [window.first], window.first, list[str]()  # of each part

    def part_told(done: float) -> bool:
        return report((firsts[-1] - window.first + done * (length - shared)) / len(window))

    while firsts and not run.ended:
        first = firsts[-1]
        end = max(end, first + length if window.end - first > 2 * length else window.end)
        part, last = Window(first, end), end == window.end
        if part == window:
            break
        freed = windows.window(part, faults, part_told, around=q, whole=last, patient=False)
        if freed.missed and not freed.little:  # from there it cannot go on
            firsts.pop()
            missed[len(firsts) - 1 :] = []
            continue
        missed.append(freed.missed)
        q[first:end] = freed.q
        if last:
            return WindowResult(q[window.first : window.end], "; ".join(filter(None, missed)))
        firsts.append(end - shared)
    return windows.window(window, faults, report)
