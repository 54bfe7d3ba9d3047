"""Collection of equations one by one, which are then batched by type."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array
from wholebody.base.records import with_values
from wholebody.methods.newton.angles import Angle
from wholebody.methods.newton.batches import Batch, Coincide, Key, Slide, Turn, Unit
from wholebody.methods.newton.quaternions import axes_with_z, relative_forms


class Row(NamedTuple):
    """One group of equations: its bodies (-1 is the world), its label and its parameters."""

    first: int
    second: int
    label: str
    numbers: tuple[Any, ...]


class EquationSet:
    """Groups of equations by type, and by whether they are goals or inequalities."""

    def __init__(self) -> None:
        self.rows: dict[Key, list[Row]] = {}
        self.made: list[tuple[Callable[[int], Batch], Key]] = []

    def add(
        self,
        make: Callable[[int], Batch],
        kind: str,
        *,
        goal: bool = False,
        one_sided: bool = False,
        weight: float = 1.0,
    ) -> None:
        """Add a separate batch, which is made when the index of the world among the bodies is known."""
        self.made.append((make, Key(kind, goal, one_sided, weight)))

    def coincide(
        self, a: int, b: int, label: str, first: Array, second: Array, *, goal: bool = False, weight: float = 1.0
    ) -> None:
        """A point (3,) of one body coincides with a point of the other."""
        self._add(Key("coincide", goal, False, weight), a, b, label, first, second)

    def turn(
        self, a: int, b: int, label: str, first: Any, second: Any, size: int, *, goal: bool = False, weight: float = 1.0
    ) -> None:
        """Axes (pin.Quaternion) of two bodies agree: in z (size 2) or in all axes (size 3)."""
        self._add(Key(f"turn{size}", goal, False, weight), a, b, label, first.coeffs(), second.coeffs())

    def slide(
        self,
        a: int,
        b: int,
        label: str,
        normals: Array,
        place: Array,
        heights: ArrayLike,
        *,
        above: bool = False,
        goal: bool = False,
        weight: float = 1.0,
    ) -> None:
        """A point (3,) of the second body in planes of the first with normals (m, 3) or (3,), or above them."""
        normals = np.atleast_2d(normals)
        self._add(Key(f"slide{len(normals)}", goal, above, weight), a, b, label, normals, place, np.atleast_1d(heights))

    def limit(self, a: int, b: int, label: str, first: Any, second: Any, low: float, high: float) -> None:
        """The angle about z of two axes (pin.Quaternion) stays between bounds, which may be infinite."""
        center = 0.5 * (low + high) if np.isfinite(low + high) else 0.0
        for bound, sign in ((low, 1.0), (high, -1.0)):
            if np.isfinite(bound):
                parts = (first.coeffs(), second.coeffs(), center, bound, sign)
                self._add(Key("angle", False, True, 1.0), a, b, label, *parts)

    def angle(
        self, a: int, b: int, label: str, first: Any, second: Any, center: float, value: float, weight: float
    ) -> None:
        """A goal: the angle about z of two axes (pin.Quaternion), chosen nearest to the center, has a value."""
        parts = (first.coeffs(), second.coeffs(), center, value, 1.0)
        self._add(Key("angle", True, False, weight), a, b, label, *parts)

    def yielding(self) -> EquationSet:
        """A copy whose equalities are goals."""
        result = EquationSet()
        for key, rows in self.rows.items():
            result.rows.setdefault(with_values(key, goal=not key.one_sided), []).extend(rows)
        result.made = [(make, with_values(key, goal=not key.one_sided)) for make, key in self.made]
        return result

    def batches(self, count: int) -> list[tuple[Batch, Key]]:
        """The groups of `count` bodies in batches."""
        listed = [(_batch(key.kind, rows, count), key) for key, rows in self.rows.items()]
        return [*listed, *((make(count), key) for make, key in self.made)]

    def _add(self, key: Key, a: int, b: int, label: str, *numbers: Any) -> None:
        self.rows.setdefault(key, []).append(Row(a, b, label, numbers))


def unit_lengths(names: list[str]) -> tuple[Batch, Key]:
    """Euler parameters of unit length, of all bodies with these names."""
    labels = [f"the Euler parameters of {name!r}" for name in names]
    return Unit(np.arange(len(names))[:, None], labels), Key("unit", False, False, 1.0)


def _batch(kind: str, rows: list[Row], count: int) -> Batch:
    bodies = np.array([(row.first, row.second) for row in rows], dtype=np.intp)
    bodies[bodies < 0] = count
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
