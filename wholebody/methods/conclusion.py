"""Makes the solution from the end of a search; only this module decides status and message.

`Descends` is the base of methods whose solve is one search in a workspace.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from wholebody.assessment.posture import Assessment, judged
from wholebody.base.arrays import Array, with_values
from wholebody.base.errors import either
from wholebody.figures.state import State
from wholebody.methods.base import (
    CONTACTS,
    TOLERANCE,
    FrameStep,
    SolvingTracker,
    UnsupportedTermError,
    check_problem,
)
from wholebody.methods.contradictions import Contradiction, contradictions_of, in_words, proven
from wholebody.methods.control import LONGEST, Control, Progress, errors_left
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import Solution, Status, TraceEntry
from wholebody.tasks.balance import Balance

PAIR = "the clearance of a pair"  # in messages


class Ending(NamedTuple):
    """The end of a search."""

    q: Array  # (nq,) the posture
    settled: bool  # whether the search converged, rather than ran out of iterations or time
    iterations: int  # of the method
    trace: tuple[TraceEntry, ...]  # one entry an iteration
    how: str  # text after "solved" in the message
    unit: str = "iterations"  # name of what a method that did not converge ran out of
    failure: str = ""  # why the method could not continue, in words; "" if it could
    left_out: tuple[str, ...] = ()  # names of what the method does not look at, see `Descends.leaves_out`
    # contradictions of the problem that the search found; None if it did not look for any
    contradictions: tuple[Contradiction, ...] | None = None
    judgement: Assessment | None = None  # the assessment of the posture, if the search has made it already
    # number of quadratic programs that each solver closed; empty for a method without programs
    programs: Mapping[str, int] = MappingProxyType({})
    method: str = ""  # what was run, where that says more than the method's name
    unreached: str = "not reachable from here"  # what the search knows of goals that are missed


def assessed_tolerance(tolerance: float) -> float:
    """Error [m, rad] up to which an assessment counts as good for a method with a tolerance."""
    return 1.05 * tolerance + 1e-6  # an assessment computes with other rounding


def meets(judgement: Assessment, tolerance: float) -> bool:
    """Whether a posture meets the goals with everything held, as a method with a tolerance [m, rad] is judged."""
    enough = assessed_tolerance(tolerance)
    return judgement.holds(enough) and judgement.met(enough)


def concluded(problem: Problem, ending: Ending, *, method: str, tolerance: float, control: Control) -> Solution:
    """The solution of a problem, whose search began with its control."""
    judgement = judged(problem, ending.q) if ending.judgement is None else ending.judgement
    enough = assessed_tolerance(tolerance)
    if control.undefined is not None:
        control.undefined = problem.placed(control.undefined)
        ending = with_values(ending, settled=False, unit="postures where all terms are finite")
    status, found = _status(judgement, ending, enough, bool(control.reason)), ending.contradictions
    if found is None:
        found = () if status == "solved" else contradictions_of(problem)
    status, why = proven(status, found, judgement.holds(enough)), in_words(found)
    caveat = f"this method leaves out {either(ending.left_out, 'and')}" if ending.left_out else ""
    if why and caveat and not judgement.holds(enough):
        why += f"; {caveat}"
    said = why or control.message(judgement) or _message(problem, status, judgement, ending, enough)
    note = f"; {problem.left_out}" if problem.left_out else ""
    blocked = "" if status == "solved" else judgement.in_the_way
    after = (blocked, _way_out(problem, judgement), _undefined(status, control), note)
    return Solution(
        q=ending.q, status=status, seconds=control.seconds, iterations=ending.iterations, assessment=judgement,
        trace=ending.trace, method=ending.method or method, message=said + "".join(after),
        programs=dict(ending.programs),
    )  # fmt: skip


def _status(judgement: Assessment, ending: Ending, enough: float, stopped: bool) -> Status:
    settled = ending.settled and not stopped
    if not judgement.holds(enough):
        return "infeasible" if settled or ending.failure else "stalled"
    if judgement.met(enough):
        return "solved"
    return "unreachable" if settled and judgement.nearest else "stalled"


def _message(problem: Problem, status: Status, judgement: Assessment, ending: Ending, enough: float) -> str:
    if status == "solved":
        return f"solved {ending.how}"
    left = errors_left(judgement)
    if ending.failure:
        return f"{ending.failure}: {left}"
    if status == "unreachable":
        return f"{ending.unreached}: nothing is violated, {left}"
    if judgement.holds(enough):
        why = "stopped short of the closest posture" if ending.settled else f"ran out of {ending.unit}"
        return f"{why}: {left}"
    name, missed = _worst(problem, judgement, ending.q)
    why = "the constraints cannot all hold" if status == "infeasible" else f"ran out of {ending.unit}"
    if (CONTACTS if name == PAIR else name) in ending.left_out:
        why = f"this method leaves out {either(ending.left_out, 'and')}"
    return f"{why}: {name} is missed by {missed:.3g} m or rad"


def _undefined(status: Status, control: Control) -> str:
    """Which term of one's own had no finite number where a step led, if the problem is not solved."""
    if status == "solved" or control.undefined is None:
        return ""
    return f"; a step was taken back: {control.undefined.at_posture(f'of iteration {control.undefined_at}')}"


