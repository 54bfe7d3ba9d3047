"""Rows of terms that have no equations of bodies here: users' goals and constraints, and sums of squares."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.checks import listed, shown, text
from wholebody.base.errors import InputError, TermError
from wholebody.figures.self_pairs import random_postures
from wholebody.figures.state import State
from wholebody.methods.newton.batches import Batch
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.tasks.base import Constraint, Goal, Measure
from wholebody.tasks.checks import defined
from wholebody.terms.plan import checked_count

_Function = tuple[Callable[[State], Array], Callable[[State], Array]]
"""Values (m,) and derivatives (m, nv) at a state."""


class TangentRows(Batch):
    """Rows sign (value(posture) - bound) of all bodies of a figure."""

    def __init__(
        self, bodies: FigureBodies, label: str, function: _Function, chosen: Indices, sign: Array, bound: Array,
        depends: Mask | None = None,
    ) -> None:  # fmt: skip
        """Take a function, and its rows `chosen` (size,); `depends` (size, nv) on degrees of freedom, None for all."""
        super().__init__(bodies.first + np.arange(bodies.count)[None], [label])
        self._figure, (self._value, self._slope) = bodies, function
        self.chosen, self.sign, self.bound = chosen, sign, bound
        self.size = len(chosen)
        if depends is None:
            depends = np.ones((self.size, bodies.model.nv), dtype=bool)
        self.pattern = depends @ bodies.chart.pattern

    def count_from(self, q: Array | None) -> None:
        """Count the values from those at the posture q (nq,), or from zero."""
        self.bound = np.zeros(self.size) if q is None else self._value(self._figure.state_of(q))[self.chosen]

    def residual(self, x: Array) -> Array:  # noqa: D102
        value = np.atleast_1d(self._value(self._figure.state_at(x)))[self.chosen]
        result: Array = (self.sign * (value - self.bound))[None]
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        rows = self._slope(self._figure.state_at(x))[self.chosen]
        result: Array = (self.sign[:, None] * (rows @ self._figure.chart.rows(x)))[None]
        return result


def goal_rows(bodies: FigureBodies, goal: Goal, label: str, depends: Mask | None = None) -> TangentRows:
    """Rows of a goal: its error; `depends` as in `TangentRows`."""
    error = np.atleast_1d(goal.error(bodies.start_state))
    return TangentRows(
        bodies, label, _of_rows(goal, goal.error, len(error)),
        np.arange(len(error)), np.ones(len(error)), np.zeros(len(error)), depends,
    )  # fmt: skip


def square_rows(bodies: FigureBodies, measure: Measure, label: str) -> TangentRows | None:
    """Rows of the residuals whose squares a measure is the sum of, with its weight; None if it is no such sum."""
    root = math.sqrt(measure.weight)

    def squares(state: State) -> tuple[Array, Array]:
        found = measure.squares(state)
        if found is None:
            raise TermError(measure, label, "it has squares at one posture and none at another; give them at all")
        checked_count(measure, len(found[0]), count)
        return root * found[0], root * found[1]

    first = measure.squares(bodies.start_state)
    if first is None:
        return None
    count = len(first[0])
    postures = random_postures(bodies.model, 3, seed=1)
    seen = [squares(state)[1] != 0.0 for state in defined(measure, map(bodies.state_of, postures))]
    depends = np.any(seen, axis=0) if seen else np.ones((count, bodies.model.nv), dtype=bool)
    return TangentRows(
        bodies, label, (lambda state: squares(state)[0], lambda state: squares(state)[1]), np.arange(count),
        np.ones(count), np.zeros(count), depends,
    )  # fmt: skip


def _of_rows(term: Goal | Constraint, ask: Callable[[State], Array], count: int) -> _Function:
    """Values and derivatives of a term, which has as many rows at all postures as at the start."""

    def value(state: State) -> Array:
        found = np.atleast_1d(ask(state))
        checked_count(term, len(found), count)
        return found

    def slope(state: State) -> Array:
        found = state.dense_jacobian(term.jacobian(state))
        checked_count(term, len(found), count)
        return found

    return value, slope


def constraint_rows(
    bodies: FigureBodies, term: Constraint, label: str
) -> tuple[TangentRows | None, TangentRows | None]:
    """Rows of a constraint that are equalities, and those that must be at least zero; None if there are none."""
    size = np.atleast_1d(term.value(bodies.start_state)).shape
    lower, upper = np.broadcast_to(term.lower, size), np.broadcast_to(term.upper, size)
    equal = np.flatnonzero(lower == upper)
    above = np.flatnonzero((lower != upper) & np.isfinite(lower))
    below = np.flatnonzero((lower != upper) & np.isfinite(upper))

    def rows(chosen: Indices, sign: Array, bound: Array) -> TangentRows | None:
        if not len(chosen):
            return None
        return TangentRows(bodies, label, _of_rows(term, term.value, size[0]), chosen, sign, bound)

    sides = np.concatenate([np.ones(len(above)), -np.ones(len(below))])
    return (
        rows(equal, np.ones(len(equal)), lower[equal]),
        rows(np.concatenate([above, below]), sides, np.concatenate([lower[above], upper[below]])),
    )


class AssemblyConstraint(ABC):
    """Equations, or inequalities, between bodies of a `wholebody.Assembly`: one small class a type.

    The bodies are rows of an array (b, 7), in the order of `bodies`: the origin r [m] and the quaternion e = (x, y, z,
    w). During an iteration e may deviate from unit length, so write rotations as polynomials of e, or normalise it, and
    differentiate what you wrote. `wholebody.methods.newton.quaternions` has rotations and their derivatives.

    Attributes:
        bodies: names of the bodies.
        one_sided: False for residual = 0, True for residual >= 0.

    Examples:
        >>> class Level(wb.methods.AssemblyConstraint):
        ...     bodies = ("ball",)
        ...     def residual(self, x):
        ...         return x[:, 2] - 1.0
        ...     def jacobian(self, x):
        ...         return np.eye(1, 7, 2)[None]
        >>> answer = wb.Assembly().body("ball").constrain(Level()).solve()
        >>> answer.placements["ball"].translation.round(6).tolist()
        [0.0, 0.0, 1.0]
    """

    bodies: tuple[str, ...]
    one_sided: bool = False

    @abstractmethod
    def residual(self, x: Array) -> Array:
        """(m,) at the bodies x (b, 7); metres and radians, or what is of the same order."""

    @abstractmethod
    def jacobian(self, x: Array) -> Array:
        """(m, b, 7) its derivative by the bodies."""


class OwnRows(Batch):
    """The rows of one constraint of a user's class."""

    def __init__(self, bodies: Indices, label: str, term: AssemblyConstraint, size: int) -> None:
        """Take the bodies (1, b), and how many rows the term has."""
        super().__init__(bodies, [label])
        self.term, self.size = term, size
        self.pattern = np.ones((size, 7 * bodies.shape[1]), dtype=bool)

    def residual(self, x: Array) -> Array:  # noqa: D102
        found = np.asarray(self.term.residual(x[self.bodies[0]]), dtype=float)
        return _finite(found, (self.size,), self.labels[0], "residual")[None]

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        pair = x[self.bodies[0]]
        found = np.asarray(self.term.jacobian(pair), dtype=float)
        return _finite(found, (self.size, len(pair), 7), self.labels[0], "jacobian").reshape(1, self.size, -1)


