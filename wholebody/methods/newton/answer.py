"""What a search of Newton's method found, as a solution with status and message."""

from __future__ import annotations

import time

import numpy as np

from wholebody.methods.contradictions import in_words, proven
from wholebody.methods.newton.figure_course import FigureCourse
from wholebody.methods.newton.search import Found, Search, Settings
from wholebody.solution import Iterate, Solution, Status


def answer(search: Search, found: Found, began: float) -> Solution:
    """The solution that a search found, with status and message; it began at `began` by `time.perf_counter`."""
    stopped = search.course.control.message(found.judgement)
    status = _status(found, search.settings)
    if stopped and status != "solved":
        status = "stalled"
    status = proven(status, search.contradictions)
    said = in_words(search.contradictions) or stopped or _message(status, found, search)
    return Solution(
        q=found.q,
        status=status,
        seconds=time.perf_counter() - began,
        iterations=search.iterations,
        assessment=found.judgement,
        trace=tuple(Iterate(error, 0.0, 0.0, 0.0) for error in search.residuals),
        method=f"newton/{search.course.algebra.name}",
        message=said + found.judgement.in_the_way + _reported(search.course),
    )


def _status(found: Found, settings: Settings) -> Status:
    if not found.judgement.holds(settings.counted):
        return "infeasible" if found.reached.stationary else "stalled"
    if found.judgement.met(settings.counted):
        return "solved"
    return "unreachable" if found.reached.stationary else "stalled"


def _message(status: Status, found: Found, search: Search) -> str:
    judgement = found.judgement
    left = f"{1e3 * judgement.goal_error:.3g} mm and {np.degrees(judgement.goal_angle):.3g} degrees are left"
    if status == "solved":
        return f"solved in {search.iterations} iterations{found.how}"
    if status == "unreachable":
        return f"not reachable from here: nothing is violated, {left}"
    if judgement.holds(search.settings.counted):
        return f"ran out of iterations: {left}"
    name, missed = _worst(search.course, found)
    why = "what must hold cannot all hold" if status == "infeasible" else "ran out of iterations"
    return f"{why}: {name} is missed by {missed:.3g} m or rad"


def _worst(course: FigureCourse, found: Found) -> tuple[str, float]:
    """What is farthest from holding, and by how much."""
    problem, state = course.problem, course.workspace.state.update(found.q)
    worst = ("the clearance of a pair", max(found.judgement.clearance_lack, found.judgement.penetration))
    for number, term in enumerate(problem.constraints):
        value = np.atleast_1d(term.value(state))
        missed = float(np.maximum(term.lower - value, value - term.upper).max(initial=0.0))
        if missed > worst[1]:
            worst = (f"constraints[{number}], {type(term).__name__}", missed)
    return worst


def _reported(course: FigureCourse) -> str:
    names = ", ".join(course.objective.reported)
    return f"; {names} is reported, not minimised" if names else ""
