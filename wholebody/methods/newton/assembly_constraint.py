"""Constraints of users' own classes in assemblies."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.checks import listed, shown, text
from wholebody.base.errors import InputError
from wholebody.methods.newton.batches import Batch

STEP = 1e-6  # m and parts of a quaternion: of the central differences that a derivative is compared with
WRONG = 1e-3  # largest deviation from the differences, relative to the largest entry of the row, or 1


class AssemblyConstraint(ABC):
    """Equations, or inequalities, between bodies of a `wholebody.Assembly`: one small class a type.

    The bodies are rows of an array (b, 7), in the order of `bodies`: the origin r [m] and the quaternion e = (x, y, z,
    w). During an iteration e may deviate from unit length, so write rotations as polynomials of e, or normalise it, and
    differentiate what you wrote. `wholebody.methods.newton.quaternions` has rotations and their derivatives.

    Attributes:
        bodies: names of the bodies.
        one_sided: False for residual = 0, True for residual >= 0.
    """

    bodies: tuple[str, ...]
    one_sided: bool = False

    @abstractmethod
    def residual(self, x: Array) -> Array:
        """(m,) at the bodies x (b, 7); metres and radians, or what is of the same order."""

    @abstractmethod
    def jacobian(self, x: Array) -> Array:
        """(m, b, 7) its derivative by the bodies."""

    def curvature(self, x: Array, force: Array) -> Array:
        """(b, 7, b, 7) second derivative of force (m,) times residual; only `solve(nearest=True)` needs it.

        Raises:
            InputError: the class does not write it.
        """
        raise InputError(f"{type(self).__name__} has no second derivatives; write curvature, or leave nearest out")


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

    def curvature(self, x: Array, force: Array) -> Array:  # noqa: D102
        pair = x[self.bodies[0]]
        found = np.asarray(self.term.curvature(pair, force[0]), dtype=float)
        shape = (len(pair), 7, len(pair), 7)
        return _finite(found, shape, self.labels[0], "curvature").reshape(1, 7 * len(pair), -1)


def checked(term: AssemblyConstraint, x: Array, label: str) -> int:
    """How many rows a constraint has, after its derivative was compared with differences at the bodies x (b, 7).

    Raises:
        InputError: a value of the wrong shape, one that is not finite, or a derivative that is wrong.
    """
    first = np.asarray(term.residual(x.copy()), dtype=float)
    if first.ndim != 1 or not len(first):
        raise InputError(f"{label}: residual has shape {first.shape}; return m values, shape (m,)")
    _finite(first, first.shape, label, "residual")
    slope = _finite(np.asarray(term.jacobian(x.copy()), dtype=float), (len(first), *x.shape), label, "jacobian")
    for body in range(len(x)):
        for k in range(7):
            plus, minus = x.copy(), x.copy()
            plus[body, k] += STEP
            minus[body, k] -= STEP
            difference = (np.asarray(term.residual(plus)) - np.asarray(term.residual(minus))) / (2.0 * STEP)
            scale = WRONG * np.maximum(np.abs(slope).max(axis=(1, 2)), 1.0)
            wrong = np.flatnonzero(~(np.abs(slope[:, body, k] - difference) <= scale))
            if len(wrong):
                row = int(wrong[0])
                raise InputError(
                    f"{label}: jacobian[{row}, {body}, {k}] is {slope[row, body, k]:.6g}, and central differences of "
                    f"residual give {difference[row]:.6g}; correct the derivative"
                )
    return len(first)


def names_of(term: AssemblyConstraint, label: str) -> list[str]:
    """The names of a constraint's bodies.

    Raises:
        InputError: there are none, or one is twice in the list.
    """
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
