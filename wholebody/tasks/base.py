"""Base classes of goals, constraints, bounds and measures.

A term is immutable and refers to its figure only by names. `resolve` returns a copy in which the names are indices and
values that depend on the start are filled in; methods and the assessment use the resolved copy.

All derivatives are taken with respect to the tangent displacement dq of the posture, ``pin.integrate(model, q, dq)``,
of shape (nv,). A Jacobian is either dense, or a `Wrench` when its rows are wrenches between two joints: all wrenches of
a problem then cost one matrix product.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.fields import Checked
from wholebody.figures.state import State, Wrench
from wholebody.scene.scene import Scene
from wholebody.tasks import answers

_T = TypeVar("_T")

MOST_PLANES = 1 << 16  # more than one term ever has


def filled(term: _T, **values: object) -> _T:
    """Copy of an immutable term with some of its fields set."""
    result: _T = object.__new__(type(term))
    own = vars(result)
    own.update(vars(term))
    own.update(values)
    return result


class SupportingPlanes(NamedTuple):
    """Inequalities ``value <= 0`` about a posture."""

    value: Array  # (k,) [m]
    jacobian: Array  # (k, nv) their derivative
    key: Indices  # (k,) numbers that name a plane from one posture to the next, each less than `MOST_PLANES`
    # (b, nv) rows b with the second derivatives of the term's rows as sums of b' b, where they are positive
    bend: Array
    bend_row: Indices  # (b,) the row of the term that a bend is of


class Term(Checked):
    """Base of goals, constraints, bounds and measures.

    Raises:
        InputError: a value of the wrong kind or out of range; it names the term, the argument and what it takes.
        UnknownNameError: in a problem, a name that its scene does not have.

    Examples:
        >>> isinstance(wb.Point("left_palm", (0.4, 0.2, 1.0)), wb.tasks.Term)
        True
    """

    _answered: ClassVar[Mapping[str, answers.Check]] = {}

    def __init_subclass__(cls, **given: Any) -> None:
        """Have the answers of a class of one's own checked at every call."""
        super().__init_subclass__(**given)
        answers.check_answers(cls, cls._answered)

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute; the answers of a method that is set on an object are checked too."""
        if name in self._answered and callable(value):
            value = answers.Checked(self, name, value, self._answered[name])
        object.__setattr__(self, name, value)

    @property
    def touching(self) -> tuple[tuple[str, str], ...]:
        """Pairs of segments and things that the term brings together: their clearance is zero; once resolved."""
        return ()

    def resolve(self: _T, scene: Scene, start: Array) -> _T:
        """Copy of the term that is ready to be evaluated on the scene; `start` (nq,) is that of the problem."""
        return self

    def value_and_jacobian(self, state: State, value: Callable[[State], Array]) -> tuple[Array, Wrench | Array]:
        """Value and Jacobian; a term whose values and derivatives come from one computation overrides this."""
        return value(state), self.jacobian(state)  # type: ignore[attr-defined]


class Rows(Term, ABC):
    """Base of goals and constraints: a term with rows."""

    @property
    def angular(self) -> Mask:
        """(m,) which rows are in radians, the others being in metres; a single value holds for all rows."""
        return np.zeros((), dtype=bool)

    def supporting_planes(self, state: State) -> SupportingPlanes | None:
        """Inequalities that hold wherever the term is met, and that its own rows do not tell of to first order.

        A row with kinks, such as the distance to a thing with edges, has one derivative on each side of a kink. The
        planes on both sides of it say where the kink is. None, as here, for smooth rows.
        """
        return None

    @abstractmethod
    def jacobian(self, state: State) -> Wrench | Array:
        """Derivative of the error or value: a `Wrench` of m rows or an array (m, nv)."""


class Goal(Rows):
    """An equality that is met if possible: ``error(state) = 0``.

    Examples:
        >>> class Height(wb.Goal):
        ...     def error(self, state):
        ...         return state.center_of_mass()[2:] - 0.9
        ...     def jacobian(self, state):
        ...         return state.center_of_mass_jacobian()[2:]
        >>> wb.solve(wb.Problem(scene, goals=[Height()])).status
        'solved'
    """

    _answered: ClassVar[Mapping[str, answers.Check]] = {
        "error": answers.values,
        "jacobian": answers.rows,
        "weight": answers.weight,
        "angular": answers.mask,
    }

    @property
    def weight(self) -> float:
        """Positive factor on the squared error [1/m^2 or 1/rad^2]; it decides which of two goals gives way."""
        return 1.0

    @abstractmethod
    def error(self, state: State) -> Array:
        """(m,) remaining error, in metres and radians; zero when the goal is met."""


class Constraint(Rows):
    """An equality or inequality that always holds: ``lower <= value(state) <= upper``.

    Examples:
        >>> class Low(wb.Constraint):  # keeps the centre of mass below 1.2 m
        ...     def value(self, state):
        ...         return 1.2 - state.center_of_mass()[2:]
        ...     def jacobian(self, state):
        ...         return -state.center_of_mass_jacobian()[2:]
        >>> bool(wb.check_derivatives(Low(), scene))
        True
    """

    _answered: ClassVar[Mapping[str, answers.Check]] = {
        "value": answers.values,
        "jacobian": answers.rows,
        "lower": answers.limit,
        "upper": answers.limit,
        "angular": answers.mask,
    }

    @property
    def lower(self) -> Array:
        """(m,) least allowed values, or one for all rows; -inf for no bound. The default requires value >= 0."""
        return np.zeros(())

    @property
    def upper(self) -> Array:
        """(m,) greatest allowed values, or one for all rows; inf for no bound, `lower` for an equality."""
        return np.full((), np.inf)

    @abstractmethod
    def value(self, state: State) -> Array:
        """(m,) constrained values, in metres and radians."""


class GoalOrConstraint(Goal, Constraint):
    """A goal that holds always where it stands among the constraints: its error is zero. It has no weight there."""

    upper = np.zeros(())

    def value(self, state: State) -> Array:
        """(m,) the error."""
        return self.error(state)


class ComputedTogether(Constraint):
    """Base of constraints whose values (m,) and rows (m, nv) come from one computation, `value_and_jacobian`."""

    def value(self, state: State) -> Array:
        """(m,) the values."""
        return self.value_and_jacobian(state, self.value)[0]

    def jacobian(self, state: State) -> Array:
        """(m, nv) their derivative."""
        rows: Any = self.value_and_jacobian(state, self.value)[1]
        return np.asarray(rows)


class Bound(Term, ABC):
    """Least and greatest displacement of every degree of freedom.

    Examples:
        docs/extending.md describes own terms.

        >>> class Slow(wb.tasks.Bound):
        ...     def bounds(self, state, dt):
        ...         return np.full(state.model.nv, -0.1), np.full(state.model.nv, 0.1)
    """

    _answered: ClassVar[Mapping[str, answers.Check]] = {"bounds": answers.sides}

    @abstractmethod
    def bounds(self, state: State, dt: float | None) -> tuple[Array, Array]:
        """Bounds on the tangent displacement from this state.

        Args:
            state: the present state.
            dt: time step in seconds, or None for a whole solve, which has no time step.

        Returns:
            Lower and upper bounds, each (nv,), in radians and metres; -inf and inf for no bound.
        """


class Expansion(NamedTuple):
    """A measure about a state: its value, gradient (nv,), curvature (nv,), and rows R (k, nv) where it has squares."""

    value: float
    gradient: Array
    curvature: Array
    rows: Array | None


class Measure(Term, ABC):
    """A cost to minimise. Value, gradient and curvature are without the weight; the problem multiplies them by it.

    Examples:
        >>> class Low(wb.Measure):
        ...     weight = 1.0
        ...     def value(self, state):
        ...         return float(state.center_of_mass()[2])
        ...     def gradient(self, state):
        ...         return state.center_of_mass_jacobian()[2]
        >>> bool(wb.check_derivatives(Low(), scene))
        True
    """

    _answered: ClassVar[Mapping[str, answers.Check]] = {
        "value": answers.one,
        "gradient": answers.freedoms,
        "curvature": answers.diagonal,
        "squares": answers.squares,
        "weight": answers.weight,
    }

    @property
    def weight(self) -> float:
        """Positive factor on the value, in 1/(unit of the value)."""
        return 1.0

    @abstractmethod
    def value(self, state: State) -> float:
        """The value of the measure."""

    @abstractmethod
    def gradient(self, state: State) -> Array:
        """(nv,) derivative of the value."""

    def curvature(self, state: State) -> Array:
        """(nv,) positive diagonal that approximates the second derivative."""
        return np.ones(state.model.nv)

    def squares(self, state: State) -> tuple[Array, Array] | None:
        """The value as a sum of squares: residuals r (k,) and their derivatives R (k, nv), always as many.

        None, as here, where `curvature` says all. A diagonal that bounds ``2 R' R`` makes steps short where joints move
        together; methods that take rows use the rows in its place (Gauss and Newton), the others use the diagonal.
        """
        return None

    def expansion(self, state: State) -> Expansion:
        """All of these at once."""
        squares = self.squares(state)
        rows = None if squares is None else squares[1]
        return Expansion(self.value(state), self.gradient(state), self.curvature(state), rows)
