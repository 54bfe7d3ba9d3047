"""Inverse dynamics of one frame on its feet: torques, the wrench that the ground has to give, and derivatives of both.

The torques of a motion in the air are those of the recursive Newton-Euler algorithm (Featherstone 2008, chapter 5).
Those of a free root are the wrench that the ground has to give. It is split over the soles, and each foot's part acts
on the joints through the foot's Jacobian.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, cross, with_values
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure
from wholebody.figures.strength import shoulders, with_strength_axes
from wholebody.motion.stance import pieces_on
from wholebody.tasks.balance import DOWN, convex_polygon
from wholebody.tasks.surfaces import outermost

ROOT = 6  # degrees of freedom of a free root
LIGHT = 0.2
"""Share of the weight: with less vertical force, in a take-off or landing, the zero moment point says little."""


class GroundForces(NamedTuple):
    """Forces of the ground in one frame."""

    forces: Array  # (points, 3) force on each point of the soles, N, in the world
    missing: Array  # (6,) what the ground cannot give of the wrench: force N, moment N m about the wrench's point
    split: Array  # (3 points, 6) derivative of the forces with respect to the wrench, while the same edges bear


def ground_forces(
    wrench: Array, about: Array, points: Array, friction: float, axes: Array | None = None
) -> GroundForces:
    """Forces at points (p, 3) in cones about axes (p, 3), or up, nearest to a wrench (6,) about a point (3,)."""
    # Least |wrench's error|^2 + (e |forces|)^2 over edges of pyramids (Lawson and Hanson 1974, chapter 23).
    if len(points) == 0:
        return GroundForces(np.zeros((0, 3)), wrench.copy(), np.zeros((0, 6)))
    from scipy.optimize import nnls

    count = 8  # edges of a pyramid, which lies within 8 % of the cone of friction, and inside
    even = 1e-3  # m: e; many splits give the same wrench; more misses the wrench by about its square
    around = 2.0 * np.pi * np.arange(count) / count
    rims = np.column_stack([friction * np.cos(around), friction * np.sin(around), np.ones(count)])
    directions = np.tile(rims, (len(points), 1))
    for number, axis in enumerate(() if axes is None else axes):
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).toRotationMatrix()
        directions[number * count : (number + 1) * count] = rims @ turn.T
    arms = np.repeat(points - about, count, axis=0)
    columns = np.hstack([directions, cross(arms, directions)]).T
    # scaled to the wrench, so that e means the same for a mouse and an elephant
    scale = max(float(np.linalg.norm(wrench[:3])), 1.0)
    stacked = np.vstack([columns, even * np.eye(columns.shape[1])])
    found, _ = nnls(stacked, np.concatenate([wrench / scale, np.zeros(columns.shape[1])]))
    forces = (found[:, None] * directions).reshape(len(points), count, 3).sum(axis=1) * scale
    bears = found > 0.0
    active = columns[:, bears]
    # the answer on the edges that bear is that of linear least squares with e
    solved = np.linalg.solve(active.T @ active + even**2 * np.eye(active.shape[1]), active.T)
    split = np.zeros((len(points), 3, 6))
    np.add.at(split, np.flatnonzero(bears) // count, directions[bears][:, :, None] * solved[:, None, :])
    return GroundForces(forces, wrench - columns @ (found * scale), split.reshape(-1, 6))


class Touches(NamedTuple):
    """Where a frame touches things with other parts than its feet."""

    points: Array  # (t, 3) points, metres
    owner: Indices  # (t,) number of the part of each, after the feet
    axes: Array  # (t, 3) of their cones of friction: normals of unit length, out of the things


class Stand(NamedTuple):
    """Where a frame stands."""

    points: Array  # (p, 3) points that bear force, metres: of the soles first, then those that touch things
    owner: Indices  # (p,) number of the foot of each, or of the part that touches
    # (c, 2) of the support polygon, anticlockwise; both ends where the points lie on a line; none in flight
    corners: Array
    normals: Array  # (e, 2) inward normals of its edges; of a line of both sides and both ends
    offsets: Array  # (e,) inside, ``normals @ place >= offsets``, metres
    height: float  # of the ground, metres
    axes: Array  # (p, 3) of the cones of friction: normals of unit length at the points, out of what bears

    def shifted(self, shifts: Sequence[Array]) -> Stand:
        """The same with each foot (3,) farther, metres; what touches things stays."""
        if not any(shift.any() for shift in shifts):
            return self
        sole = self.owner < len(shifts)
        found = _standing(self.points[sole] + np.array(shifts)[self.owner[sole]], self.owner[sole])
        return found.touching(Touches(self.points[~sole], self.owner[~sole], self.axes[~sole]))

    def touching(self, touches: Touches) -> Stand:
        """The same that touches things too, by which the support does not change."""
        parts = zip(("points", "owner", "axes"), (self.points, self.owner, self.axes), touches, strict=True)
        return with_values(self, **{name: np.concatenate(both) for name, *both in parts})

    def margins(self, place: Array) -> Array:
        """(e,) distances of a place (2,) from the edges, metres; positive inside."""
        return np.asarray(self.normals @ place - self.offsets)


class Loads(NamedTuple):
    """Loads of one frame."""

    torque: Array  # (nv,) of the joints, N m, after the ground's forces; the root's part is what is missing
    strained: Array  # (nv,) the same about the axes of strength, see `wholebody.figures.strength.Shoulder`
    wrench: Array  # (6,) that the feet's ground has to give: force N, and moment about the world's origin N m
    ground: GroundForces  # what it gives; about the centre of mass
    center: Array  # (3,) centre of mass, metres


class Derivatives(NamedTuple):
    """Derivatives of `Loads.strained` (nv, nv) and of the zero moment point (2, nv) with respect to q, v and a."""

    torque: tuple[Array, Array, Array]
    place: tuple[Array, Array, Array]


class InverseDynamics:
    """Loads of frames of one figure, with mass, on feet that may stand, and on other joints that may touch things."""

    def __init__(self, figure: Figure, feet: Sequence[str], friction: float, touching: Sequence[int] = ()) -> None:
        one_figure(figure, "dynamics: the figure")
        self._figure, self._still, self._friction = figure.model, figure.model.createData(), friction
        self._model = model = with_strength_axes(figure)
        self._data = model.createData()
        ids = [model.getJointId(name) for name in figure.model.names]
        self._places, self._columns = (
            np.concatenate([np.arange(begin, begin + size, dtype=np.intp) for begin, size in spans])
            for spans in zip(
                *(((one.idx_q, one.nq), (one.idx_v, one.nv)) for one in map(model.joints.__getitem__, ids[1:])),
                strict=True,
            )
        )
        self._strained = self._columns.copy()
        for one in shoulders(figure):
            self._strained[figure.model.joints[one.flexion].idx_v] = model.joints[ids[one.abduction] + 1].idx_v
        self.feet = tuple(feet)  # names of the segments or frames that may stand; none for a root that is fixed
        joints = [int(figure.model.frames[figure.frame_id(foot)].parentJoint) for foot in self.feet]
        self._soles = [pieces_on(figure, joint) for joint in joints]
        for foot, joint, pieces in zip(self.feet, joints, self._soles, strict=True):
            if joint == 0 or not pieces:
                raise InputError(f"torques: {foot} has no pieces to stand on; name segments with geometry as feet")
        self.joints = [*joints, *touching]  # of the feet, and after them those that touch
        self._bearing = [ids[joint] for joint in self.joints]
        self.weight = float(pin.computeTotalMass(self._model) * np.linalg.norm(self._model.gravity.linear))  # N
        self.free = figure.root == "free"

    def stand(self, q: Array, feet: Sequence[bool], touches: Touches | None = None) -> Stand:
        """Where a posture (nq,) stands, on some of the feet, and touches things."""
        pin.forwardKinematics(self._figure, self._still, q)
        points, owner = [np.zeros((0, 3))], [np.zeros(0, dtype=int)]
        for foot in np.flatnonzero(feet).tolist():
            lows = np.vstack(
                [
                    outermost(piece.geometry, self._still.oMi[piece.parentJoint] * piece.placement, DOWN)
                    for piece in self._soles[foot]
                ]
            )
            # up to 2 cm above the lowest point: soles are rounded, recordings uneven
            lows = lows[lows[:, 2] <= lows[:, 2].min() + 0.02]
            around = 2.0 * np.pi * np.arange(12) / 12  # fewer directions cut off the ends of a rounded sole
            far = np.argmax(lows[:, :2] @ np.array([np.cos(around), np.sin(around)]), axis=0)
            points.append(lows[np.unique(far)])
            owner.append(np.full(len(points[-1]), foot))
        found = _standing(np.vstack(points), np.concatenate(owner))
        return found if touches is None else found.touching(touches)

    def loads(self, q: Array, v: Array, a: Array, stand: Stand) -> Loads:
        """Loads of a posture (nq,) with its velocity and acceleration (nv,)."""
        model, data = self._model, self._data
        q, torque = self._posture(q), self.free_torque(q, v, a)
        center = np.array(pin.centerOfMass(model, data, q))
        if not self.free:
            return Loads(
                torque[self._columns],
                torque[self._strained],
                np.zeros(6),
                ground_forces(np.zeros(6), center, np.zeros((0, 3)), 1.0),
                center,
            )
        pin.computeJointJacobians(model, data, q)
        wrench = np.array(data.oMi[1].act(pin.Force(torque[:ROOT])).vector)
        ground = self.split(wrench, center, stand)
        for part, total in enumerate(foot_wrenches(ground.forces, stand, len(self.joints))):
            torque -= pin.getJointJacobian(model, data, self._bearing[part], pin.ReferenceFrame.WORLD).T @ total
            wrench -= total if part >= len(self.feet) else 0.0  # what things give
        return Loads(torque[self._columns], torque[self._strained], wrench, ground, center)

    def free_torque(self, q: Array, v: Array, a: Array) -> Array:
        """Torques in the air, of joints and about axes of strength, for `grounded`."""
        return np.array(pin.rnea(self._model, self._data, self._posture(q), self._tangent(v), self._tangent(a)))

    def _posture(self, q: Array) -> Array:
        """The posture (nq,) of the figure in the model with axes of strength."""
        whole: Array = np.zeros(self._model.nq)
        whole[self._places] = q
        return whole

    def _tangent(self, v: Array) -> Array:
        """The same of a velocity or an acceleration (nv,)."""
        whole: Array = np.zeros(self._model.nv)
        whole[self._columns] = v
        return whole

    def grounded(self, q: Array, torques: Array, shares: Array, stand: Stand) -> tuple[Array, Array]:
        """Parts of `strained` (k, nv), and of the wrench (k, 6) that feet have to give, of parts of `free_torque`."""
        # The forces are linear while the same edges of friction bear: those at the sum with shares (k,).
        model, data = self._model, self._data
        if not self.free:
            return torques[:, self._strained], np.zeros((len(torques), 6))
        q = self._posture(q)
        center = np.array(pin.centerOfMass(model, data, q))
        pin.computeJointJacobians(model, data, q)
        wrenches = np.array([data.oMi[1].act(pin.Force(part[:ROOT])).vector for part in torques])
        split = self.split(shares @ wrenches, center, stand).split
        left, feet = torques.copy(), wrenches.copy()
        for foot, joint in enumerate(self._bearing):
            mine = stand.owner == foot
            if mine.any():
                jacobian = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.WORLD)
                given = wrenches @ (point_map(stand.points[mine]) @ split[np.repeat(mine, 3)] @ moving(center)).T
                left -= given @ jacobian
                feet -= given if foot >= len(self.feet) else 0.0
        return left[:, self._strained], feet

    def split(self, wrench: Array, center: Array, stand: Stand) -> GroundForces:
        """The ground's forces for a wrench (6,) about the world's origin."""
        return ground_forces(moved(wrench, center), center, stand.points, self._friction, stand.axes)

    def outside(self, loads: Loads, stand: Stand) -> float:
        """By how far the zero moment point is outside of where a frame stands, metres; 0 where that says little."""
        if not len(stand.normals) or loads.wrench[2] < LIGHT * self.weight:
            return 0.0
        place = zero_moment_point(loads.wrench, stand.height)
        if (stand.margins(place) >= 0.0).all():
            return 0.0
        ends = np.roll(stand.corners, -1, axis=0) - stand.corners
        length = np.maximum(np.einsum("ij,ij->i", ends, ends), np.finfo(float).tiny)
        along = np.einsum("ij,ij->i", place - stand.corners, ends) / length
        nearest = stand.corners + np.clip(along, 0.0, 1.0)[:, None] * ends
        return float(np.linalg.norm(place - nearest, axis=1).min())

    def derivatives(self, q: Array, v: Array, a: Array, stand: Stand) -> Derivatives:
        """Derivatives of `loads` and of the zero moment point."""
        model, data = self._model, self._data
        here = self.loads(q, v, a, stand)
        q, v, a = self._posture(q), self._tangent(v), self._tangent(a)
        parts = [np.array(part) for part in pin.computeRNEADerivatives(model, data, q, v, a)]
        parts[2] = np.triu(parts[2]) + np.triu(parts[2], 1).T
        if not self.free:
            none = np.zeros((2, len(self._columns)))
            return self._about_strength(parts, [none, none, none])
        J = np.array(pin.computeJointJacobians(model, data, q))
        action = np.asarray(data.oMi[1].toDualActionMatrix())
        wrenches = [action @ part[:ROOT] for part in parts]
        bent = foot_wrenches(here.ground.forces, stand, len(self.joints))
        total = here.wrench + np.sum(bent[len(self.feet) :], axis=0)  # what things give too
        for column in range(ROOT):  # the axes of the root turn with it
            twist = pin.Motion(J[:, column])
            wrenches[0][:, column] += twist.cross(pin.Force(total)).vector
        shift, whole = moving(here.center), [wrench.copy() for wrench in wrenches]
        for foot, joint in enumerate(self._bearing):
            mine = np.repeat(stand.owner == foot, 3)
            if not mine.any():
                continue
            jacobian = np.array(pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.WORLD))
            given = point_map(stand.points[stand.owner == foot]) @ here.ground.split[mine] @ shift
            for part, wrench, feet in zip(parts, whole, wrenches, strict=True):
                part -= jacobian.T @ given @ wrench
                feet -= given @ wrench if foot >= len(self.feet) else 0.0
            parts[0] -= self._turning(J, joint, bent[foot])
        wrenches = [wrench[:, self._columns] for wrench in wrenches]
        return self._about_strength(parts, _place_derivatives(here.wrench, wrenches, stand.height))

    def _about_strength(self, parts: Sequence[Array], places: Sequence[Array]) -> Derivatives:
        at, speed, push = (part[np.ix_(self._strained, self._columns)] for part in parts)
        return Derivatives((at, speed, push), (places[0], places[1], places[2]))

    def _turning(self, J: Array, joint: int, wrench: Array) -> Array:
        """(nv, nv) derivative with respect to posture of a fixed wrench's moments about the axes of a chain."""
        model, force = self._model, pin.Force(wrench)
        found, before = np.zeros((model.nv, model.nv)), []
        for number in model.supports[joint]:
            own = model.joints[number]
            columns = range(own.idx_v, own.idx_v + own.nv) if number else range(0)
            before += [(column, pin.Motion(J[:, column])) for column in columns]
            for late in columns:
                turned = pin.Motion(J[:, late])
                for early, axis in before:
                    found[late, early] = axis.cross(turned).dot(force)
        return found


