"""Equations of bodies, all of one type together: residuals and Jacobians as arrays.

A body has seven variables: its position r [m] and its Euler parameters e. Bodies are rows of an array (N + 1, 7) whose
last row is the world, with the index -1. A batch has k groups of `size` equations between one or two bodies.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.quaternions import relative_forms

PLACE, TURN = slice(0, 3), slice(3, 7)
OTHER_PLACE, OTHER_TURN = slice(7, 10), slice(10, 14)


def with_world(x: Array) -> Array:
    """The variables (7 n,) as bodies (n + 1, 7), the world last."""
    return np.concatenate([x, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)]).reshape(-1, 7)


class Role(NamedTuple):
    """What equations are for: weighted goals, residuals >= 0 if `one_sided`, or squares that are minimised."""

    weight: float | None = None
    one_sided: bool = False
    objective: bool = False

    @property
    def goal(self) -> bool:
        """Whether they may be violated."""
        return self.weight is not None


HARD, ONE_SIDED, OBJECTIVE = Role(), Role(one_sided=True), Role(objective=True)


class Batch(ABC):
    """Equations of one type.

    Attributes:
        bodies: (k, b) indices of the bodies of each equation group, -1 for the world; b is 1 or 2.
        size: rows of each group.
        pattern: (size, 7 b) structural non-zeros of the Jacobian.
        role, labels: what they are for, and names (k,) of the groups in messages.
        half_sines: whether the norm of a group is twice the sine of half the angle that is left, not a distance.

    Residual and Jacobian at the same array of bodies share their work, so do not change such an array in place.
    """

    size: int
    pattern: Mask
    half_sines = False
    role = HARD

    def __init__(self, bodies: Indices, labels: list[str]) -> None:
        self.bodies = np.asarray(bodies, dtype=np.intp)
        self.labels = labels
        self._seen: tuple[Array, tuple[Array, ...]] = np.zeros(0), ()

    def __len__(self) -> int:
        return len(self.bodies)

    def _shared(self, x: Array) -> tuple[Array, ...]:
        """The `_work` at the bodies x (N + 1, 7), done once."""
        if self._seen[0] is not x:
            self._seen = x, self._work(x)
        return self._seen[1]

    def _work(self, x: Array) -> tuple[Array, ...]:
        """What residual and Jacobian share."""
        return ()

    @property
    def signature(self) -> Hashable:
        """What lays it out: batches alike in it have the same rows and the same pattern."""
        return type(self), self.size, self.bodies.tobytes(), self.role

    @abstractmethod
    def residual(self, x: Array) -> Array:
        """(k, size) residuals at the bodies x (N + 1, 7); metres and radians."""

    @abstractmethod
    def jacobian(self, x: Array) -> Array:
        """(k, size, 7 b) derivative of the residual."""


class Unit(Batch):
    """Euler parameters of unit length, of all bodies with some names: (e.e - 1) / 2 = 0."""

    size = 1
    pattern = np.array([[False] * 3 + [True] * 4])

    def __init__(self, names: list[str]) -> None:
        super().__init__(np.arange(len(names))[:, None], [f"the Euler parameters of {name!r}" for name in names])

    def residual(self, x: Array) -> Array:  # noqa: D102
        e = x[self.bodies[:, 0], 3:]
        result: Array = 0.5 * ((e * e).sum(axis=1, keepdims=True) - 1.0)
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        result = np.zeros((len(self), 1, 7))
        result[:, 0, TURN] = x[self.bodies[:, 0], 3:]
        return result


class Coincide(Batch):
    """Points of two bodies coincide along given directions: n . (r1 + R1 c1 - r2 - R2 c2) - h = 0.

    With the three axes of the world this is the spherical joint and the point goal; with one normal it is the gap of a
    contact, h being the clearance.
    """

    def __init__(
        self, bodies: Indices, labels: list[str], first: Array, second: Array, directions: Array, height: Array
    ) -> None:
        """Take points (k, 3) in each body, directions (k, size, 3) in the world and heights (k, size)."""
        super().__init__(bodies, labels)
        self.size, self.height = directions.shape[1], height
        self.pattern = np.ones((self.size, 14), dtype=bool)
        if self.size == 3 and bool((directions == np.eye(3)).all()):
            self.pattern[:, PLACE] = self.pattern[:, OTHER_PLACE] = np.eye(3, dtype=bool)
        # n . R(e) c = e' Q e / 2 for either body, with the sign of its side
        self._forms = np.empty((len(self), self.size, 2, 4, 4))
        for side, point, sign in ((0, first, 2.0), (1, second, -2.0)):
            forms = quat.rotate_form(np.repeat(point, self.size, axis=0), directions.reshape(-1, 3))
            self._forms[:, :, side] = sign * forms.reshape(-1, self.size, 4, 4)
        self._sides = np.concatenate([directions, -directions], axis=2).reshape(-1, self.size, 2, 3)

    def _work(self, x: Array) -> tuple[Array, ...]:
        """The two bodies (k, 2, 7), and the derivatives (k, size, 2, 4) by their quaternions."""
        pair = x[self.bodies]
        return pair, np.einsum("kisab,ksb->kisa", self._forms, pair[:, :, 3:])

    def residual(self, x: Array) -> Array:  # noqa: D102
        pair, slopes = self._shared(x)
        result: Array = np.einsum("kisa,ksa->ki", self._sides, pair[:, :, :3])
        result += 0.5 * np.einsum("kisa,ksa->ki", slopes, pair[:, :, 3:])
        result -= self.height
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        result = np.empty((len(self), self.size, 2, 7))
        result[..., :3] = self._sides
        result[..., 3:] = self._shared(x)[1]
        return result.reshape(len(self), self.size, 14)


class Turn(Batch):
    """Axes fixed to two bodies agree: rows of 2 conj(e1 f1) (e2 f2), which is bilinear.

    The x and y components vanish if the z axes agree (revolute joint; the opposite direction is no solution),
    all three if all axes agree (fixed and prismatic joint). To first order a row is an angle [rad].
    """

    half_sines = True

    def __init__(self, bodies: Indices, labels: list[str], forms: Array) -> None:
        """Take the bilinear forms (k, size, 4, 4)."""
        super().__init__(bodies, labels)
        self.size = forms.shape[1]
        self.forms = forms
        self.pattern = np.zeros((self.size, 14), dtype=bool)
        self.pattern[:, TURN] = self.pattern[:, OTHER_TURN] = True

    def _work(self, x: Array) -> tuple[Array, ...]:
        """Derivative (k, size, 4) by the first quaternion."""
        return (np.einsum("kiab,kb->kia", self.forms, x[self.bodies[:, 1], 3:]),)

    def residual(self, x: Array) -> Array:  # noqa: D102
        result: Array = np.einsum("kia,ka->ki", self._shared(x)[0], x[self.bodies[:, 0], 3:])
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        result = np.zeros((len(self), self.size, 14))
        result[:, :, TURN] = self._shared(x)[0]
        result[:, :, OTHER_TURN] = np.einsum("ka,kiab->kib", x[self.bodies[:, 0], 3:], self.forms)
        return result


class Slide(Batch):
    """A point of one body in a plane fixed to another: (R1 u) . (r2 + R2 c2 - r1) - h = 0.

    One row is a point on a surface; two, with orientation rows, a prismatic joint.
    """

    def __init__(self, bodies: Indices, labels: list[str], normals: Array, points: Array, height: Array) -> None:
        """Take normals (k, size, 3) in the first body, points (k, 3) in the second and heights (k, size) [m]."""
        super().__init__(bodies, labels)
        self.size = normals.shape[1]
        self.normals, self.points, self.height = normals, points, height
        self.pattern = np.ones((self.size, 14), dtype=bool)

    def _parts(self, x: Array) -> tuple[Array, Array, Array]:
        a, b = x[self.bodies[:, 0]], x[self.bodies[:, 1]]
        k, m = self.normals.shape[:2]
        turn = np.repeat(a[:, 3:], m, axis=0)
        normals = quat.rotate(turn, self.normals.reshape(-1, 3)).reshape(k, m, 3)
        offset = b[:, :3] + quat.rotate(b[:, 3:], self.points) - a[:, :3]
        return turn, normals, offset

    def residual(self, x: Array) -> Array:  # noqa: D102
        _, normals, offset = self._parts(x)
        result: Array = (normals @ offset[:, :, None])[..., 0] - self.height
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        turn, normals, offset = self._parts(x)
        k, m = self.normals.shape[:2]
        result = np.empty((k, m, 14))
        result[:, :, PLACE] = -normals
        result[:, :, OTHER_PLACE] = normals
        change = quat.rotate_derivative(turn, self.normals.reshape(-1, 3)).reshape(k, m, 3, 4)
        result[:, :, TURN] = (offset[:, None, None, :] @ change)[:, :, 0]
        result[:, :, OTHER_TURN] = normals @ quat.rotate_derivative(x[self.bodies[:, 1], 3:], self.points)
        return result


class Angle(Batch):
    """Angle of a revolute joint about z of its axes: sign (2 atan2(z, w) of conj(e1 f1) (e2 f2) - bound).

    As an inequality it is a limit. Multiples of a full turn are chosen so that the angle is nearest to `center`.
    """

    size = 1
    pattern = np.array([([False] * 3 + [True] * 4) * 2])

    def __init__(
        self, bodies: Indices, labels: list[str], forms: Array, center: Array, bound: Array, sign: Array
    ) -> None:
        """Take forms (k, 2, 4, 4) of z and w, and centers, bounds [rad] and signs (k,)."""
        super().__init__(bodies, labels)
        self.forms, self.center, self.bound, self.sign = forms, center, bound, sign

    def _work(self, x: Array) -> tuple[Array, ...]:
        """Components (k, 2) z and w, and their derivatives by either quaternion, (k, 2, 4)."""
        first, second = x[self.bodies[:, 0], 3:], x[self.bodies[:, 1], 3:]
        right, left = np.einsum("kiab,kb->kia", self.forms, second), np.einsum("ka,kiab->kib", first, self.forms)
        return np.einsum("kia,ka->ki", right, first), right, left

    def angle(self, x: Array) -> Array:
        """(k,) the angles [rad]."""
        part = self._shared(x)[0]
        angle = 2.0 * np.arctan2(part[:, 0], part[:, 1])
        result: Array = angle - 2.0 * np.pi * np.round((angle - self.center) / (2.0 * np.pi))
        return result

    def residual(self, x: Array) -> Array:  # noqa: D102
        result: Array = (self.sign * (self.angle(x) - self.bound))[:, None]
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        part, right, left = self._shared(x)
        gradient = np.zeros((len(self), 2, 14))
        gradient[:, :, TURN], gradient[:, :, OTHER_TURN] = right, left
        square = np.maximum((part * part).sum(axis=1), 1e-12)
        row = part[:, 1:] * gradient[:, 0] - part[:, :1] * gradient[:, 1]
        result: Array = (2.0 * self.sign / square)[:, None, None] * row[:, None, :]
        return result


class EquationSet:
    """Groups of equations by type, and by what they are for."""

    def __init__(self) -> None:
        self._rows: dict[tuple[str, Role], list[tuple[Any, ...]]] = {}
        self._made: list[Batch] = []

    def add(self, batch: Batch, role: Role) -> None:
        """Add a batch of its own."""
        batch.role = role
        self._made.append(batch)

    def extend(self, other: EquationSet) -> None:
        """Add all equations of another set."""
        for key, rows in other._rows.items():
            self._rows.setdefault(key, []).extend(rows)
        self._made += other._made

    def coincide(self, a: int, b: int, label: str, first: Array, second: Array, role: Role = HARD) -> None:
        """A point (3,) of one body coincides with a point of the other."""
        self._add("coincide", role, a, b, label, first, second)

    def turn(self, a: int, b: int, label: str, first: Any, second: Any, size: int, role: Role = HARD) -> None:
        """Axes (pin.Quaternion) of two bodies agree: in z (size 2) or in all axes (size 3)."""
        self._add(f"turn{size}", role, a, b, label, first.coeffs(), second.coeffs())

    def place(self, a: int, b: int, label: str, ends: Any, role: Role = HARD, parts: Any = (True, True)) -> None:
        """Two placements (pin.SE3) in two bodies coincide: in position, in all axes, or in both."""
        first, second = ends
        if parts[0]:
            self.coincide(a, b, label, np.array(first.translation), np.array(second.translation), role)
        if parts[1]:
            self.turn(a, b, label, pin.Quaternion(first.rotation), pin.Quaternion(second.rotation), 3, role)

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

    def batches(self) -> list[Batch]:
        """The groups in batches."""
        listed = [_batch(kind, rows) for (kind, _), rows in self._rows.items()]
        for batch, (_, role) in zip(listed, self._rows, strict=True):
            batch.role = role
        return [*listed, *self._made]

    def _add(self, kind: str, role: Role, a: int, b: int, label: str, *numbers: Any) -> None:
        self._rows.setdefault((kind, role), []).append((a, b, label, *numbers))


def _batch(kind: str, rows: list[tuple[Any, ...]]) -> Batch:
    """Groups of one type, each with its two bodies, its label and its parameters."""
    k, bodies, labels = len(rows), np.array([row[:2] for row in rows], dtype=np.intp), [row[2] for row in rows]
    columns = [np.array(column, dtype=float) for column in zip(*(row[3:] for row in rows), strict=True)]
    if kind == "coincide":
        axes = np.broadcast_to(np.eye(3), (k, 3, 3))
        return Coincide(bodies, labels, columns[0], columns[1], axes, np.zeros((k, 3)))
    if kind.startswith("slide"):
        return Slide(bodies, labels, *columns)
    forms = relative_forms(columns[0], columns[1])
    if kind == "angle":
        return Angle(bodies, labels, forms[:, 2:], columns[2], columns[3], columns[4])
    return Turn(bodies, labels, 2.0 * forms[:, : int(kind[-1])])
