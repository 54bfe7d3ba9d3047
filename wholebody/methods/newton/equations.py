"""Collection of equations one by one, which are then batched by type."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array
from wholebody.methods.newton.batches import HARD, ONE_SIDED, Angle, Batch, Coincide, Role, Slide, Turn, Unit
from wholebody.methods.newton.quaternions import axes_with_z, relative_forms


class Row(NamedTuple):
    """One group of equations: its bodies (-1 is the world), its label and its parameters."""

    first: int
    second: int
    label: str
    numbers: tuple[Any, ...]


class EquationSet:
    """Groups of equations by type, and by what they are for."""

    def __init__(self) -> None:
        self._rows: dict[tuple[str, Role], list[Row]] = {}
        self._made: list[Batch] = []

    def add(self, batch: Batch, role: Role) -> None:
        """Add a batch of its own."""
        batch.role = role
        self._made.append(batch)

    def coincide(self, a: int, b: int, label: str, first: Array, second: Array, role: Role = HARD) -> None:
        """A point (3,) of one body coincides with a point of the other."""
        self._add("coincide", role, a, b, label, first, second)

    def turn(self, a: int, b: int, label: str, first: Any, second: Any, size: int, role: Role = HARD) -> None:
        """Axes (pin.Quaternion) of two bodies agree: in z (size 2) or in all axes (size 3)."""
        self._add(f"turn{size}", role, a, b, label, first.coeffs(), second.coeffs())

    def slide(
        self, a: int, b: int, label: str, normals: Array, place: Array, heights: ArrayLike, role: Role = HARD
    ) -> None:
        """A point (3,) of the second body in planes of the first with normals (m, 3) or (3,), or above them."""
        normals = np.atleast_2d(normals)
        self._add(f"slide{len(normals)}", role, a, b, label, normals, place, np.atleast_1d(heights))

    def limit(self, a: int, b: int, label: str, first: Any, second: Any, low: float, high: float) -> None:
        """The angle about z of two axes (pin.Quaternion) stays between bounds, which may be infinite."""
        center = 0.5 * (low + high) if np.isfinite(low + high) else 0.0
        for bound, sign in ((low, 1.0), (high, -1.0)):
            if np.isfinite(bound):
                self._add("angle", ONE_SIDED, a, b, label, first.coeffs(), second.coeffs(), center, bound, sign)

    def angle(
        self, a: int, b: int, label: str, axes: tuple[Array, Array], center: float, value: float, role: Role
    ) -> None:
        """The angle about z of two axes (quaternions), chosen nearest to the center, has a value."""
        self._add("angle", role, a, b, label, *axes, center, value, 1.0)

    def batches(self) -> list[Batch]:
        """The groups in batches."""
        listed = []
        for (kind, role), rows in self._rows.items():
            batch = _batch(kind, rows)
            batch.role = role
            listed.append(batch)
        return [*listed, *self._made]

    def _add(self, kind: str, role: Role, a: int, b: int, label: str, *numbers: Any) -> None:
        self._rows.setdefault((kind, role), []).append(Row(a, b, label, numbers))


def unit_lengths(names: list[str]) -> Batch:
    """Euler parameters of unit length, of all bodies with these names."""
    labels = [f"the Euler parameters of {name!r}" for name in names]
    return Unit(np.arange(len(names))[:, None], labels)


def _batch(kind: str, rows: list[Row]) -> Batch:
    bodies = np.array([(row.first, row.second) for row in rows], dtype=np.intp)
    labels = [row.label for row in rows]
    columns = [np.array(column, dtype=float) for column in zip(*(row.numbers for row in rows), strict=True)]
    k = len(rows)
    if kind == "coincide":
        axes = np.broadcast_to(np.eye(3), (k, 3, 3))
        return Coincide(bodies, labels, columns[0], columns[1], axes, np.zeros((k, 3)))
    if kind.startswith("slide"):
        return Slide(bodies, labels, *columns)
    forms = relative_forms(columns[0], columns[1])
    if kind == "angle":
        return Angle(bodies, labels, forms[:, 2:], columns[2], columns[3], columns[4])
    return Turn(bodies, labels, 2.0 * forms[:, : int(kind[-1])])


def axes_along(direction: Array) -> Any:
    """Axes (pin.Quaternion) whose z axis is a unit direction (3,)."""
    return pin.Quaternion(axes_with_z(direction[None])[0])