def _standing(points: Array, owner: Indices) -> Stand:
    """Where points (p, 3) of feet stand."""
    axes = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    if not len(points):
        return Stand(points, owner, np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), 0.0, axes)
    return Stand(points, owner, *_support(points[:, :2]), float(points[:, 2].min()), axes)


def _support(points: Array) -> tuple[Array, Array, Array]:
    """Corners (c, 2), normals (e, 2) and offsets (e,) of the convex hull of points (p, 2), which may lie on a line."""
    try:
        return convex_polygon(points)[:3]
    except InputError:  # one capsule, or one point: a foot without width
        middle = points.mean(axis=0)
        along = np.linalg.svd(points - middle)[2][0]
        places = (points - middle) @ along
        corners = np.unique(points[[int(np.argmin(places)), int(np.argmax(places))]], axis=0)
        across = np.array([-along[1], along[0]])
        normals = np.array([across, -across, along, -along])
        return corners, normals, (corners @ normals.T).min(axis=0)


def foot_wrenches(forces: Array, stand: Stand, count: int) -> list[Array]:
    """(6,) force and moment about the world's origin on each of so many feet and parts that touch."""
    found = []
    for foot in range(count):
        mine = stand.owner == foot
        turning = cross(stand.points[mine], forces[mine]).sum(axis=0)
        found.append(np.concatenate([forces[mine].sum(axis=0), turning]))
    return found


