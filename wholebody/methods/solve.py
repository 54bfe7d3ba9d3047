"""Solve a problem by a method's name or by a configured method."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from wholebody.base.checks import function, shown
from wholebody.base.errors import InputError, UnknownNameError, WholebodyError, either, one_line
from wholebody.methods import METHODS
from wholebody.methods.base import Method, check_problem
from wholebody.methods.control import Progress
from wholebody.problem import Problem
from wholebody.solution import Solution

PROTOCOL = "solve", "tracker", "accepts"


def method_named(name: str) -> Method:
    """A method with its default settings, or one of one's own as "module:Class"."""
    if ":" in name:
        return as_method(imported(name)())
    if name not in METHODS:
        raise UnknownNameError("method", name, METHODS)
    return _usual(name)


@cache
def _usual(name: str) -> Method:
    """A method with its default settings, which are frozen: one object serves all solves."""
    method: Method = getattr(import_module("wholebody.methods"), METHODS[name])()
    return method


def imported(name: str) -> Callable[..., Method]:
    """The class of a method of one's own, from "module:Class"; modules are looked for in the working folder too."""
    module, _, kind = name.partition(":")
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        found = getattr(import_module(module), kind)
    except Exception as error:  # whatever the module raises
        reason = one_line(f"{type(error).__name__}: {error}")
        raise InputError(f"method {name!r} cannot be imported ({reason}); give 'module:Class'") from None
    if not isinstance(found, type) or not all(callable(getattr(found, part, None)) for part in PROTOCOL):
        raise InputError(f"method {name!r} is no class with solve, tracker and accepts; derive it from wb.Method")
    return found


def as_method(given: object) -> Method:
    """A method from its name, or a configured one as it is; InputError if it is neither."""
    if isinstance(given, str):
        return method_named(given)
    parts = (getattr(given, name, None) for name in PROTOCOL)
    if isinstance(given, type) or not all(map(callable, parts)) or not hasattr(given, "name"):
        raise InputError(f"method is {shown(given)}; give a name such as 'qp', or a method such as wb.methods.QP()")
    return given  # type: ignore[return-value]


def method_for_motions(given: object) -> Method:
    """A method for motions: by name, with a tolerance of 1e-5 and no restarts; a configured one is used as it is."""
    # m, rad: tolerance of the goals at the end of a motion
    own: dict[str, Any] = {"qp": {"restarts": 0}, "ccd": {"tolerance": 1e-5, "restarts": 0}}
    method: Any = as_method(given)
    made: Method = replace(method, **own[given]) if isinstance(given, str) and given in own else method
    return made


def warn_of_left_out(method: Method, level: int, *problems: Problem) -> Method:
    """Say before anything is computed what a method does not look at; `level` as in `warnings.warn`, of the caller."""
    return warn_of_names(method, level + 1, [name for problem in problems for name in left_out(method, problem)])


def warn_of_names(method: Method, level: int, found: Iterable[str]) -> Method:
    """Say once what a method does not look at, by names that `left_out` found; `level` as in `warnings.warn`."""
    if names := [*dict.fromkeys(found)]:
        said = f"method {method.name!r} leaves out {either(names, 'and')}, which the assessment alone judges"
        warnings.warn(f"{said}; use method='qp'", stacklevel=level + 1)
    return method


def left_out(method: Any, problem: Problem) -> Sequence[str]:
    """What a method does not look at of a problem that it takes; nothing of one that it refuses by an error."""
    if not hasattr(method, "leaves_out"):
        return ()
    try:
        problem.check_fresh()
        names: Sequence[str] = method.leaves_out(problem)
        return names if names and method.accepts(problem) is None else ()
    except WholebodyError:
        return ()


def solve(problem: Problem, method: str | Method = "qp", progress: Progress | None = None) -> Solution:
    """Find a posture that solves a problem.

    Ctrl-C ends the solve with the best posture so far, whose status is then "stalled".

    Args:
        problem: to be solved.
        method: "qp", "ccd", "newton", "placo", "dls", or a configured method such as
            `QP(solver="daqp", time_limit=0.1)`.
        progress: called after every iteration with its entry of the trace (see `TraceEntry`); the solve ends if it
            returns True.

    Returns:
        The posture with its status and the independent assessment. Goals out of reach and starts in penetration are
        answers, not errors.

    Raises:
        UnknownNameError: there is no such method.
        InputError: the scene changed after the problem was made, or the method cannot take some of its terms.

    Examples:
        >>> wb.solve(problem, method="qp").status
        'solved'
    """
    check_problem(problem, "solve: problem")
    progress = function(progress, "progress")
    solution = warn_of_left_out(as_method(method), 2, problem).solve(problem, progress)
    _warn_if_nothing_holds(problem, solution)
    return solution


def _warn_if_nothing_holds(problem: Problem, solution: Solution) -> None:
    """Warn if the goals were met by carrying the whole figure to them, since nothing holds it."""
    figure = problem.scene.figure
    if not figure.roots or not problem.goals or problem.stated or problem.bounds:
        return
    if any(term.touching for term in problem.goals):
        return
    moved = solution.q - problem.start
    places = {name: int(figure.model.joints[joint].idx_q) for name, joint in figure.roots.items()}
    flown, root = max((float(np.linalg.norm(moved[q : q + 3])), name) for name, q in places.items())
    # m: a root that moved farther than this was carried to the goals; a person who bends moves it less
    if flown > 0.3:
        warnings.warn(
            f"nothing holds the figure: its root moved {flown:.2f} m to meet the goals; add "
            f"wb.Stand(on=..., feet=...), wb.Hold(...) of what stands, or wb.Freeze({root!r})",
            stacklevel=3,
        )
