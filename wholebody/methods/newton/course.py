"""What a Newton iteration moves through: equations that may change on the way."""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array
from wholebody.methods.control import Control
from wholebody.methods.newton.linear_algebra.base import LinearAlgebra
from wholebody.methods.newton.system import System


class Course:
    """Equations that stay as they are; others derive from it.

    Attributes:
        system: the equations.
        algebra: for the system's pattern.
        longest: metres that any part of a body may move in a step.
        control: what may end the iteration.
    """

    longest = np.inf
    control = Control(np.inf)

    def __init__(self, system: System, algebra: LinearAlgebra) -> None:
        """Take equations that do not change."""
        self.system, self.algebra = system, algebra

    def retract(self, x: Array) -> Array:
        """The variables (7 n,) after a step, put in order."""
        return unit(x)

    def runs_into(self) -> bool:
        """Whether the last retraction ran into something new; then it is an equation now, and the step is made anew."""
        return False

    def passes(self) -> bool:
        """Whether the way to the last retraction is free; if not, the step is shortened."""
        return True

    def arrive(self, x: Array) -> bool:
        """Renew the equations at x, where a step ended; whether their number or pattern changed."""
        return False


def unit(x: Array) -> Array:
    """Copy of the variables (7 n,) with Euler parameters of unit length."""
    bodies = x.reshape(-1, 7).copy()
    bodies[:, 3:] /= np.sqrt((bodies[:, 3:] ** 2).sum(axis=1, keepdims=True))
    result: Array = bodies.ravel()
    return result
