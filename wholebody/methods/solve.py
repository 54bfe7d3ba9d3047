"""Solve a problem by a method's name or by a configured method."""

from __future__ import annotations

from typing import Protocol

from wholebody.errors import InputError, UnknownNameError
from wholebody.methods.control import Progress
from wholebody.problem import Problem, Solution

METHODS = ("qp", "ccd", "newton", "placo", "dls")


class Method(Protocol):
    """A way to solve a problem."""

    @property
    def name(self) -> str:
        """Name for tables."""

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture."""


def method_named(name: str) -> Method:
    """A method with its default settings.

    Raises:
        UnknownNameError: there is none of this name.
    """
    if name == "qp":
        from wholebody.methods.qp.method import QP

        return QP()
    if name == "ccd":
        from wholebody.methods.ccd.method import CCD

        return CCD()
    if name == "newton":
        from wholebody.methods.newton.method import Newton

        return Newton()
    if name == "placo":
        from wholebody.methods.placo.method import Placo

        return Placo()
    if name == "dls":
        from wholebody.methods.damped_least_squares import DampedLeastSquares

        return DampedLeastSquares()
    raise UnknownNameError("method", name, METHODS)


def solve(problem: Problem, method: str | Method = "qp", progress: Progress | None = None) -> Solution:
    """Find a posture that fits a problem.

    Ctrl-C ends it with the best posture so far, whose status is then "stalled".

    Args:
        problem: what is asked.
        method: "qp", "ccd", "newton", "placo", "dls", or a configured method such as
            `QP(solver="daqp", time_limit=0.1)`.
        progress: called after every iteration with its entry of the trace (see `Iterate`); the solve ends where it
            returns True.

    Returns:
        The posture with its status and the independent assessment. Goals out of reach and starts in penetration are
        answers, not errors.

    Raises:
        UnknownNameError: there is no such method.
        InputError: the scene changed after the problem was stated, or the method cannot take some of its terms.
    """
    if not isinstance(problem, Problem):
        raise InputError(f"solve takes a Problem, not a {type(problem).__name__}")
    chosen = method_named(method) if isinstance(method, str) else method
    return chosen.solve(problem, progress)
