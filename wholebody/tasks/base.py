"""What every goal, constraint, bound and measure has in common.

A term is immutable and knows its figure only by names. `resolve` turns the names into indices and fills in what
depends on the posture at the start; methods and the assessment use the resolved copy.

All derivatives are taken with respect to the tangent displacement dq of the posture, ``pin.integrate(model, q, dq)``,
of shape (nv,). A Jacobian is either dense, or a `Wrench` when its rows are wrenches between two joints: all wrenches of
a problem then cost one matrix product.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from wholebody.arrays import Array, Mask
from wholebody.figures.state import State, Wrench

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure


_T = TypeVar("_T")


class Surroundings(Protocol):
    """What a term needs to know of a scene."""

    @property
    def figure(self) -> Figure:
        """What moves."""

    @property
    def model(self) -> Any:
        """Its pin.Model."""

    @property
    def geometry(self) -> Any:
        """The pin.GeometryModel with all pieces."""


def filled(term: _T, **values: object) -> _T:
    """Copy of an immutable term with some of its fields set."""
    result = copy.copy(term)
    for name, value in values.items():
        object.__setattr__(result, name, value)
    return result


class Term:
    """Anything that can be asked of a posture."""

    def resolve(self: _T, scene: Surroundings, start: Array) -> _T:
        """Copy of the term that is ready to be evaluated on the scene.

        Args:
            scene: the figure and what stands around it.
            start: (nq,) posture that the problem starts from.

        Raises:
            UnknownNameError: the term names a frame, joint or group that the figure does not have.
            InputError: a value does not fit the figure.
        """
        return self


class Goal(Term, ABC):
    """Something to reach: an equality, met if it can be."""

    @property
    def weight(self) -> float:
        """Positive factor on the squared error [1/m^2 or 1/rad^2]; says which goal gives way when two conflict."""
        return 1.0

    @property
    def angular(self) -> Mask:
        """(m,) which rows are in radians, the others being in metres; a single value holds for all rows."""
        return np.zeros((), dtype=bool)

    @abstractmethod
    def error(self, state: State) -> Array:
        """(m,) what is left to do, in metres and radians; zero when the goal is met."""

    @abstractmethod
    def jacobian(self, state: State) -> Wrench | Array:
        """Derivative of the error: a `Wrench` of m rows or an array (m, nv)."""


class Constraint(Term, ABC):
    """Something that must hold always: ``lower <= value(state) <= upper``."""

    @property
    def lower(self) -> Array:
        """(m,) least allowed values, or one for all rows; -inf where there is none. The default asks for value >= 0."""
        return np.zeros(())

    @property
    def upper(self) -> Array:
        """(m,) greatest allowed values, or one for all rows; inf where there is none, `lower` for an equality."""
        return np.full((), np.inf)

    @property
    def angular(self) -> Mask:
        """(m,) which rows are in radians, the others being in metres; a single value holds for all rows."""
        return np.zeros((), dtype=bool)

    @abstractmethod
    def value(self, state: State) -> Array:
        """(m,) constrained values, in metres and radians."""

    @abstractmethod
    def jacobian(self, state: State) -> Wrench | Array:
        """Derivative of the value: a `Wrench` of m rows or an array (m, nv)."""


class Bound(Term, ABC):
    """Least and greatest displacement of every degree of freedom."""

    @abstractmethod
    def bounds(self, state: State, dt: float | None) -> tuple[Array, Array]:
        """Bounds on the tangent displacement from this state.

        Args:
            state: where the figure is.
            dt: length of the step in seconds, or None when a whole solve is not tied to time.

        Returns:
            Lower and upper bounds, each (nv,), in radians and metres; -inf and inf where there is none.
        """


class Measure(Term, ABC):
    """Something to minimise. Value, gradient and curvature come without the weight; the problem multiplies by it."""

    @property
    def weight(self) -> float:
        """Positive factor on the value, in 1/(unit of the value)."""
        return 1.0

    @abstractmethod
    def value(self, state: State) -> float:
        """The measure itself."""

    @abstractmethod
    def gradient(self, state: State) -> Array:
        """(nv,) derivative of the value."""

    def curvature(self, state: State) -> Array:
        """(nv,) positive diagonal that stands for the second derivative."""
        return np.ones(state.model.nv)
