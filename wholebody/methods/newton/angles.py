"""Angles of revolute joints: limits, goals and measures."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.methods.newton.batches import OTHER_TURN, TURN, Batch


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
        self._parts: tuple[Array, tuple[Array, Array, Array]] | None = None

    def _components(self, x: Array) -> tuple[Array, Array, Array]:
        """Components (k, 2) z and w, and their derivatives by either quaternion, (k, 2, 4)."""
        if self._parts is not None and self._parts[0] is x:
            return self._parts[1]
        first, second = x[self.bodies[:, 0], 3:], x[self.bodies[:, 1], 3:]
        right = np.einsum("kiab,kb->kia", self.forms, second)
        left = np.einsum("ka,kiab->kib", first, self.forms)
        parts = np.einsum("kia,ka->ki", right, first), right, left
        self._parts = (x, parts)
        return parts

    def angle(self, x: Array) -> Array:
        """(k,) the angles [rad]."""
        part = self._components(x)[0]
        angle = 2.0 * np.arctan2(part[:, 0], part[:, 1])
        result: Array = angle - 2.0 * np.pi * np.round((angle - self.center) / (2.0 * np.pi))
        return result

    def residual(self, x: Array) -> Array:  # noqa: D102
        result: Array = (self.sign * (self.angle(x) - self.bound))[:, None]
        return result

    def _gradients(self, x: Array) -> tuple[Array, Array, Array]:
        part, right, left = self._components(x)
        gradient = np.zeros((len(self), 2, 14))
        gradient[:, :, TURN], gradient[:, :, OTHER_TURN] = right, left
        square = np.maximum((part * part).sum(axis=1), 1e-12)
        return part, gradient, square

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        part, gradient, square = self._gradients(x)
        row = part[:, 1:] * gradient[:, 0] - part[:, :1] * gradient[:, 1]
        result: Array = (2.0 * self.sign / square)[:, None, None] * row[:, None, :]
        return result

    def curvature(self, x: Array, force: Array) -> Array:  # noqa: D102
        part, gradient, square = self._gradients(x)
        mixed = part[:, 1, None, None] * self.forms[:, 0] - part[:, 0, None, None] * self.forms[:, 1]
        second = np.zeros((len(self), 14, 14))
        second[:, TURN, OTHER_TURN] = mixed
        second[:, OTHER_TURN, TURN] = mixed.transpose(0, 2, 1)
        s, c = gradient[:, 0], gradient[:, 1]
        row = part[:, 1:] * s - part[:, :1] * c
        second += s[:, :, None] * c[:, None, :] - c[:, :, None] * s[:, None, :]
        radial = part[:, :1] * s + part[:, 1:] * c
        second -= (2.0 / square)[:, None, None] * row[:, :, None] * radial[:, None, :]
        result: Array = (2.0 * self.sign * force[:, 0] / square)[:, None, None] * second
        return result
