"""The centre of mass in full coordinates: linear in the bodies' positions, quadratic in their Euler parameters."""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array, Indices
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.batches import PLACE, TURN, Batch


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