def _way_out(problem: Problem, judgement: Assessment) -> str:
    """What to state where the margin of a person's default balance stands in the way of what it can be; else empty."""
    if not judgement.blockers:
        return ""
    for term, name in zip(problem.constraints, problem.constraint_names, strict=True):
        margin = term.margin if isinstance(term, Balance) and term in problem.defaults else 0.0
        # margins: a goal this far off may be met without the margin, which costs one to two of them of reach
        near = judgement.goal_error <= 3.0 * margin
        if near and margin and any(blocker.names == (name,) for blocker in judgement.blockers):
            least = f"{1e3 * margin:.0f} mm"
            return f"; state Balance() to let the centre of mass come nearer to the feet's edges than {least}"
    return ""


def _worst(problem: Problem, judgement: Assessment, q: Array) -> tuple[str, float]:
    """The most violated constraint, and its violation."""
    parts = (
        (PAIR, max(judgement.clearance_violation, judgement.penetration)),
        ("a joint limit", judgement.limit_violation),
    )
    worst = max(parts, key=lambda item: item[1])
    state = State(problem.scene.model).update(q)
    for name, term in zip(problem.constraint_names, problem.constraints, strict=True):
        value = np.atleast_1d(term.value(state))
        missed = float(np.maximum(term.lower - value, value - term.upper).max(initial=0.0))
        if missed > worst[1]:
            worst = (name, missed)
    return worst


class Descends(ABC):
    """A dataclass of settings with `tolerance` and `time_limit`, and a search that `solve` and `tracker` run.

    In frames of a motion before its end goals are met to `on_the_way` [m, rad], if that is more than the tolerance.
    Without a time limit a solve ends after `longest` seconds of processor time.
    """

    on_the_way = 0.0
    longest = LONGEST
    tolerance: Any
    time_limit: Any

    @property
    @abstractmethod
    def name(self) -> str:
        """Name for tables."""

    def accepts(self, problem: Problem) -> str | None:
        """None if the method can take all terms; otherwise the sentence that names those that it cannot."""
        check_problem(problem, f"{type(self).__name__}.accepts: problem")
        try:
            self._check_terms(problem)
        except UnsupportedTermError as error:
            return str(error)
        return None

    def _check_terms(self, problem: Problem) -> None:
        """Raise an `UnsupportedTermError` that lists the terms that this method cannot take; there are none here."""
        return

    def leaves_out(self, problem: Problem) -> tuple[str, ...]:
        """Names of what this method does not look at, which the assessment alone judges; known without a search.

        `wb.solve`, drags, paths, live pages, reach maps and studies warn of it before they begin.
        """
        return self._unseen(check_problem(problem, f"{type(self).__name__}.leaves_out: problem"))

    def _unseen(self, problem: Problem) -> tuple[str, ...]:
        """See `leaves_out`; nothing here."""
        return ()

    @abstractmethod
    def _descend(self, problem: Problem, workspace: Workspace, control: Control) -> Ending:
        """Search from the problem's start in a workspace on its scene."""

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture. Goals out of reach and starts in penetration are answers, not errors.

        Args:
            problem: to be solved.
            progress: see `wholebody.methods.control.Progress`.

        Raises:
            UnsupportedTermError: the problem has terms that this method cannot take.
            InputError: the scene changed after the problem was made.
        """
        check_problem(problem, f"{type(self).__name__}.solve: problem")
        with Control(self.time_limit, progress, self.longest) as control, problem.borrow() as workspace:
            ending = self._descend(problem, workspace, control)
        ending = with_values(ending, left_out=self._unseen(problem))
        return concluded(problem, ending, method=self.name, tolerance=self.tolerance, control=control)

    def tracker(self, problem: Problem, dt: float) -> SolvingTracker:
        """A tracker that searches anew at every step, from the present posture."""
        return DescentTracker(self, problem, dt)


class DescentTracker(SolvingTracker):
    """Follows by the searches of a method: a frame takes the end of a search, without an assessment or a message."""

    def __init__(self, method: Any, problem: Problem, dt: float) -> None:
        super().__init__(method, problem, dt)
        self._exact, self._rough = method, replace(method, tolerance=max(method.tolerance, method.on_the_way))

    def frame(self, q: Array, tolerance: float | None = None) -> FrameStep:
        """The end of a search from the posture q (nq,); without a tolerance to that of frames on the way."""
        if tolerance is not None:
            TOLERANCE(tolerance, "tolerance")
        method = self._rough if tolerance is None else self._exact
        problem = self._begun(q)
        problem.check_fresh()
        self.workspace.refresh()
        with Control(method.time_limit) as control:
            ending = self.search(method, problem, control)
        return FrameStep(self.bounded(q, ending.q), ending.iterations)

    def search(self, method: Any, problem: Problem, control: Control) -> Ending:
        """The end of the method's search; a tracker may keep what searches share."""
        found: Ending = method._descend(problem, self.workspace, control)
        return found
