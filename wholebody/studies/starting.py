"""Starts of problems at the answers of others."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.problem import Problem
from wholebody.tasks.bounds import Freeze


def begun_at(problem: Problem, q: Array) -> Problem:
    """Return a problem that begins at the answer (nq,) of another one; what is frozen stays at its own start."""
    model = problem.scene.model
    away = np.asarray(pin.difference(model, problem.start, q))
    for bound in problem.bounds:
        if isinstance(bound, Freeze):
            away[problem.scene.figure.dofs(bound.joints)] = 0.0
    return problem.with_start(np.asarray(pin.integrate(model, problem.start, away)))


def warmed(method: Any) -> Any:
    """Return the method without starts of its own and the search that goes with them, where these are its settings."""
    settings = {one.name for one in fields(type(method)) if one.init} if is_dataclass(type(method)) else set()
    if "restarts" not in settings:
        return method
    try:
        return replace(method, **dict.fromkeys(settings & {"restarts", "budget"}, 0))
    except Exception:  # a method of the user's own may refuse them
        return method
