"""Checks of settings and problems; classes and task files share the ranges."""

from __future__ import annotations

from typing import NamedTuple

from wholebody.base.checks import instance, number, settle, whole
from wholebody.problem import Problem


class Range(NamedTuple):
    """Range of a setting, both ends included.

    Attributes:
        low: the least.
        high: the greatest.
        whole: whether the setting is a whole number.
    """

    low: float
    high: float
    whole: bool = False

    def check(self, value: object, name: str) -> float:
        """The value as a number; an InputError if it is not in the range."""
        if self.whole:
            return whole(value, name, int(self.low), int(self.high))
        return number(value, name, self.low, self.high)


TOLERANCE = Range(1e-10, 0.1)
"""Metres and radians to which goals are met: smaller ones are below rounding, larger ones are meaningless."""

CCD_TOLERANCE = Range(1e-6, 0.1)
"""The same for cyclic coordinate descent, which converges slowly."""

ITERATIONS = Range(1, 100_000, whole=True)
BUDGET = Range(0, 1_000_000, whole=True)
RESTARTS = Range(0, 1000, whole=True)
SEED = Range(0, 2**32 - 1, whole=True)
DAMPING = Range(1e-9, 1e3)


def check_problem(problem: object, what: str) -> Problem:
    """A problem.

    Raises:
        InputError: it is something else.
    """
    return instance(problem, Problem, what, "state one with wb.Problem(scene, goals=[...])")


def check_settings(method: object, **ranges: Range) -> None:
    """Check settings of a method by their names, and keep them as numbers.

    Raises:
        InputError: one is not a number of its range.
    """
    for name, allowed in ranges.items():
        settle(method, name, allowed.check(getattr(method, name), name))
