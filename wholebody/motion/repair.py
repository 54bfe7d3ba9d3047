"""What a method left, put right: frames and motions between frames, in short windows of all frames at once.

The methods that make posture after posture leave motions that dip between two free frames, and frames in which contact
and what is held contradict each other. Around each of them the least smooth change of a few tenths of a second is
found, with rows of contact in every frame and at the places between frames that dip. It is the program of the method
"trajectory", on postures that are nearly free already.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.base.records import with_values
from wholebody.motion.avoider import Watch
from wholebody.motion.dips import dip_depth, dips
from wholebody.motion.faults import faults
from wholebody.motion.following import SHALLOW, Follower, keep_back
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.one_side import one_sided
from wholebody.motion.trajectory.banded_qp import banded_solver
from wholebody.motion.trajectory.chart import Chart
from wholebody.motion.trajectory.nodes import NEAREST, Node, NodeEvaluator, Rows, Terms
from wholebody.motion.trajectory.objective import Objective
from wholebody.motion.trajectory.program import Limits
from wholebody.motion.trajectory.sqp import WindowProgram
from wholebody.motion.windows import Window, windows
from wholebody.scene.workspace import Workspace

MARGIN = 0.1  # s, before and after what is wrong: in which postures may change; what is left gets twice as much
ROUNDS = 4  # of looking at the clip, and repairing what is wrong
ADDED = 6  # rounds of sweeping one window, and adding the places that dip
PROGRAMS = 12  # most of one round of a window; more = more that is freed, longer where nothing can be
RADIUS = 0.05  # rad, m: first trust region; postures are nearly free
NEAR = 0.03  # m: pairs nearer than this have rows
ROOM = 3e-4  # m: clearance that a motion that dips is first asked for beyond the others; it doubles
MOST_ROOM = 5e-3  # m
THROUGH = 0.06  # m, as thick as a forearm: no rows free a deeper dip, of a limb that goes right through
SPREAD = 0.06  # s: how far a push at one frame spreads to its neighbours


class _Left(NamedTuple):
    """What is wrong with some postures.

    Attributes:
        wrong: number of frames with something wrong, and of gaps that dip between others.
        dipping: these gaps, and the shares of each at which it is deepest.
    """

    wrong: int
    dipping: dict[int, list[float]]


class _NodeEvaluator(NodeEvaluator):
    """Looks at what is near, and asks for more room in and beside motions that dip.

    Attributes:
        room: (n,) metres beyond the clearance, by the window's frames; a place between two frames has that of the
            first one.
    """

    def __init__(self, workspace: Workspace, chart: Chart, terms: Sequence[Terms], clearance: float) -> None:
        super().__init__(workspace, chart, terms, clearance)
        self.room = np.zeros(len(chart))

    def at(self, node: Node, x: Array, within: float) -> Rows:
        rows = super().at(node, x, min(within, NEAR))
        return with_values(rows, gap=rows.gap - self.room[node.frame])

    def ask(self, gap: int) -> None:
        """Ask for more room in a gap, and in the frames at its ends."""
        for frame in (gap, gap + 1):
            self.room[frame] = min(2.0 * self.room[frame] + ROOM, MOST_ROOM)


class Repairer:
    """Puts right what is left in the postures of one clip."""

    def __init__(self, terms: FrameTerms, workspace: Workspace, clearance: float = 0.0) -> None:
        """Take what is needed; nothing is computed yet.

        Args:
            terms: original postures, and what is held.
            workspace: of this run alone.
            clearance: least distance of every pair, metres.
        """
        self._terms, self._workspace, self._clearance = terms, workspace, clearance
        self._follower: Follower | None = None
        self._programs = 0

    @property
    def programs(self) -> int:
        """How many quadratic programs were solved."""
        return self._programs + (0 if self._follower is None else self._follower.programs)

    def repair(self, q: Array, watch: Watch) -> Array:
        """Postures (n, nq) with less that is wrong; others are the given ones but for those beside something passed."""
        q = np.array(q)
        margin = max(2, round(MARGIN / self._terms.dt))
        q = one_sided(self._terms, self._following, self._workspace, q, watch)
        for number in range(ROUNDS):
            wrong, gaps = self._faults(q)
            # what rows cannot free, and later what they did not free
            changed = [self._kept_back(q, gap, SHALLOW if number else THROUGH, watch) for gap in gaps]
            if watch.ended:
                return q
            if any(changed):
                wrong, gaps = self._faults(q)
            wrong[[frame + end for frame in gaps for end in (0, 1)]] = True
            for window in windows(wrong, margin << number):
                if watch.tell(1.0, f"frames {window.first} to {window.end - 1} are repaired"):
                    return q
                changed.append(self._window(window, q))
            if not any(changed) and number:
                break
        return q

    def _faults(self, q: Array) -> tuple[Mask, list[int]]:
        """(n,) frames of postures (n, nq) in which something is wrong, and gaps between others that dip."""
        return faults(self._workspace, self._terms, q, self._clearance)[1:]

    def _kept_back(self, q: Array, gap: int, deep: float, watch: Watch) -> bool:
        """Keep frames beside a gap that is deeper on one side of what it passes, in place; whether that succeeded."""
        if watch.ended or dip_depth(self._workspace, q[gap], q[gap + 1]) <= deep:
            return False

        def cancelled() -> bool:
            return watch.tell(1.0, f"what passes after frame {gap} is kept on one side")

        return keep_back(self._following(), self._workspace, q, gap, len(q), cancelled=cancelled)

    def _following(self) -> Follower:
        if self._follower is None:
            self._follower = Follower(self._terms, self._clearance)
        return self._follower

    def _window(self, window: Window, q: Array) -> bool:
        """Repair one window of q (n, nq) in place; whether it is better than before."""
        terms, workspace = self._terms, self._workspace
        chart = Chart(workspace.model, q[window.first : window.end].copy())
        seams = window.first > 0, window.end < len(q)
        objective = Objective(len(window), np.ones(workspace.model.nv), SPREAD, terms.dt, seams)
        held = [terms.held(frame) for frame in range(window.first, window.end)]
        evaluator = _NodeEvaluator(workspace, chart, held, self._clearance)
        program = WindowProgram(
            evaluator, objective, self._limits(window, chart, seams), banded_solver(None)[1], PROGRAMS
        )
        x = np.zeros((len(window), workspace.model.nv))
        found = chart.original.copy()
        before = best = left = self._left(found, window)
        for number in range(ADDED):
            places = [(gap, at) for gap, shares in left.dipping.items() for at in shares]
            program.add([Node(gap, float(np.clip(at, NEAREST, 1.0 - NEAREST))) for gap, at in places])
            for gap in left.dipping:
                evaluator.ask(gap)
            answer = program.run(x, lambda count, worst: False, RADIUS)
            self._programs += answer.programs
            x, postures, moved = answer.x, chart.original.copy(), (answer.x != 0.0).any(axis=1)
            postures[moved] = chart.postures(x)[moved]
            left = self._left(postures, window)
            if left.wrong < best.wrong:
                best, found = left, postures
            if not left.dipping or (number and not answer.met):
                break
        q[window.first : window.end] = found
        return best.wrong < before.wrong

    def _left(self, q: Array, window: Window) -> _Left:
        """What is wrong with postures (n, nq) of a window."""
        _, wrong, gaps = faults(self._workspace, self._terms, q, self._clearance, window.first)
        return _Left(int(wrong.sum()) + len(gaps), dips(self._workspace, q, gaps))

    def _limits(self, window: Window, chart: Chart, seams: tuple[bool, bool]) -> Limits:
        """Bounds on the changes of the postures; at a seam nothing moves."""
        model, shape = chart.model, (len(chart), chart.model.nv)
        lower, upper = np.full(shape, -np.inf), np.full(shape, np.inf)
        limits = self._terms.scene.figure.limits
        lower[:, limits.idx_v] = limits.lower - chart.original[:, limits.idx_q]
        upper[:, limits.idx_v] = limits.upper - chart.original[:, limits.idx_q]
        for place in range(len(chart)):
            frame = window.first + place
            least, most = self._terms.bounds(frame, self._workspace.state)[:2]
            away = pin.difference(model, self._terms.q[frame], chart.original[place])
            lower[place] = np.maximum(lower[place], np.where(np.isfinite(least), least - away, -np.inf))
            upper[place] = np.minimum(upper[place], np.where(np.isfinite(most), most - away, np.inf))
            still = least == most
            lower[place, still] = upper[place, still] = 0.0
        for seam, place in zip(seams, (0, -1), strict=True):
            if seam:
                lower[place] = upper[place] = 0.0
        free = np.full((len(chart) - 1, model.nv), np.inf)
        return Limits(lower, upper, -free, free)
