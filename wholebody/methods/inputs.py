"""Checks of settings and problems; classes and task files share the ranges."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from wholebody.base.checks import instance
from wholebody.base.fields import Range
from wholebody.problem import Problem

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
