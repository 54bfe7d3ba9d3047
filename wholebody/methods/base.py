"""What every method is: the protocols of methods, trackers and steps, and what several methods share.

A comparison, a drag or a path uses a method by these alone, so a method of one's own takes part in them too.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from wholebody.arrays import Array
from wholebody.checks import number, posture, time_step
from wholebody.errors import InputError
from wholebody.methods.control import Progress
from wholebody.methods.inputs import TOLERANCE, check_problem
from wholebody.problem import Problem
from wholebody.solution import Solution
from wholebody.workspace import Workspace


class Step(Protocol):
    """Answer of one step or frame of a tracker; what else there is depends on the method."""

    @property
    def q(self) -> Array:
        """(nq,) the next posture."""

    @property
    def iterations(self) -> int:
        """Iterations that it took."""


class Tracker(Protocol):
    """Follows the goals of one problem, which may move from call to call. For one figure and one thread at a time."""

    @property
    def problem(self) -> Problem:
        """Whose goals are followed."""

    @property
    def workspace(self) -> Workspace:
        """Its own; between calls it may be moved."""

    @property
    def unswept(self) -> float:
        """Radians and metres: a frame's way up to this goes into nothing, without anybody else having to look.

        Infinite where that is so for every frame, 0 where nobody looks after any.
        """

    @property
    def leaves_overlap(self) -> bool:
        """Whether its steps lead out of what came into the figure."""

    def step(self, q: Array) -> Step:
        """One step from the posture q (nq,) towards the goals, within the bounds on speeds."""

    def frame(self, q: Array, tolerance: float | None = None) -> Step:
        """One frame of a motion: as many steps from q (nq,) as bring the goals within a tolerance, if they soon do.

        Args:
            q: where the frame begins.
            tolerance: of the goals, metres and radians; None for one that serves on the way to a goal.
        """

    def solve(self, q: Array) -> Solution:
        """The method's full answer for the present goals, begun at the posture q (nq,)."""

    def nearest(self, q: Array) -> Solution:
        """The same with measures that count from q, so that the nearest answer is sought."""

    def ways_out(self, q: Array) -> Sequence[Array]:
        """Postures (nq,) that lead out of what came into the figure at q, where no step does; there may be none."""


class Method(Protocol):
    """A way to solve a problem."""

    @property
    def name(self) -> str:
        """Name for tables."""

    def accepts(self, problem: Problem) -> str | None:
        """None for a problem that the method can take; else the sentence that names what it cannot, and the mend.

        `solve` and `tracker` refuse with an `UnsupportedTermError` of this sentence, before anything is computed.
        """

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture."""

    def tracker(self, problem: Problem, dt: float) -> Tracker:
        """What follows the goals of a problem that move from call to call, in steps of `dt` seconds.

        A method that cannot track returns a `SolvingTracker`, which solves every step anew.
        """


class UnsupportedTermError(InputError):
    """A method cannot take some terms of a problem.

    Attributes:
        terms: one text for each term: what it is and why it cannot be taken.
    """

    def __init__(self, method: str, terms: Sequence[str]) -> None:
        """Build the sentence.

        Args:
            method: its name.
            terms: texts such as "constraints[1], Balance".
        """
        self.terms = tuple(terms)
        super().__init__(f"method {method!r} cannot take {'; '.join(terms)}; leave them out or use method='qp'")


def refusal(method: str, terms: Sequence[str]) -> str | None:
    """What `Method.accepts` returns: None where there is nothing that the method cannot take, else the sentence.

    Args:
        method: its name.
        terms: texts as for `UnsupportedTermError`.
    """
    return str(UnsupportedTermError(method, terms)) if terms else None


def named_terms(problem: Problem) -> list[tuple[str, object]]:
    """All terms of a problem, each with its place and kind, such as "constraints[1], Balance"."""
    groups: tuple[tuple[str, Sequence[object]], ...] = (
        ("goals", problem.goals),
        ("constraints", problem.constraints),
        ("bounds", problem.bounds),
        ("measures", problem.measures),
    )
    return [
        (f"{group}[{number}], {type(term).__name__}", term)
        for group, terms in groups
        for number, term in enumerate(terms)
    ]


class SolvedStep(NamedTuple):
    """A step that was a whole solve.

    Attributes:
        q: (nq,) the next posture.
        iterations: of the method.
        judging: seconds of wall time that the assessment took.
    """

    q: Array
    iterations: int
    judging: float


class SolvingTracker:
    """Follows goals by solving every step anew from the posture at hand; bounds on speeds do not hold.

    Attributes:
        problem: whose goals are followed.
        dt: seconds a step.
        workspace: its own; between calls it may be moved.
        unswept: 0: nobody has looked at the way of a step.
        leaves_overlap: False.
    """

    unswept = 0.0
    leaves_overlap = False

    def __init__(self, method: Method, problem: Problem, dt: float, rough: Method | None = None) -> None:
        """Set up.

        Args:
            method: that solves.
            problem: what is asked.
            dt: seconds a step.
            rough: that solves frames on the way to a goal; the method itself where None.

        Raises:
            InputError: dt is not a positive finite number, the scene changed after the problem was stated, or the
                method cannot take the problem.
        """
        self.problem, self.dt = check_problem(problem, "tracker: problem"), time_step(dt, "dt")
        self.workspace = problem.workspace()
        self._method, self._rough = method, method if rough is None else rough
        self._asked = copy.copy(problem)  # one for all steps: what a method builds for it serves again

    def step(self, q: Array) -> SolvedStep:
        """A whole solve from the posture q (nq,)."""
        return self.frame(q)

    def frame(self, q: Array, tolerance: float | None = None) -> SolvedStep:
        """A whole solve from the posture q (nq,), as exact as the method is set; rough without a tolerance."""
        if tolerance is not None:
            number(tolerance, "tolerance", TOLERANCE.low, TOLERANCE.high)
        solution = (self._rough if tolerance is None else self._method).solve(self._begun(q))
        return SolvedStep(np.asarray(solution.q, dtype=float), solution.iterations, solution.assessment.seconds)

    def solve(self, q: Array) -> Solution:
        """The method's answer for the present goals, begun at the posture q (nq,)."""
        return self._method.solve(self._begun(q))

    def nearest(self, q: Array) -> Solution:
        """The same with measures that count from q."""
        return self._method.solve(nearest_to(self.problem, q))

    def ways_out(self, q: Array) -> Sequence[Array]:
        """None."""
        posture(q, self.workspace.model.nq)
        return ()

    def _begun(self, q: Array) -> Problem:
        """The problem as it is now, begun at the posture q (nq,)."""
        now, asked = self.problem, self._asked
        asked.start = posture(q, now.scene.model.nq)
        asked.goals, asked.constraints, asked.bounds, asked.measures = (
            now.goals, now.constraints, now.bounds, now.measures,
        )  # fmt: skip
        asked.clearances = now.clearances
        return asked


def nearest_to(problem: Problem, q: Array) -> Problem:
    """The problem begun at the posture q (nq,), with measures that count from there too, such as effort."""
    result = problem.with_start(q)
    result.measures = tuple(term.resolve(problem.scene, result.start) for term in problem.measures)
    return result


def goal_error(problem: Problem, workspace: Workspace, q: Array) -> float:
    """What is left to the goals at a posture (nq,), metres or radians, the largest norm."""
    state = workspace.state.update(q)
    return max((float(np.linalg.norm(goal.error(state))) for goal in problem.goals), default=0.0)
