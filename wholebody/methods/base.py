"""The protocols of methods, trackers and steps; ranges of settings, and functions that several methods share."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Annotated, Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import instance, posture, time_step
from wholebody.base.errors import InputError
from wholebody.base.fields import Range
from wholebody.methods.control import Progress
from wholebody.problem import Problem
from wholebody.scene.moving_obstacles import Collision, FrameMotion
from wholebody.scene.workspace import NotCopyable, Workspace
from wholebody.solution import Solution
from wholebody.tasks.bounds import at_speeds, shortened

CONTACTS = "contacts"
"""Name of what keeps pairs apart, among what a method leaves out."""

TOLERANCE = Range(1e-10, 0.1)
"""Metres and radians to which goals are met: smaller ones are below rounding, larger ones are meaningless."""

CCD_TOLERANCE = Range(1e-6, 0.1)
"""The same for cyclic coordinate descent, which converges slowly."""

ITERATIONS = Range(1, 100_000, whole=True)
BUDGET = Range(0, 1_000_000, whole=True)
RESTARTS = Range(0, 1000, whole=True)
SEED = Range(0, 2**32 - 1, whole=True)
DAMPING = Range(1e-9, 1e3)
TIME_LIMIT = Range(1e-9, 1e9, "s", endless=True)

Tolerance: TypeAlias = Annotated[float, TOLERANCE]
Iterations: TypeAlias = Annotated[int, ITERATIONS]
Restarts: TypeAlias = Annotated[int, RESTARTS]
Seed: TypeAlias = Annotated[int, SEED]
TimeLimit: TypeAlias = Annotated[float, TIME_LIMIT] | None


def check_problem(problem: object, what: str) -> Problem:
    """A problem; an error if it is something else."""
    return instance(problem, Problem, what, "state one with wb.Problem(scene, goals=[...])")


class Step(Protocol):
    """Answer of one step or frame of a tracker; further attributes depend on the method."""

    @property
    def q(self) -> Array:
        """(nq,) the next posture."""

    @property
    def iterations(self) -> int:
        """Number of iterations."""


class Tracker(Protocol):
    """Follows the goals of one problem, which may move from call to call. It serves one thread at a time.

    Examples:
        >>> tracker = wb.methods.QP().tracker(problem, dt=0.02)
        >>> tracker.step(problem.start).q.shape == problem.start.shape
        True
    """

    @property
    def problem(self) -> Problem:
        """The problem whose goals it follows."""

    @property
    def workspace(self) -> Workspace:
        """Its own workspace; between calls others may move it."""

    @property
    def unswept(self) -> float:
        """Length of motion, radians and metres, up to which a frame needs no sweep, because the tracker tested it.

        Infinite if the tracker tests every frame, 0 if it tests none.
        """

    @property
    def leaves_overlap(self) -> bool:
        """Whether its steps lead out of a thing that was moved into the figure."""

    def step(self, q: Array) -> Step:
        """One step from the posture q (nq,) towards the goals, within the velocity bounds."""

    def frame(self, q: Array, tolerance: float | None = None) -> Step:
        """One frame of a motion, within the velocity bounds: steps from q (nq,) until the goals are within a tolerance.

        Args:
            q: posture at the beginning of the frame.
            tolerance: of the goals, metres and radians; None for the tracker's tolerance during a motion.
        """

    def solve(self, q: Array) -> Solution:
        """The method's full answer for the present goals, from the start q (nq,)."""

    def nearest(self, q: Array) -> Solution:
        """The same with measures relative to q, which gives the nearest answer."""

    def overlap_resolutions(self, q: Array) -> Sequence[Array]:
        """Postures (nq,) that lead out of a thing in the figure at q, if no step does; there may be none."""


