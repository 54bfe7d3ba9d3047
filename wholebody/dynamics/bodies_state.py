"""Where bodies are and how they move, as arrays, and the joints between them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask, cross
from wholebody.dynamics import motion_kernel, rows_kernel, solve_kernel
from wholebody.dynamics.motion_kernel import Bodies
from wholebody.dynamics.pieces import Pieces
from wholebody.dynamics.rows_kernel import JointPoints, Rows
from wholebody.dynamics.solve_kernel import Laws, Limits
from wholebody.scene.matter.body import BallJoint, Hinge
from wholebody.scene.scene import Scene


class BodiesState:
    """Positions and velocities of all bodies; `velocity` [m/s] and `spin` [rad/s] (n, 3) are views of the twists."""

    def __init__(self, scene: Scene, pieces: Pieces) -> None:
        count = len(pieces.names)
        self.pieces = pieces
        self.bodies = Bodies(
            pieces.mass, pieces.inertia, np.linalg.inv(pieces.inertia).astype(np.float64), np.zeros((count, 3)),
            np.zeros((count, 3, 3)), np.zeros((count, 6)), pieces.dynamic.copy(), np.zeros(count, dtype=bool),
            pieces.jointed,
        )  # fmt: skip
        self.velocity, self.spin = self.bodies.twist[:, :3], self.bodies.twist[:, 3:]
        for name, number in pieces.index.items():
            self.put(number, pieces.placement[name])
            thing = scene.objects.get(name)
            if thing is not None and thing.body is not None:
                self.velocity[number], self.spin[number] = thing.body.velocity, thing.body.angular_velocity

    @property
    def active(self) -> Mask:
        """(n,) bodies that move, by themselves or because their motion is given."""
        return np.asarray(self.bodies.moving | self.bodies.given)

    def put(self, number: int, at: pin.SE3) -> None:
        """Place a body."""
        self.bodies.rotation[number] = at.rotation
        self.bodies.position[number] = at.translation + at.rotation @ self.pieces.centre[number]

    def placement(self, number: int) -> pin.SE3:
        """Where a body is."""
        rotation = self.bodies.rotation[number]
        return pin.SE3(rotation.copy(), self.bodies.position[number] - rotation @ self.pieces.centre[number])

    def give(self, numbers: Indices, placed: Array, time: float) -> None:
        """Let bodies (k,) move between placements (k, 2, 4, 4) in a time, at constant velocity and angular velocity."""
        turned, bodies = placed[:, :, :3, :3], self.bodies
        centres = placed[:, :, :3, 3] + np.einsum("kbij,kj->kbi", turned, self.pieces.centre[numbers])
        turns = turned[:, 1] @ turned[:, 0].transpose(0, 2, 1)
        bodies.rotation[numbers], bodies.position[numbers] = turned[:, 0], centres[:, 0]
        self.velocity[numbers] = (centres[:, 1] - centres[:, 0]) / time
        self.spin[numbers] = rotation_vectors(turns) / time
        bodies.given[numbers] = bodies.twist[numbers].any(axis=1)

    def stop(self, numbers: Indices, at: Array) -> None:
        """Let bodies (k,) stand at placements (k, 4, 4)."""
        self.bodies.rotation[numbers] = at[:, :3, :3]
        self.bodies.position[numbers] = at[:, :3, 3] + np.einsum(
            "kij,kj->ki", at[:, :3, :3], self.pieces.centre[numbers]
        )
        self.bodies.twist[numbers] = 0.0

    def copies(self) -> tuple[Array, Array, Array]:
        """Copies of positions, rotations and velocities."""
        return self.bodies.position.copy(), self.bodies.rotation.copy(), self.bodies.twist.copy()

    def restore(self, kept: tuple[Array, Array, Array]) -> None:
        """Go back to what `copies` gave."""
        self.bodies.position[:], self.bodies.rotation[:], self.bodies.twist[:] = kept

    def local(self, body: Indices, point: Array) -> Array:
        """Points (m, 3) in the axes of bodies (m,), from their centres of mass."""
        return np.asarray(np.einsum("cij,ci->cj", self.bodies.rotation[body], point - self.bodies.position[body]))

    def energy(self, gravity: Array) -> float:
        """Kinetic and potential energy of the bodies that move by themselves, joules."""
        free = self.pieces.dynamic
        return self._kinetic(free) - float((self.pieces.mass[free] * (self.bodies.position[free] @ gravity)).sum())

    def slow(self, bodies: Mask, energy: float) -> None:
        """Take an energy [J] from the velocities of bodies (n,), or all that they have."""
        kinetic = self._kinetic(bodies)
        self.bodies.twist[bodies] *= np.sqrt(1.0 - energy / kinetic) if energy < kinetic else 0.0

    def pay(self, position: Array, gravity: Array, borne: Indices) -> float:
        """Take the energy of bodies that were lifted from positions (n, 3) from their velocities; what is lent [J].

        It is lent to what segments that yield bear, by index: these pay, so that the momentum of both stays.
        """
        lifted = self.bodies.moving & (self.bodies.position != position).any(axis=1)
        rise = np.zeros(len(lifted))
        rise[lifted] = self.pieces.mass[lifted] * ((position - self.bodies.position)[lifted] @ gravity)
        lifted[borne] = False
        if (own := float(rise[lifted].sum())) > 0.0:
            self.slow(lifted, own)
        return max(0.0, float(rise.sum()) - own)

    def _kinetic(self, bodies: Mask) -> float:
        return float(motion_kernel.kinetic(self.bodies, bodies))

    def momentum(self) -> Array:
        """Momentum [kg m/s] and angular momentum about the world's origin [kg m2/s], (6,), of the same bodies."""
        free = self.pieces.dynamic
        linear = self.pieces.mass[free, None] * self.velocity[free]
        turned = self.bodies.rotation[free]
        local = np.einsum("bij,bi->bj", turned, self.spin[free])
        own = np.einsum("bij,bjk,bk->bi", turned, self.pieces.inertia[free], local)
        return np.concatenate([linear.sum(axis=0), (cross(self.bodies.position[free], linear) + own).sum(axis=0)])


def rotation_vectors(turns: Array) -> Array:
    """The rotation vectors (k, 3) of rotations (k, 3, 3)."""
    sines = 0.5 * (turns[:, (2, 0, 1), (1, 2, 0)] - turns[:, (1, 2, 0), (2, 0, 1)])
    sine, cosine = np.linalg.norm(sines, axis=1), 0.5 * (np.einsum("kii->k", turns) - 1.0)
    small = sine < 1e-6  # rad: then the angle is its sine
    found = sines * np.where(small, 1.0, np.arctan2(sine, cosine) / np.where(small, 1.0, sine))[:, None]
    for k in np.flatnonzero(cosine < -0.9):  # of nearly half a turn the sines are nearly nothing
        found[k] = pin.log3(turns[k])
    return np.asarray(found)


class Joints:
    """Joints as points that stay together, one of a ball joint, two on a hinge's axis, where they hinder least."""

    # the step's program holds them, and then velocities do (RATTLE; Andersen 1983), which takes energy

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
        return np.asarray(self._pieces.dynamic & (self._island == self._island[number]))

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