def checked(term: AssemblyConstraint, x: Array, label: str) -> int:
    """How many rows a constraint has, after its derivative was compared with differences at the bodies x (b, 7)."""
    first = np.asarray(term.residual(x.copy()), dtype=float)
    if first.ndim != 1 or not len(first):
        raise InputError(f"{label}: residual has shape {first.shape}; return m values, shape (m,)")
    _finite(first, first.shape, label, "residual")
    slope = _finite(np.asarray(term.jacobian(x.copy()), dtype=float), (len(first), *x.shape), label, "jacobian")
    scale = 1e-3 * np.maximum(np.abs(slope).max(axis=(1, 2)), 1.0)
    for body in range(len(x)):
        for k in range(7):
            plus, minus = x.copy(), x.copy()
            plus[body, k] += 1e-6
            minus[body, k] -= 1e-6
            difference = (np.asarray(term.residual(plus)) - np.asarray(term.residual(minus))) / 2e-6
            wrong = np.flatnonzero(~(np.abs(slope[:, body, k] - difference) <= scale))
            if len(wrong):
                row = int(wrong[0])
                raise InputError(
                    f"{label}: jacobian[{row}, {body}, {k}] is {slope[row, body, k]:.6g}, and central differences of "
                    f"residual give {difference[row]:.6g}; correct the derivative"
                )
    return len(first)


def names_of(term: AssemblyConstraint, label: str) -> list[str]:
    """The names of a constraint's bodies."""
    given = getattr(term, "bodies", ())
    names = [text(name, f"{label}: a name in bodies") for name in listed(given, f"{label}: bodies", "('crank',)")]
    if not names or len(set(names)) < len(names):
        raise InputError(f"{label}: bodies is {shown(given)}; name at least one body, and each once")
    return names


def _finite(found: Array, shape: tuple[int, ...], label: str, what: str) -> Array:
    if found.shape != shape:
        raise InputError(f"{label}: {what} has shape {found.shape}; return shape {shape}")
    if not np.isfinite(found).all():
        raise InputError(f"{label}: {what} is not finite; return finite numbers near the bodies' placements too")
    return found


def quadratic_model(measures: Iterable[Measure], state: State) -> tuple[Array, Array]:
    """Gradient (nv,) and diagonal curvature (nv,) of the sum of measures with their weights."""
    gradient, curvature = np.zeros(state.model.nv), np.zeros(state.model.nv)
    for term in measures:
        gradient += term.weight * term.gradient(state)
        curvature += term.weight * term.curvature(state)
    return gradient, curvature
