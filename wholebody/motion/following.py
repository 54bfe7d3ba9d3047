"""Frames of a clip by the tracker: each as near to its original posture as contacts and what is held let it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.methods.qp.method import QP
from wholebody.motion.frame_terms import FrameTerms
from wholebody.problem import Problem
from wholebody.tasks import Posture
from wholebody.tasks.base import Bound, Constraint, Goal, filled


@dataclass
class Work:
    """What freeing a clip took so far.

    Attributes:
        programs: quadratic programs that were solved.
        posture_solves: postures that were solved for, each on its own.
    """

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
        """Set up on a scene.

        Args:
            terms: original postures, and what is held.
            clearance: least distance of every pair, metres.
            work: counts the programs.
        """
        self._terms, self._clearance, self._work = terms, clearance, work
        q = terms.scene.figure.clamp(terms.q[0])
        self._problem = Problem(terms.scene, q, goals=[Posture(terms.q[0])], measures=(), clearance=0.0)
        bounds = [term.resolve(terms.scene, q) for term in terms.given if isinstance(term, Bound)]
        still = [bound for bound in bounds if np.isfinite(bound.bounds(State(terms.scene.model), None)).any()]
        self._problem.bounds = tuple(still)
        self._goal = Posture(terms.q[0]).resolve(terms.scene, q)
        self._tracker = QP(restarts=0).tracker(self._problem, terms.dt)

    def frame(self, number: int, q: Array, more: float = 0.0, *, goal: Array | None = None) -> Array:
        """The posture (nq,) of a frame, after three steps of the tracker at most.

        Args:
            number: of the frame.
            q: (nq,) where the steps begin, once it is within the bounds of the frame.
            more: metres that are asked of every pair beyond the clearance.
            goal: (nq,) posture that is followed in place of the original one.
        """
        terms, problem = self._terms, self._problem
        if terms.kept(number):
            return np.array(terms.q[number])
        problem.clearances = np.full_like(problem.clearances, self._clearance + more)
        q = terms.within(number, q)
        target = terms.q[number] if goal is None else goal
        near = filled(self._goal, target=target, resolved_target=target)
        held = terms.held(number)
        problem.goals = (near, *(term for term in held if isinstance(term, Goal)))
        problem.constraints = tuple(term for term in held if isinstance(term, Constraint))
        for _ in range(3):  # more come nearer to the original where much is in the way, for dearer frames
            step = self._tracker.step(q)
            self._work.programs += 1
            q = step.q
            if np.abs(step.displacement).max(initial=0.0) <= 1e-3:  # rad, m: what is left is little
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