class Method(Protocol):
    """An algorithm that solves problems.

    One that does not look at all of a problem has `leaves_out(problem)` too, names of what it leaves to the assessment,
    which is said before it begins.

    Examples:
        examples/own_method.py is a whole method in forty lines; an object or "module:Class" names it.

        >>> wb.methods.QP().accepts(problem)
    """

    @property
    def name(self) -> str:
        """Name for tables."""

    def accepts(self, problem: Problem) -> str | None:
        """None if the method can take the problem; otherwise a sentence with the unsupported terms and the correction.

        `solve` and `tracker` raise an `UnsupportedTermError` with this sentence before anything is computed.

        Raises:
            InputError: it is no problem.
        """

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture."""

    def tracker(self, problem: Problem, dt: float) -> Tracker:
        """A tracker that follows goals which move from call to call, in steps of `dt` seconds.

        A method that cannot track returns a `SolvingTracker`, which solves the problem anew at every step.
        """


class UnsupportedTermError(InputError):
    """A method cannot take some terms of a problem.

    Attributes:
        terms: one text for each term, such as "constraints[1], Balance", with the reason.
    """

    def __init__(self, method: str, terms: Sequence[str]) -> None:
        self.terms = tuple(terms)
        super().__init__(f"method {method!r} cannot take {'; '.join(terms)}; leave them out or use method='qp'")


def refusal(method: str, terms: Sequence[str]) -> str | None:
    """The return value of `Method.accepts`: None without unsupported terms, otherwise the sentence."""
    return str(UnsupportedTermError(method, terms)) if terms else None


def named_terms(problem: Problem) -> list[tuple[str, object]]:
    """The stated terms, each with its index and class, such as "constraints[1], Balance"; no defaults."""
    groups: tuple[tuple[str, Sequence[object]], ...] = (
        ("goals", problem.goals),
        ("constraints", problem.stated),
        ("bounds", problem.bounds),
        ("measures", problem.measures if problem.measures_given else ()),
    )
    return [
        (f"{group}[{number}], {type(term).__name__}", term)
        for group, terms in groups
        for number, term in enumerate(terms)
    ]


def unseen(problem: Problem, takes: Callable[[object], bool], *, contacts: bool = False) -> tuple[str, ...]:
    """Names of what a method does not look at: contacts, where there can be some, and defaults it does not take."""
    named = zip(problem.constraint_names, problem.constraints, strict=True)
    defaults = [name for name, term in named if term in problem.defaults and not takes(term)]
    return (*([CONTACTS] if contacts and len(problem.clearances) else []), *defaults)


class FrameStep(NamedTuple):
    """Answer of one frame."""

    q: Array  # (nq,) the next posture
    iterations: int  # of the method
    # what things that moved meanwhile (`Scene.move` with `over`) passed through, or are inside of; empty if nothing
    collisions: tuple[Collision, ...] = ()
    path: tuple[tuple[float, Array], ...] = ()  # where the figure went if things moved, see `QPStep`
    judging: float = 0.0  # seconds of wall time that an assessment took


class SolvingTracker(NotCopyable):
    """Follows goals by solving the problem anew at every step from the present posture.

    A step goes towards the answer as far as bounds on velocities allow.

    Attributes:
        problem: to be solved whose goals it follows.
        dt: seconds a step.
        workspace: its own workspace; between calls others may move it.
    """

    unswept = 0.0  # no step is tested for passing through things
    leaves_overlap = False

    def __init__(self, method: Method, problem: Problem, dt: float) -> None:
        """Set up; errors where dt is no time step, the scene changed, or the method cannot take the problem."""
        self.problem, self.dt = check_problem(problem, "tracker: problem"), time_step(dt, "dt")
        self.workspace = problem.workspace()
        self._method = method
        self._asked = copy.copy(problem)  # one for all steps, so that methods can reuse what they build for it

    def step(self, q: Array) -> Step:
        """The same as `frame`; what things that moved meanwhile met is named."""
        q = begun(self.problem, q)
        self.workspace.refresh()
        motion = self.workspace.next_frame(q)
        step: Any = self.frame(q)
        if motion is not None:
            step = with_values(step, collisions=judged(self.workspace, motion, q, step.q))
        made: Step = step
        return made

    def frame(self, q: Array, tolerance: float | None = None) -> Step:
        """A whole solve from the posture q (nq,)."""
        if tolerance is not None:
            tolerance = TOLERANCE(tolerance, "tolerance")
        solution = self._method.solve(self._begun(q))
        return FrameStep(self.bounded(q, solution.q), solution.iterations, judging=solution.assessment.seconds)

    def solve(self, q: Array) -> Solution:
        """The method's answer for the present goals, from the start q (nq,)."""
        return self._method.solve(self.problem.with_start(q))

    def nearest(self, q: Array) -> Solution:
        """The same with measures relative to q."""
        return self._method.solve(nearest_to(self.problem, q))

    def overlap_resolutions(self, q: Array) -> Sequence[Array]:
        """No postures."""
        posture(q, self.workspace.model.nq)
        return ()

    def bounded(self, q: Array, end: Array) -> Array:
        """The motion from q to `end`, both (nq,), as far as bounds on velocities allow in a step."""
        most = at_speeds(self.problem.bounds, self.workspace.state.update(q), self.dt)
        return shortened(self.workspace.model, q, np.asarray(end, dtype=float), most)

    def _begun(self, q: Array) -> Problem:
        """The present problem with the start q (nq,)."""
        now, asked = self.problem, self._asked
        asked.start = posture(q, now.scene.model.nq)
        asked.goals, asked.constraints, asked.bounds, asked.measures = (
            now.goals, now.constraints, now.bounds, now.measures,
        )  # fmt: skip
        asked.clearances = now.clearances
        return asked


class SolvesAnew:
    """Base of methods that follow goals by solving the problem anew at every step."""

    def tracker(self: Method, problem: Problem, dt: float) -> SolvingTracker:
        """A tracker that solves the problem anew at every step."""
        return SolvingTracker(self, problem, dt)


def begun(problem: Problem, q: Array) -> Array:
    """The posture (nq,) at which a step begins; an angle that was probably meant in degrees is said."""
    q = posture(q, problem.scene.model.nq)
    problem.scene.figure.warn_of_angles(q, "step: q")
    return q


def judged(workspace: Workspace, motion: FrameMotion, before: Array, after: Array) -> tuple[Collision, ...]:
    """What a figure that goes straight from one posture to another, both (nq,), could not avoid in a frame."""
    collisions = motion.collisions(((0.0, np.asarray(before, dtype=float)), (1.0, after)))
    workspace.keep(motion, collisions)
    return collisions


def nearest_to(problem: Problem, q: Array) -> Problem:
    """The problem with the start q (nq,), and with measures such as effort relative to q."""
    result = problem.with_start(q)
    result.measures = tuple(term.resolve(problem.scene, result.start) for term in problem.measures)
    return result


def goal_error(problem: Problem, workspace: Workspace, q: Array) -> float:
    """Largest norm of a goal's error at a posture (nq,), metres or radians."""
    state = workspace.state.update(q)
    return float(np.max([0.0, *(np.linalg.norm(goal.error(state)) for goal in problem.goals)]))
