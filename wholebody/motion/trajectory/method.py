"""The method "trajectory": all frames around what collides at once, by sequential quadratic programming."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from wholebody import checks
from wholebody.arrays import Array
from wholebody.motion.avoider import MethodResult, Progress, Watch, check_input
from wholebody.motion.clip import Clip
from wholebody.motion.faults import faults
from wholebody.motion.frame_terms import Given, frame_terms
from wholebody.motion.trajectory.banded_qp import banded_solver
from wholebody.motion.trajectory.window_run import ClipRun
from wholebody.motion.windows import windows
from wholebody.scene import Scene

LOOKED = 0.1  # share of the progress that looking for collisions counts for


@dataclass(frozen=True)
class Trajectory:
    """All frames at once: the least deviation from the original, and the least acceleration of that deviation.

    Frames are changed in windows around what collides; all others stay as they are, bit by bit.

    Attributes:
        clearance: least distance of every pair, metres.
        time: seconds: how far a push at one frame spreads to its neighbours; larger = smoother, farther off.
        margin: seconds before and after a collision in which frames may be changed.
        solver: "piqp", "osqp", or None for piqp where it is installed, else osqp.
        iterations: most quadratic programs of one attempt at a window.

    Raises:
        InputError: a value out of range.
        UnknownNameError: there is no such solver.
        MissingPackageError: the solver is not installed.
    """

    clearance: float = 0.0
    time: float = 0.1
    margin: float = 0.5
    solver: str | None = None
    iterations: int = 40

    def __post_init__(self) -> None:
        """Check the settings."""
        checks.number(self.clearance, "Trajectory: clearance", 0.0, 0.5, "m")
        checks.number(self.time, "Trajectory: time", 0.0, 100.0, "s")
        checks.number(self.margin, "Trajectory: margin", 0.0, 100.0, "s")
        checks.whole(self.iterations, "Trajectory: iterations", 1, 10_000)
        banded_solver(self.solver)

    @property
    def name(self) -> str:
        """Name for tables."""
        return "trajectory" if self.solver is None else f"trajectory/{self.solver}"

    def avoid(self, clip: Clip, scene: Scene, constraints: Iterable[Given], progress: Progress | None) -> MethodResult:
        """Free a clip; see `wholebody.motion.avoider.Avoider`."""
        check_input(clip, scene, progress)
        terms, watch = frame_terms(scene, clip.q, clip.dt, constraints), Watch(progress)
        q: Array = np.array(clip.q)
        _, solve = banded_solver(self.solver)
        with scene.borrow() as workspace:
            watch.tell(0.0, "looking for collisions")
            depths, wrong, gaps = faults(workspace, terms, q, self.clearance)
            wrong[[frame + end for frame in gaps for end in (0, 1)]] = True
            margin = max(3, round(self.margin / clip.dt))
            found = windows(wrong, margin)
            run = ClipRun(self, terms, workspace, solve)
            total, done, missed = max(1, sum(map(len, found))), 0, []
            for window in found:
                begun, note = done, f"frames {window.first} to {window.end - 1}"
                share = len(window) / total
                cancelled = self._teller(watch, begun / total, share, note)
                freed = run.window(window, depths, gaps, cancelled)
                q[window.first : window.end] = freed.q
                if watch.ended:
                    break
                if freed.missed:
                    missed.append(f"{note}: {freed.missed}")
                done += len(window)
        message = "the caller ended it" if watch.ended else "; ".join(missed)
        return MethodResult(q, run.posture_solves, run.programs, message)

    def _teller(self, watch: Watch, begun: float, share: float, note: str) -> Callable[[float], bool]:
        return lambda part: watch.tell(LOOKED + (1.0 - LOOKED) * (begun + share * part), note)
