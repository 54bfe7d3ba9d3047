"""Joints between bodies, as points that stay together.

A ball joint is one point, a hinge two points on its axis, as far apart as they hinder each other least. The program of
a step holds them (`step_program`) so that they are together at its end. After a step the velocities are made to keep
them together (as RATTLE does; Andersen, 1983), which only takes energy.
"""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.dynamics import rows_kernel, solve_kernel
from wholebody.dynamics.bodies_state import BodiesState
from wholebody.dynamics.pieces import Pieces
from wholebody.dynamics.rows_kernel import JointPoints, Rows
from wholebody.dynamics.solve_kernel import Laws, Limits
from wholebody.scene.matter.body import BallJoint, Hinge
from wholebody.scene.scene import Scene


class Joints:
    """All joints of a scene, as points."""

    def __init__(self, scene: Scene, pieces: Pieces) -> None:
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
        self.points = JointPoints(
            np.array(bodies, dtype=np.intp).reshape(-1, 2), np.array(anchors, dtype=float).reshape(-1, 2, 3),
            np.array(world, dtype=bool),
        )  # fmt: skip
        self._island = np.empty(len(pieces.names), dtype=np.intp)
        solve_kernel.join(np.arange(len(self)), self.points.bodies, pieces.dynamic, self._island)

    def _points(self, number: int, joint: BallJoint) -> list[Array]:
        at = np.array(joint.at)
        if not isinstance(joint, Hinge):
            return [at]
        axis, inertia = np.array(joint.axis), self._pieces.inertia[number]
        across = 0.5 * (float(np.trace(inertia)) - float(axis @ inertia @ axis))
        far = max(float(np.sqrt(across / self._pieces.mass[number])), 1e-3)  # m
        return [at - far * axis, at + far * axis]

    def __len__(self) -> int:
        return len(self.points.bodies)

    def linked(self, number: int) -> Mask:
        """Bodies (n,) that move by themselves and are linked with one by joints, itself among them."""
        found: Mask = self._pieces.dynamic & (self._island == self._island[number])
        return found

    def together(self) -> Indices:
        """(k, 2) bodies that joints hold together, one of which moves by itself at least."""
        return self.points.bodies[~self.points.world]

    def gaps(self, state: BodiesState) -> Array:
        """(j, 3) point of B seen from that of A, metres."""
        found = np.empty((len(self), 3))
        rows_kernel.joint_gaps(self.points, state.bodies, found)
        return found

    def project_velocities(self, state: BodiesState, twist: Array, movable: Mask) -> None:
        """Change velocities (n, 6) by impulses of the joints on movable bodies, so that all points stay together."""
        count = len(self)
        if count:
            rows = Rows.room(self.points.bodies, count, movable)
            rows_kernel.joint_rows(self.points, state.bodies, rows)
            laws = Laws(np.zeros(0), np.zeros(0), np.zeros((count, 3)))
            limits = Limits(1e-9 * solve_kernel.JOINT_PRECISION, 2000)  # m/s
            solve_kernel.solve(np.arange(count), rows, laws, twist, np.zeros((count, 3)), limits)
