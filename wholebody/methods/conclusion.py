"""From where a search ended to a solution: the one place that says a status and a message."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from wholebody.arrays import Array
from wholebody.assessment import Assessment, assess
from wholebody.figures.state import State
from wholebody.methods.contradictions import Contradiction, explanation, in_words, proven
from wholebody.methods.control import Control
from wholebody.problem import Problem
from wholebody.solution import Solution, Status, TraceEntry

SLACK = 1.05  # times the tolerance: an assessment measures with other arithmetic
COAL_ACCURACY = 1e-6  # m


@dataclass(frozen=True)
class Ending:
    """Where a search ended, and what the solution is to say of it.

    Attributes:
        q: (nq,) the posture.
        settled: whether it ended because nothing better is near, rather than out of iterations or time.
        iterations: of the method.
        trace: one entry an iteration.
        how: what follows "solved".
        unit: what a method that is not settled ran out of.
        failure: why it could not go on, in words; "" where it could.
        caveat: what is said where something that must hold does not.
        remark: what is said in any case.
        contradictions: what the search found the problem to contradict itself in; None where it did not look.
        judgement: of the posture, where the search has made it already.
        programs: how many quadratic programs each way to solve them closed; empty for a method without any.
    """

    q: Array
    settled: bool
    iterations: int
    trace: tuple[TraceEntry, ...]
    how: str
    unit: str = "iterations"
    failure: str = ""
    caveat: str = ""
    remark: str = ""
    contradictions: tuple[Contradiction, ...] | None = None
    judgement: Assessment | None = None
    programs: Mapping[str, int] = field(default_factory=dict)


def counted(tolerance: float) -> float:
    """Error [m, rad] up to which an assessment counts as good for a method that meets everything to a tolerance."""
    return SLACK * tolerance + COAL_ACCURACY


def concluded(
    problem: Problem, ending: Ending, *, method: str, tolerance: float, control: Control, began: float
) -> Solution:
    """The solution.

    Args:
        problem: what was asked.
        ending: where the search ended.
        method: name of the method and of what it used.
        tolerance: metres and radians to which the method meets goals and constraints.
        control: that watched over the search.
        began: when the call began, by `time.perf_counter`.
    """
    judgement = assess(problem, ending.q) if ending.judgement is None else ending.judgement
    status = _status(judgement, ending, counted(tolerance), bool(control.reason))
    if ending.contradictions is None:
        why = "" if status == "solved" else explanation(problem)
    else:
        status, why = proven(status, ending.contradictions), in_words(ending.contradictions)
    if why and ending.caveat and not judgement.holds(counted(tolerance)):
        why += f"; {ending.caveat}"
    said = why or control.message(judgement) or _message(problem, status, judgement, ending, counted(tolerance))
    return Solution(
        q=ending.q,
        status=status,
        seconds=time.perf_counter() - began,
        iterations=ending.iterations,
        assessment=judgement,
        trace=ending.trace,
        method=method,
        message=said + judgement.in_the_way + ending.remark,
        programs=ending.programs,
    )


def _status(judgement: Assessment, ending: Ending, enough: float, stopped: bool) -> Status:
    settled = ending.settled and not stopped
    if not judgement.holds(enough):
        return "infeasible" if settled or ending.failure else "stalled"
    if judgement.met(enough):
        return "solved"
    return "unreachable" if settled else "stalled"


def _message(problem: Problem, status: Status, judgement: Assessment, ending: Ending, enough: float) -> str:
    left = f"{1e3 * judgement.goal_error:.3g} mm and {np.degrees(judgement.goal_angle):.3g} degrees are left"
    if status == "solved":
        return f"solved {ending.how}"
    if ending.failure:
        return f"{ending.failure}: {left}"
    if status == "unreachable":
        return f"not reachable from here: nothing is violated, {left}"
    if judgement.holds(enough):
        return f"ran out of {ending.unit}: {left}"
    name, missed = _worst(problem, judgement, ending.q)
    why = "what must hold cannot all hold" if status == "infeasible" else f"ran out of {ending.unit}"
    caveat = f"; {ending.caveat}" if ending.caveat else ""
    return f"{why}: {name} is missed by {missed:.3g} m or rad{caveat}"


def _worst(problem: Problem, judgement: Assessment, q: Array) -> tuple[str, float]:
    """What is farthest from holding, and by how much."""
    worst = max(
        ("the clearance of a pair", max(judgement.clearance_violation, judgement.penetration)),
        ("a joint limit", judgement.limit_violation),
        key=lambda item: item[1],
    )
    state = State(problem.scene.model).update(q)
    for number, term in enumerate(problem.constraints):
        value = np.atleast_1d(term.value(state))
        missed = float(np.maximum(term.lower - value, value - term.upper).max(initial=0.0))
        if missed > worst[1]:
            worst = (f"constraints[{number}], {type(term).__name__}", missed)
    return worst
