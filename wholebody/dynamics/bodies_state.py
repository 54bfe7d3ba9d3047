"""Where bodies are and how they move, as arrays."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.dynamics import motion_kernel
from wholebody.dynamics.pieces import Pieces
from wholebody.scene.scene import Scene


class BodiesState:
    """Positions and velocities of all bodies.

    Attributes:
        pieces: the bodies and their pieces.
        position: (n, 3) centres of mass.
        rotation: (n, 3, 3).
        twist: (n, 6) velocities of the centres and angular velocities along the world's axes, m/s and rad/s.
        velocity: (n, 3) view of the former.
        spin: (n, 3) view of the latter.
        given: (n,) bodies whose motion is given for this frame.
        moving: (n,) bodies that move by themselves, and do not sleep.
        inverse: (n, 3, 3) inverse inertias in the body.
    """

    def __init__(self, scene: Scene, pieces: Pieces) -> None:
        """Put all bodies where the scene has them, with the velocities of their `wb.Body`."""
        count = len(pieces.names)
        self.pieces = pieces
        self.position, self.rotation = np.zeros((count, 3)), np.zeros((count, 3, 3))
        self.twist = np.zeros((count, 6))
        self.velocity, self.spin = self.twist[:, :3], self.twist[:, 3:]
        self.given: Mask = np.zeros(count, dtype=bool)
        self.moving: Mask = pieces.dynamic.copy()
        self.inverse: Array = np.linalg.inv(pieces.inertia).astype(np.float64)
        for name, number in pieces.index.items():
            self.put(number, pieces.placement[name])
            thing = scene.objects.get(name)
            if thing is not None and thing.body is not None:
                self.velocity[number], self.spin[number] = thing.body.velocity, thing.body.angular_velocity

    def put(self, number: int, at: pin.SE3) -> None:
        """Place a body."""
        self.rotation[number] = at.rotation
        self.position[number] = at.translation + at.rotation @ self.pieces.centre[number]

    def placement(self, number: int) -> pin.SE3:
        """Where a body is."""
        rotation = self.rotation[number]
        return pin.SE3(rotation.copy(), self.position[number] - rotation @ self.pieces.centre[number])

    def give(self, number: int, before: pin.SE3, after: pin.SE3, time: float) -> None:
        """Let a body move from one placement to another within a time, at constant velocity and angular velocity."""
        self.put(number, before)
        centre = self.pieces.centre[number]
        way = after.translation + after.rotation @ centre - self.position[number]
        self.velocity[number] = way / time
        self.spin[number] = pin.log3(after.rotation @ before.rotation.T) / time
        self.given[number] = bool(self.velocity[number].any() or self.spin[number].any())

    def copies(self) -> tuple[Array, Array, Array]:
        """Copies of positions, rotations and velocities."""
        return self.position.copy(), self.rotation.copy(), self.twist.copy()

    def restore(self, kept: tuple[Array, Array, Array]) -> None:
        """Go back to what `copies` gave."""
        self.position[:], self.rotation[:], self.twist[:] = kept

    def between(self, kept: tuple[Array, Array, Array], share: float) -> None:
        """Go to where a share of the way from what `copies` gave has been covered; the velocities stay."""
        for number in np.flatnonzero(self.moving | self.given):
            turn = pin.log3(self.rotation[number] @ kept[1][number].T)
            self.rotation[number] = pin.exp3(share * turn) @ kept[1][number]
        self.position[:] = kept[0] + share * (self.position - kept[0])

    def local(self, body: Indices, point: Array) -> Array:
        """Points (m, 3) in the axes of bodies (m,), from their centres of mass."""
        return np.asarray(np.einsum("cij,ci->cj", self.rotation[body], point - self.position[body]))

    def inverse_inertia(self, of: Mask) -> Array:
        """Inverse inertias (n, 3, 3) along the world's axes; zero but for the bodies `of`."""
        found = np.zeros_like(self.inverse)
        motion_kernel.world_inverses(self.rotation, self.inverse, of, found)
        return found

    def energy(self, gravity: Array) -> float:
        """Kinetic and potential energy of the bodies that move by themselves, joules."""
        free = self.pieces.dynamic
        return self._kinetic(free) - float((self.pieces.mass[free] * (self.position[free] @ gravity)).sum())

    def slow(self, bodies: Mask, energy: float) -> None:
        """Take an energy [J] from the velocities of bodies (n,), or all that they have."""
        kinetic = self._kinetic(bodies)
        self.twist[bodies] *= np.sqrt(1.0 - energy / kinetic) if energy < kinetic else 0.0

    def _kinetic(self, bodies: Mask) -> float:
        mass = self.pieces.mass[bodies]
        local = np.einsum("bij,bi->bj", self.rotation[bodies], self.spin[bodies])
        turning = np.einsum("bi,bij,bj->b", local, self.pieces.inertia[bodies], local)
        return 0.5 * float((mass * (self.velocity[bodies] ** 2).sum(axis=1) + turning).sum())

    def momentum(self) -> Array:
        """Momentum [kg m/s] and angular momentum about the world's origin [kg m2/s], (6,), of the same bodies."""
        free = self.pieces.dynamic
        linear = self.pieces.mass[free, None] * self.velocity[free]
        turned = self.rotation[free]
        local = np.einsum("bij,bi->bj", turned, self.spin[free])
        own = np.einsum("bij,bjk,bk->bi", turned, self.pieces.inertia[free], local)
        return np.concatenate([linear.sum(axis=0), (np.cross(self.position[free], linear) + own).sum(axis=0)])
