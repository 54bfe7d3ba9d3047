"""Equations of bodies, all of one type together: residuals, Jacobians and second derivatives as arrays.

A body has seven variables: its position r [m] and its Euler parameters e. Bodies are rows of an array (N + 1, 7) whose
last row is the world, which does not move. Each batch has k groups of `size` equations between one or two bodies.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.errors import InputError
from wholebody.methods.newton import quaternions as quat

PLACE, TURN = slice(0, 3), slice(3, 7)
OTHER_PLACE, OTHER_TURN = slice(7, 10), slice(10, 14)


OBJECTIVE = "objective"
"""Kind of batches whose squares are minimised; their equations need not hold."""


class Key(NamedTuple):
    """Type of a batch, whether it is a goal or an inequality, and its weight."""

    kind: str
    goal: bool
    one_sided: bool
    weight: float


HARD, ONE_SIDED = Key("", False, False, 1.0), Key("", False, True, 1.0)


class Batch(ABC):
    """Equations of one type.

    Attributes:
        bodies: (k, b) indices of the bodies of each equation group; b is 1 or 2.
        size: rows of each group.
        pattern: (size, 7 b) structural non-zeros of the Jacobian.
        labels: (k,) names of the groups in messages.
        half_sines: whether the norm of a group is twice the sine of half the angle that is left, not a distance.

    Residual and Jacobian at the same array of bodies share their work, so do not change such an array in place.
    """

    size: int
    pattern: Mask
    half_sines = False

    def __init__(self, bodies: Indices, labels: list[str]) -> None:
        self.bodies = np.asarray(bodies, dtype=np.intp)
        self.labels = labels
        self._seen: tuple[Array, Array, Array] | None = None

    def __len__(self) -> int:
        """Number of equation groups."""
        return len(self.bodies)

    @abstractmethod
    def residual(self, x: Array) -> Array:
        """(k, size) residuals at the bodies x (N + 1, 7); metres and radians."""

    @abstractmethod
    def jacobian(self, x: Array) -> Array:
        """(k, size, 7 b) derivative of the residual."""

    def curvature(self, x: Array, force: Array) -> Array:
        """(k, 7 b, 7 b) second derivative of the sum over rows of force (k, size) times residual.

        Raises:
            InputError: this type has none; assemblies use only types that have one.
        """
        raise InputError(f"{self.labels[0]}: it has no second derivatives; leave the nearest place out")


class Unit(Batch):
    """Euler parameters of unit length: (e.e - 1) / 2 = 0."""

    size = 1
    pattern = np.array([[False] * 3 + [True] * 4])

    def residual(self, x: Array) -> Array:  # noqa: D102
        e = x[self.bodies[:, 0], 3:]
        result: Array = 0.5 * ((e * e).sum(axis=1, keepdims=True) - 1.0)
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        result = np.zeros((len(self), 1, 7))
        result[:, 0, TURN] = x[self.bodies[:, 0], 3:]
        return result

    def curvature(self, x: Array, force: Array) -> Array:  # noqa: D102
        result = np.zeros((len(self), 7, 7))
        result[:, TURN, TURN] = force[:, :, None] * np.eye(4)
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
        self.size = directions.shape[1]
        self.directions, self.height = directions, height
        self.pattern = np.ones((self.size, 14), dtype=bool)
        if self.size == 3 and bool((directions == np.eye(3)).all()):
            self.pattern[:, PLACE] = self.pattern[:, OTHER_PLACE] = np.eye(3, dtype=bool)
        # n . R(e) c = e' Q e / 2 for either body, with the sign of its side
        k = len(self)
        along = directions.reshape(-1, 3)
        self._forms = np.empty((k, self.size, 2, 4, 4))
        for side, point, sign in ((0, first, 2.0), (1, second, -2.0)):
            forms = quat.rotate_form(np.repeat(point, self.size, axis=0), along)
            self._forms[:, :, side] = sign * forms.reshape(k, self.size, 4, 4)
        self._sides = np.concatenate([directions, -directions], axis=2).reshape(k, self.size, 2, 3)

    def _slopes(self, x: Array) -> tuple[Array, Array]:
        """The two bodies (k, 2, 7), and the derivatives (k, size, 2, 4) by their quaternions."""
        if self._seen is None or self._seen[0] is not x:
            pair = x[self.bodies]
            self._seen = (x, pair, np.einsum("kisab,ksb->kisa", self._forms, pair[:, :, 3:]))
        return self._seen[1], self._seen[2]

    def residual(self, x: Array) -> Array:  # noqa: D102
        pair, slopes = self._slopes(x)
        result: Array = np.einsum("kisa,ksa->ki", self._sides, pair[:, :, :3])
        result += 0.5 * np.einsum("kisa,ksa->ki", slopes, pair[:, :, 3:])
        result -= self.height
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        result = np.empty((len(self), self.size, 2, 7))
        result[..., :3] = self._sides
        result[..., 3:] = self._slopes(x)[1]
        return result.reshape(len(self), self.size, 14)

    def curvature(self, x: Array, force: Array) -> Array:  # noqa: D102
        result = np.zeros((len(self), 14, 14))
        forms = np.einsum("ki,kisab->ksab", force, self._forms)
        result[:, TURN, TURN] = forms[:, 0]
        result[:, OTHER_TURN, OTHER_TURN] = forms[:, 1]
        return result


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

    def _right(self, x: Array) -> Array:
        """Derivative (k, size, 4) by the first quaternion."""
        if self._seen is None or self._seen[0] is not x:
            right = np.einsum("kiab,kb->kia", self.forms, x[self.bodies[:, 1], 3:])
            self._seen = (x, right, right)
        return self._seen[1]

    def residual(self, x: Array) -> Array:  # noqa: D102
        result: Array = np.einsum("kia,ka->ki", self._right(x), x[self.bodies[:, 0], 3:])
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        result = np.zeros((len(self), self.size, 14))
        result[:, :, TURN] = self._right(x)
        result[:, :, OTHER_TURN] = np.einsum("ka,kiab->kib", x[self.bodies[:, 0], 3:], self.forms)
        return result

    def curvature(self, x: Array, force: Array) -> Array:  # noqa: D102
        result = np.zeros((len(self), 14, 14))
        mixed = np.einsum("ki,kiab->kab", force, self.forms)
        result[:, TURN, OTHER_TURN] = mixed
        result[:, OTHER_TURN, TURN] = mixed.transpose(0, 2, 1)
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
        way = b[:, :3] + quat.rotate(b[:, 3:], self.points) - a[:, :3]
        return turn, normals, way

    def residual(self, x: Array) -> Array:  # noqa: D102
        _, normals, way = self._parts(x)
        result: Array = (normals @ way[:, :, None])[..., 0] - self.height
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        turn, normals, way = self._parts(x)
        k, m = self.normals.shape[:2]
        result = np.empty((k, m, 14))
        result[:, :, PLACE] = -normals
        result[:, :, OTHER_PLACE] = normals
        change = quat.rotate_derivative(turn, self.normals.reshape(-1, 3)).reshape(k, m, 3, 4)
        result[:, :, TURN] = (way[:, None, None, :] @ change)[:, :, 0]
        result[:, :, OTHER_TURN] = normals @ quat.rotate_derivative(x[self.bodies[:, 1], 3:], self.points)
        return result

    def curvature(self, x: Array, force: Array) -> Array:  # noqa: D102
        _, normals, way = self._parts(x)
        first = np.einsum("ki,kij->kj", force, self.normals)
        push = np.einsum("ki,kij->kj", force, normals)
        change = quat.rotate_derivative(x[self.bodies[:, 0], 3:], first)  # (k, 3, 4)
        other = quat.rotate_derivative(x[self.bodies[:, 1], 3:], self.points)
        result = np.zeros((len(self), 14, 14))
        result[:, TURN, TURN] = 2.0 * quat.rotate_form(first, way)
        result[:, OTHER_TURN, OTHER_TURN] = 2.0 * quat.rotate_form(self.points, push)
        result[:, OTHER_PLACE, TURN] = change
        result[:, PLACE, TURN] = -change
        result[:, OTHER_TURN, TURN] = other.transpose(0, 2, 1) @ change
        upper = result[:, TURN, :].copy()
        for block in (PLACE, OTHER_PLACE, OTHER_TURN):
            upper[:, :, block] = result[:, block, TURN].transpose(0, 2, 1)
        result[:, TURN, :] = upper
        return result


class MassCenter(Batch):
    """The centre of mass along directions: n . sum_j s_j (r_j + R_j c_j) - h = 0, with s_j the bodies' shares of mass.

    One group of equations of all bodies with mass. As an inequality it keeps the centre of mass above a polygon.
    """

    def __init__(
        self, bodies: Indices, labels: list[str], shares: Array, centers: Array, directions: Array, height: Array
    ) -> None:
        """Take bodies (1, b), shares (b,), centers (b, 3) in the bodies, directions (m, 3) and heights (m,) [m]."""
        super().__init__(bodies, labels)
        self.size = len(directions)
        self.shares, self.centers, self.directions, self.height = shares, centers, directions, height
        along = (directions != 0.0)[:, None, :].repeat(bodies.shape[1], axis=1)
        self.pattern = np.concatenate([along, np.ones((*along.shape[:2], 4), dtype=bool)], axis=2).reshape(
            self.size, -1
        )

    def residual(self, x: Array) -> Array:  # noqa: D102
        pair = x[self.bodies[0]]
        center = self.shares @ (pair[:, PLACE] + quat.rotate(pair[:, TURN], self.centers))
        result: Array = (self.directions @ center - self.height)[None]
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        turns = x[self.bodies[0]][:, TURN]
        result = np.empty((1, self.size, len(turns), 7))
        result[0, :, :, PLACE] = self.directions[:, None, :] * self.shares[:, None]
        slopes = self.shares[:, None, None] * quat.rotate_derivative(turns, self.centers)  # (b, 3, 4)
        result[0, :, :, TURN] = np.einsum("mi,bij->mbj", self.directions, slopes)
        return result.reshape(1, self.size, -1)


class RootMotion(Batch):
    """Displacement of a free root from a posture, in its own axes there, less a target; linear in the body.

    Three rows are R_a' (r - r_a), three are 2 vec(conj(e_a) e). At r = r_a and e = e_a their derivative is that of
    Pinocchio's tangent displacement.
    """

    size = 6
    pattern = np.zeros((6, 7), dtype=bool)
    pattern[:3, PLACE] = pattern[3:, TURN] = True

    def __init__(self, body: int, label: str) -> None:
        """Take the number of the root's body; `anchor` says from where it moves."""
        super().__init__(np.array([[body]]), [label])
        self._place, self._target, self._slope = np.zeros(3), np.zeros(6), np.zeros((6, 7))

    def anchor(self, root: Array, target: Array) -> None:
        """Count from the root's placement (7,), position and quaternion x, y, z, w, towards a displacement (6,)."""
        a, b, c, w = root[3:].tolist()
        self._place, self._target = root[:3].copy(), target
        self._slope[:3, PLACE] = pin.Quaternion(root[3:]).toRotationMatrix().T
        self._slope[3:, TURN] = 2.0 * np.array(((w, c, -b, -a), (-c, w, a, -b), (b, -a, w, -c)))

    def residual(self, x: Array) -> Array:  # noqa: D102
        body = x[self.bodies[0, 0]]
        turned = self._slope[3:, TURN] @ body[TURN]
        moved = self._slope[:3, PLACE] @ (body[PLACE] - self._place)
        result: Array = np.concatenate([moved, turned])[None] - self._target
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        result: Array = self._slope[None].copy()
        return result

    def curvature(self, x: Array, force: Array) -> Array:  # noqa: D102
        return np.zeros((1, 7, 7))
