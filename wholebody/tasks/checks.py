"""Checks of users' terms: shapes of rows that fit together, and finite numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.errors import InputError
from wholebody.figures.state import State, Wrench
from wholebody.tasks.base import Measure


def check_rows(where: str, term: object, values: Any, jacobian: Any, state: State) -> None:
    """Check the values and Jacobian of a goal or constraint.

    Args:
        where: its place, such as "goals[1]".
        term: the term.
        values: the return value of its `error` or `value`.
        jacobian: the return value of its `jacobian`.
        state: the state at which it was evaluated.

    Raises:
        InputError: shapes that do not fit, or a value that is not finite.
    """
    name = f"{where} ({type(term).__name__})"
    values = np.atleast_1d(np.asarray(values, dtype=float))
    if values.ndim != 1:
        raise InputError(f"{name} has values of shape {values.shape}; return one row of numbers, shape (m,)")
    rows = np.asarray(jacobian.rows if isinstance(jacobian, Wrench) else jacobian, dtype=float)
    wanted = (len(values), 6 if isinstance(jacobian, Wrench) else state.model.nv)
    if rows.shape != wanted:
        kind = "wrench rows" if isinstance(jacobian, Wrench) else "a Jacobian"
        raise InputError(f"{name} has {len(values)} values and {kind} of shape {rows.shape}; give shape {wanted}")
    if not (np.isfinite(values).all() and np.isfinite(rows).all()):
        raise InputError(f"{name} is not finite at the start; its formula must give finite numbers at every posture")


def check_measure(where: str, measure: Measure, state: State) -> None:
    """Check the value, gradient and curvature of a measure at a state.

    Raises:
        InputError: shapes that do not fit, a value that is not finite, or a negative curvature.
    """
    name = f"{where} ({type(measure).__name__})"
    gradient, curvature = np.asarray(measure.gradient(state)), np.asarray(measure.curvature(state))
    wanted = (state.model.nv,)
    if gradient.shape != wanted or curvature.shape != wanted:
        raise InputError(
            f"{name} has a gradient {gradient.shape} and a curvature {curvature.shape}; give shape {wanted}"
        )
    if not (np.isfinite(measure.value(state)) and np.isfinite(gradient).all() and np.isfinite(curvature).all()):
        raise InputError(f"{name} is not finite at the start; its formula must give finite numbers at every posture")
    if (curvature < 0.0).any():
        raise InputError(f"{name} has a negative curvature; give a diagonal that is zero or more")