def zero_moment_point(wrench: Array, height: float) -> Array:
    """(2,) where the ground gives a wrench (6,) without a horizontal moment, metres; its vertical force is not zero."""
    # Vukobratovic and Borovac 2004, "Zero-moment point - thirty five years of its life"
    force, turning = wrench[:3], wrench[3:]
    return np.asarray(np.array([-turning[1] + height * force[0], turning[0] + height * force[1]]) / force[2])


def moved(wrench: Array, center: Array) -> Array:
    """A wrench (6,) about another point than the world's origin."""
    return np.asarray(np.concatenate([wrench[:3], wrench[3:] - cross(center, wrench[:3])]))


def moving(center: Array) -> Array:
    """(6, 6) the matrix of `moved`."""
    found = np.eye(6)
    found[3:, :3] = -pin.skew(center)
    return found


def point_map(points: Array) -> Array:
    """(6, 3p) from forces on points (p, 3) to their sum and their moment about the world's origin."""
    return np.hstack([np.vstack([np.eye(3), pin.skew(point)]) for point in points])


def _place_derivatives(wrench: Array, wrenches: Sequence[Array], height: float) -> tuple[Array, Array, Array]:
    place = zero_moment_point(wrench, height) if wrench[2] != 0.0 else np.zeros(2)
    low = np.zeros((2, 6))  # zero_moment_point times the vertical force is linear
    low[0, 4], low[0, 0], low[1, 3], low[1, 1] = -1.0, height, 1.0, height
    down = wrench[2] if wrench[2] != 0.0 else np.inf
    found = [(low @ part - np.outer(place, part[2])) / down for part in wrenches]
    return found[0], found[1], found[2]
