"""Method "fade": the deepest frame of each collision is freed, and its change fades out over the frames around it.

This is what commercial animation tools do. It is repeated on what then collides, so it ends when all is free or when
the rounds are used up.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.methods.qp.method import QP
from wholebody.motion.avoider import MethodResult, Progress, Watch, check_input
from wholebody.motion.clip import Clip
from wholebody.motion.faults import faults
from wholebody.motion.frame_terms import FrameTerms, Given, frame_terms, said
from wholebody.motion.windows import Window, runs
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks.base import Bound, Goal

ROUNDS = 12  # each frees the deepest frame of every collision that is left
SMALLEST = 1e-4  # m: what a dip between two frames counts for
MOST_SOLVES = 200  # of postures, for a whole clip


@dataclass(frozen=True)
class Fade:
    """The deepest frame of each collision freed, its change faded over the frames around it.

    Attributes:
        clearance: least distance of every pair in the freed frames, metres.
        fade: seconds before and after a collision over which a change fades.
        rounds: most rounds; each begins with what is left of the one before.

    Raises:
        InputError: a value out of range.
    """

    clearance: float = 0.0
    fade: float = 0.3
    rounds: int = ROUNDS

    def __post_init__(self) -> None:
        """Check the settings."""
        checks.settle(self, "clearance", checks.number(self.clearance, "Fade: clearance", 0.0, 0.5, "m"))
        checks.settle(self, "fade", checks.number(self.fade, "Fade: fade", 0.0, 100.0, "s"))
        checks.settle(self, "rounds", checks.whole(self.rounds, "Fade: rounds", 1, 1000))

    @property
    def name(self) -> str:
        """Name for tables."""
        return "fade"

    @property
    def dynamics(self) -> None:
        """It looks at no torques."""

    def avoid(self, clip: Clip, scene: Scene, constraints: Iterable[Given], progress: Progress | None) -> MethodResult:
        """Free a clip; see `wholebody.motion.avoider.Avoider`."""
        check_input(clip, scene, progress)
        terms, watch = frame_terms(scene, clip.q, clip.dt, constraints, self.clearance), Watch(progress)
        q, fade, solves, programs = np.array(clip.q), max(1, round(self.fade / clip.dt)), 0, 0
        total = np.inf
        with scene.borrow() as workspace:
            for number in range(self.rounds):
                depths, wrong, gaps = faults(workspace, terms, q, self.clearance)
                wrong[[frame + end for frame in gaps for end in (0, 1)]] = True
                left = runs(wrong)
                if not left:
                    return MethodResult(q, solves, programs, said(terms))
                total, before = float(depths.sum()) + len(gaps) * SMALLEST, total
                if total >= before:
                    return MethodResult(q, solves, programs, said(terms, "a round made nothing better"))
                for place, run in enumerate(left):
                    if watch.tell((number + place / len(left)) / self.rounds, f"round {number + 1}"):
                        return MethodResult(q, solves, programs, said(terms, "the caller ended it"))
                    if solves == MOST_SOLVES:
                        return MethodResult(q, solves, programs, said(terms, f"{MOST_SOLVES} postures did not free it"))
                    deepest = run.first + int(np.argmax(depths[run.first : run.end]))
                    freed, spent = freed_posture(terms, deepest, q[deepest], self.clearance)
                    solves, programs = solves + 1, programs + spent
                    _fade(terms, q, run, deepest, freed, fade)
                q = np.array([scene.figure.clamp(posture) for posture in q])
            left = runs(faults(workspace, terms, q, self.clearance)[1])
        return MethodResult(q, solves, programs, said(terms, f"{self.rounds} rounds did not free it" if left else ""))


def freed_posture(terms: FrameTerms, frame: int, q: Array, clearance: float) -> tuple[Array, int]:
    """A posture (nq,) without overlap, near a posture of a frame, and how many programs it took.

    Args:
        terms: what is held.
        frame: whose constraints hold.
        q: (nq,) near which; it may overlap.
        clearance: least distance of every pair, metres.
    """
    held = terms.held(frame)
    goals = [term for term in held if isinstance(term, Goal)]
    others = [term for term in held if not isinstance(term, Goal)]
    bounds = [term for term in terms.given if isinstance(term, Bound)]
    problem = Problem(terms.scene, terms.scene.figure.clamp(q), goals=goals, constraints=[*others, *bounds])
    terms.leave_out(frame, problem.left_out)
    problem.clearances = np.full_like(problem.clearances, clearance)
    solution = QP(restarts=0).solve(problem)
    return solution.q, sum(solution.programs.values())


def _fade(terms: FrameTerms, q: Array, run: Window, deepest: int, freed: Array, fade: int) -> None:
    """Add the change of the deepest frame to the frames of its collision, and a share of it to those around."""
    model = terms.scene.model
    change = np.asarray(pin.difference(model, q[deepest], freed))
    for frame in range(max(0, run.first - fade), min(len(q), run.end + fade)):
        if terms.kept(frame):
            continue
        away = max(run.first - frame, frame - run.end + 1, 0) / (fade + 1)
        q[frame] = pin.integrate(model, q[frame], (1.0 - away) ** 2 * (1.0 + 2.0 * away) * change)
