"""Joints between bodies, as points that stay together.

A ball joint is one point, a hinge two points on its axis, as far apart as they hinder each other least. The program of
a step holds them (`step_program`) so that they are together at its end. After a step the velocities are made to keep
them together (as RATTLE does; Andersen, 1983), which only takes energy.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.dynamics import contact_kernel, joint_kernel, solve_kernel
from wholebody.dynamics.bodies_state import BodiesState
from wholebody.dynamics.pieces import Pieces
from wholebody.scene.matter.body import BallJoint, Hinge
from wholebody.scene.scene import Scene

CLOSED = 1e-9  # m: by which joint points may be apart at the end of a step
KEPT = 1e-9  # m/s: to which velocities keep joints
SWEEPS = 2000  # of joints alone
VISITS = 100_000  # likewise, joint points times sweeps
SHORTEST_AXIS = 1e-3  # m: between the two points of a hinge


class JointRows(NamedTuple):
    """What the program needs of joints; see `joint_kernel.write_rows`."""

    jacobian: Array
    response: Array
    mobility: Array
    effective_mass: Array


class Joints:
    """All joints of a scene.

    Attributes:
        bodies: (j, 2) A and B of each joint point; twice B for a joint to the world.
        jointed: (n,) bodies that have a joint.
    """

    def __init__(self, scene: Scene, pieces: Pieces) -> None:
        """Join what the scene's bodies say, where they stand."""
        self._pieces = pieces
        bodies, anchors, world = [], [], []
        for number in np.flatnonzero(pieces.dynamic).tolist():
            name = pieces.names[number]
            body = scene.objects[name].body
            for joint in () if body is None else body.joints:
                other = number if joint.to is None else pieces.index[joint.to]
                for point in self._points(number, joint):
                    place = pieces.placement[name].act(point)
                    if joint.to is not None:
                        centre = pieces.centre[other]
                        place = pieces.placement[pieces.names[other]].actInv(place) - centre
                    bodies.append((other, number))
                    anchors.append((place, point - pieces.centre[number]))
                    world.append(joint.to is None)
        self.bodies: Indices = np.array(bodies, dtype=np.intp).reshape(-1, 2)
        self._anchor = np.array(anchors, dtype=float).reshape(-1, 2, 3)
        self._world: Mask = np.array(world, dtype=bool)
        self.jointed: Mask = np.zeros(len(pieces.names), dtype=bool)
        self.jointed[self.bodies] = True
        self._island = np.empty(len(pieces.names), dtype=np.intp)
        contact_kernel.join(
            np.arange(len(self.bodies)), self.bodies, pieces.dynamic, self._island
        )  # fmt: skip

    def _points(self, number: int, joint: BallJoint) -> list[Array]:
        """Points of a joint in the thing's axes."""
        at = np.array(joint.at)
        if not isinstance(joint, Hinge):
            return [at]
        axis, inertia = np.array(joint.axis), self._pieces.inertia[number]
        across = 0.5 * (float(np.trace(inertia)) - float(axis @ inertia @ axis))
        far = max(float(np.sqrt(across / self._pieces.mass[number])), SHORTEST_AXIS)
        return [at - far * axis, at + far * axis]

    def __len__(self) -> int:
        """How many joint points there are."""
        return len(self.bodies)

    def linked(self, number: int) -> Mask:
        """Bodies (n,) that move by themselves and are linked with one by joints, itself among them."""
        found: Mask = self._pieces.dynamic & (self._island == self._island[number])
        return found

    def together(self) -> Indices:
        """(k, 2) bodies that joints hold together, one of which moves by itself at least."""
        return self.bodies[~self._world]

    def gaps(self, state: BodiesState) -> Array:
        """(j, 3) point of B seen from that of A, metres."""
        return self._place(state)[1]

    def _place(self, state: BodiesState) -> tuple[Array, Array]:
        lever, off = np.empty((len(self), 2, 3)), np.empty((len(self), 3))
        joint_kernel.place(self.bodies, self._anchor, self._world, state.position, state.rotation, lever, off)
        return lever, off

    def write_rows(self, state: BodiesState, movable: Mask, rows: JointRows) -> None:
        """Write the rows of all joint points; `movable` (n,) are the bodies that joints move."""
        inverse_mass = np.where(movable, 1.0 / state.pieces.mass, 0.0)
        lever = self._place(state)[0]
        joint_kernel.write_rows(
            self.bodies, self._world, lever, inverse_mass, state.inverse_inertia(movable), *rows
        )  # fmt: skip

    def project_velocities(self, state: BodiesState, twist: Array, movable: Mask) -> None:
        """Change velocities (n, 6) by impulses of the joints, so that all joint points stay together."""
        count = len(self)
        if not count:
            return
        rows = JointRows(
            np.empty((count, 3, 2, 6)), np.empty((count, 3, 2, 6)), np.empty((count, 2)), np.empty((count, 3, 3))
        )
        self.write_rows(state, movable, rows)
        none = np.zeros(0)
        solve_kernel.solve(
            np.arange(count), self.bodies, rows.jacobian, rows.response, rows.mobility, none, none, rows.effective_mass,
            np.zeros((count, 3)), twist, np.zeros((count, 3)), KEPT * solve_kernel.JOINT_PRECISION, VISITS, SWEEPS,
        )  # fmt: skip
