"""A random posture moved onto equalities: feet on their places, two hands on one bar.

Newton's method on the equalities alone, with the shortest step in every turn (Ben-Israel 1966, "A Newton-Raphson method
for the solution of systems of equations"). It knows neither contacts nor measures, so it favours no method that is
compared; whoever calls it asks afterwards whether the posture is free.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array, Indices
from wholebody.figures.state import State, Wrench


class MassAbove(wb.Goal):
    """The centre of mass above a place on the floor."""

    def __init__(self, place: Array) -> None:
        """Keep the place (2,) in metres."""
        self.place = np.array(place)

    def error(self, state: State) -> Array:
        """(2,) from the place [m]."""
        return np.asarray(state.center_of_mass()[:2] - self.place)

    def jacobian(self, state: State) -> Array:
        """(2, nv)."""
        return state.center_of_mass_jacobian()[:2]


class Held(wb.Goal):
    """A constraint without slack as an equality."""

    def __init__(self, hold: wb.Hold) -> None:
        """Keep a hold that is resolved."""
        self.hold = hold

    def error(self, state: State) -> Array:
        """(m,) difference from where it is held [m, rad]."""
        return self.hold.value(state)

    def jacobian(self, state: State) -> Wrench:
        """Rows of the hold."""
        return self.hold.jacobian(state)


def held(problem: wb.Problem) -> list[wb.Goal]:
    """The holds of a problem as equalities."""
    return [Held(term) for term in problem.constraints if isinstance(term, wb.Hold)]


def fitted(figure: wb.Figure, q: Array, goals: Sequence[wb.Goal], dofs: Indices) -> Array | None:
    """Return the posture (nq,) that Newton's method finds from q, or None where it finds none within the limits.

    Args:
        figure: whose posture.
        q: (nq,) where to begin.
        goals: the equalities, resolved.
        dofs: places in the tangent of what may move.
    """
    model, state = figure.model, _state(figure)
    for _ in range(25):
        state.update(q)
        error = np.concatenate([goal.error(state) for goal in goals])
        if np.abs(error).max() < 1e-10:  # m, rad
            return q
        rows = np.vstack([state.dense_jacobian(goal.jacobian(state)) for goal in goals])
        step = _shortest(rows, -error, dofs, *figure.tangent_bounds(q))
        # Farther away than half a radian or metre the rows are no longer true.
        step *= min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-300))
        q = figure.clamp(pin.integrate(model, q, step))
    return None


@lru_cache(maxsize=8)
def _state(figure: wb.Figure) -> State:
    """One for all postures of a figure: making it takes as long as twenty turns."""
    return State(figure.model)


def _shortest(rows: Array, wanted: Array, dofs: Indices, lower: Array, upper: Array) -> Array:
    """Step (nv,) of the given degrees of freedom that does what is wanted; those that would leave their limits stop.

    1e-9 keeps the step finite where rows depend on each other.
    """
    step = np.zeros(rows.shape[1])
    left = dofs
    while len(left):
        part = rows[:, left]
        rest = step.copy()
        rest[left] = 0.0
        step[left] = part.T @ np.linalg.solve(part @ part.T + 1e-9 * np.eye(len(rows)), wanted - rows @ rest)
        beyond = (step[left] < lower[left]) | (step[left] > upper[left])
        if not beyond.any():
            break
        stopped = left[beyond]
        step[stopped] = np.clip(step[stopped], lower[stopped], upper[stopped])
        left = left[~beyond]
    return step
