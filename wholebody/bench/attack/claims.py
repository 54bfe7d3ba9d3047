"""What an answer says of itself, against what the judge finds: the verdict on a solve."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, get_args

import numpy as np

from wholebody.bench.attack.case import Verdict
from wholebody.bench.attack.judging import Judged, Pairs, judge
from wholebody.methods import METHODS
from wholebody.methods.solve import method_named
from wholebody.problem import Problem
from wholebody.solution import Solution, Status

ROUNDING = 2e-6  # m, rad: by which two ways of measuring may differ for pieces of up to a metre
OF_SIZE = 1e-5  # of the size of the largest piece: coal's distances of ellipsoids are relative to it
SHARE = 1.1  # of a method's tolerance, to which its answers may be off
CLEARLY = 0.5  # share of the tolerance within which everything must hold for "infeasible" to be a false claim


def tolerance_of(method: Any) -> float:
    """Return the tolerance of a method, given by name or configured, metres and radians."""
    chosen: Any = method_named(method) if method in METHODS else method
    return float(chosen.tolerance)


def verdict(
    problem: Problem,
    goals: Sequence[Any],
    constraints: Sequence[Any],
    solution: Solution,
    *,
    method: Any,
    witness: bool,
    seconds: float,
) -> Verdict:
    """Judge an answer.

    Args:
        problem: what was asked, as in `judge`.
        goals: as they were given.
        constraints: as they were given.
        solution: the answer.
        method: that gave it, by name or configured.
        witness: whether the problem was made from a posture that solves it.
        seconds: CPU time that the answer took.
    """
    found = judge(problem, goals, constraints, solution.q)
    words, said = _words(found), f"{solution.method} says {solution.status!r}"
    wrongs = _wrongs(problem, solution, found, tolerance_of(method))
    if wrongs:
        return Verdict("wrong", f"{said}: {', '.join(wrongs)}; {words}", seconds, solution.status)
    gave_up = witness and solution.status != "solved"
    return Verdict("gave up" if gave_up else "right", f"{said}; {words}", seconds, solution.status)


def _wrongs(problem: Problem, solution: Solution, found: Judged, tolerance: float) -> list[str]:
    """What is false about an answer."""
    if not found.finite:
        return ["the posture or a distance at it is not made of numbers"]
    if solution.status not in get_args(Status):
        return [f"{solution.status!r} is no status"]
    size = Pairs(problem.scene).size
    rounding = ROUNDING + OF_SIZE * size
    allowed = SHARE * tolerance + rounding
    wrongs = []
    if found.unit > 1e-6:
        wrongs.append(f"a quaternion is {found.unit:.3g} off unit length")
    if solution.status == "solved" and found.goal > allowed:
        wrongs.append(f"goals are missed by {found.goal:.3g} m or rad")
    if solution.status in ("solved", "unreachable") and found.violation > allowed:
        wrongs.append(f"what must hold is missed by {found.violation:.3g} m or rad")
    if solution.status == "infeasible" and found.violation < CLEARLY * tolerance:
        wrongs.append(f"everything holds to {found.violation:.3g} m or rad")
    said = solution.assessment
    pairs = (
        ("least distance", said.least_distance, found.least),
        ("goal error", max(said.goal_error, said.goal_angle), found.goal),
        ("clearance lack", said.clearance_violation, found.lack),
    )
    for name, value, measured in pairs:
        if not np.isfinite(value) and value != measured:
            wrongs.append(f"its {name} is {value}")
        elif np.isfinite(value) and abs(value - measured) > rounding + 1e-6 * abs(measured):
            wrongs.append(f"its {name} is {value:.9g}, and {measured:.9g} was measured")
    return wrongs


def _words(found: Judged) -> str:
    if not found.finite:
        return "not measured"
    return (
        f"goals {found.goal:.3g}, least distance {found.least:.3g}, clearance lack {found.lack:.3g} ({found.closest}), "
        f"limits {found.limits:.3g}, constraints {found.constraints:.3g}"
    )
