"""One kinematic pass of a model: where everything is at a posture, and how it moves."""

from __future__ import annotations

from functools import cached_property
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, cross
from wholebody.base.checks import DOUBLE, instance, posture, whole
from wholebody.base.errors import InputError
from wholebody.figures.description import ROOT_JOINT
from wholebody.geometry.memory_views import placement_view

UNIT_TOLERANCE = 1e-3  # largest deviation of a quaternion from unit length; more is refused as a mistake


class Wrench(NamedTuple):
    """Rows of a Jacobian, as wrenches in the world frame.

    Row i is ``rows[i] @ (V_joint - V_against)`` where V is a spatial velocity at the world's origin, linear part first.
    A force direction n at the point p is the wrench ``[n, p x n]``; a pure rotation about n is ``[0, n]``.

    Attributes:
        rows: (m, 6) wrenches.
        joint: index of the Pinocchio joint that carries what moves.
        against: index of the joint that carries what it moves relative to; 0 is the world.
    """

    rows: Array
    joint: int
    against: int = 0


class State:
    """Placements and Jacobians of a model at one posture, from a single pass of Pinocchio.

    The object is re-used: `update` overwrites everything that was read from it before.

    Attributes:
        model: Pinocchio's model.
        data: Pinocchio's data at the posture.
        q: (nq,) the posture.
        jacobian: (6, n) columns of the joints, world frame. n is nv, and one more for each degree of freedom of a joint
            that follows another (mimic): `folded` and `spread` translate.
        columns: (n, 6) the same, transposed.
        number: how many postures it was moved to.
        kept: a cache of derived quantities; `number` says of which posture.
    """

    def __init__(self, model: pin.Model) -> None:
        instance(model, pin.Model, "model", "give figure.model")
        self.model = model
        self.data = pin.Data(model)
        self.q: Array = pin.neutral(model)
        self._columns = extended_columns(model)
        if self._columns is not None:
            self._fold = np.eye(model.nv)[self._columns]
        self._nq, self._plain = model.nq, model.nq == model.nv  # whether no joint has a unit vector
        self._take_jacobian()
        self._shared = np.shares_memory(self.jacobian, self.data.J)
        self._frames: dict[int, pin.SE3] = {}
        self._centers: dict[range | None, Array] = {}
        self._companions: dict[object, State] = {}
        self.number, self.kept = 0, dict[object, Any]()
        self._asked = b""
        self.update(self.q)

    def __repr__(self) -> str:
        return f"State({self.model.name!r}, {self.model.nq} coordinates)"

    def update(self, q: Array) -> State:
        """Move to the posture q, shape (nq,).

        Raises:
            InputError: q has the wrong shape, or a value that is not finite.
        """
        usual = type(q) is np.ndarray and q.dtype is DOUBLE and q.shape == (self._nq,)
        if not usual or not isfinite(q.dot(q)):
            q = posture(q, self._nq)
        if not self._plain and not pin.isNormalized(self.model, q, UNIT_TOLERANCE):
            raise InputError(
                "the posture's quaternion is not of unit length; normalise it with pin.normalize(model, q)"
            )
        self._asked = b""
        pin.computeJointJacobians(self.model, self.data, q)
        self.q = q
        if not self._shared:
            self._take_jacobian()
        self._frames.clear()
        self._centers.clear()
        self.number += 1
        return self

    def at(self, q: Array) -> State:
        """Move to the posture q as `update` does, unless `at` was asked for the same one last."""
        usual = type(q) is np.ndarray and q.dtype is DOUBLE and q.shape == (self._nq,)
        if usual and q.tobytes() == self._asked:
            return self
        q = posture(q, self._nq)
        asked = q.tobytes()
        if asked != self._asked:
            self.update(q.copy())._asked = asked
        return self

    @cached_property
    def support(self) -> Array:
        """(njoints, n) 1 where a column moves a joint, else 0."""
        return joint_support(self.model)

    @cached_property
    def parents(self) -> NDArray[np.intp]:
        """(njoints,) the joint that carries each joint."""
        return np.array(list(self.model.parents), dtype=np.intp)

    @cached_property
    def column_joint(self) -> NDArray[np.intp]:
        """(n,) the joint that a column belongs to."""
        return np.asarray(self.support.argmax(axis=0), dtype=np.intp)

    @cached_property
    def _joints(self) -> Array | None:
        return placement_view(self.data.oMi)

    def _take_jacobian(self) -> None:
        self.jacobian: Array = self.data.J.reshape(6, -1)  # of one degree of freedom Pinocchio gives (6,)
        self.columns: Array = self.jacobian.T

    @property
    def joints(self) -> Array:
        """(njoints, 4, 3) placements of the joints: columns of the rotation, then the translation. A view."""
        if self._joints is not None:
            return self._joints
        return np.array([[*M.rotation.T, M.translation] for M in self.data.oMi], dtype=float)

    def companion(self, key: object, model: pin.Model) -> State:
        """A state of another model that goes along with this one: the same for the same key, and of this run alone."""
        other = self._companions.get(key)
        if other is None:
            other = self._companions[key] = State(model)
        return other

    def __reduce__(self) -> tuple[Any, ...]:
        """Return model and posture; Pinocchio's data are computed anew."""
        return _restored, (self.model, self.q)

    def frame(self, index: int) -> pin.SE3:
        """Placement in the world of the frame with this index."""
        if type(index) is not int:
            index = whole(index, "the index of a frame", 0, self.model.nframes - 1)
        placement = self._frames.get(index)
        if placement is None:
            if not 0 <= index < self.model.nframes:
                whole(index, "the index of a frame", 0, self.model.nframes - 1)
            placement = self._frames[index] = pin.updateFramePlacement(self.model, self.data, index)
        return placement

    def rows(self, wrenches: Array, joint: NDArray[np.intp], against: NDArray[np.intp]) -> Array:
        """Jacobian rows (k, nv) of k wrenches (k, 6), each between its own two joints (k,), see `Wrench`."""
        return self.folded((wrenches @ self.jacobian) * (self.support[joint] - self.support[against]))

    def wrench_jacobian(self, wrench: Wrench) -> Array:
        """Jacobian (m, nv) of one `Wrench`."""
        moved = self.support[wrench.joint]
        if wrench.against:
            moved = moved - self.support[wrench.against]
        return self.folded(np.dot(wrench.rows, self.jacobian) * moved)  # twice as fast as @ for so few rows

    def dense_jacobian(self, part: Wrench | Array) -> Array:
        """Jacobian (m, nv) of a term that gave a `Wrench` or the rows themselves, one row or several."""
        return self.wrench_jacobian(part) if isinstance(part, Wrench) else np.atleast_2d(part)

    def folded(self, rows: Array) -> Array:
        """Rows (k, nv) of rows (k, n) over the columns of `jacobian`: joints that follow another move with it."""
        if self._columns is None:
            return rows
        return np.asarray(rows @ self._fold)

    def spread(self, displacement: Array) -> Array:
        """A tangent displacement (nv,) over the columns of `jacobian`, (n,): the transpose of `folded`."""
        return displacement if self._columns is None else displacement[self._columns]

    def center_of_mass(self, joints: range | None = None) -> Array:
        """Centre of mass in the world, shape (3,), metres: of all, or of what these joints carry."""
        if joints not in self._centers:
            if joints is None:
                pin.centerOfMass(self.model, self.data, self.q)
                self._centers[None] = self.data.com[0].copy()
            else:
                mass, moment = self._moments(joints)
                self._centers[joints] = moment.sum(axis=0) / mass.sum()
        return self._centers[joints]

    def _moments(self, joints: range) -> tuple[Array, Array]:
        """Of what each of some joints carries: mass (k,), and mass times centre in the world (k, 3)."""
        inertias = [self.model.inertias[k] for k in joints]
        centers = [self.data.oMi[k].act(inertia.lever) for k, inertia in zip(joints, inertias, strict=True)]
        mass = np.array([inertia.mass for inertia in inertias])
        return mass, mass[:, None] * np.array(centers).reshape(-1, 3)

    def center_of_mass_jacobian(self, joints: range | None = None) -> Array:
        """(3, nv) Jacobian of the centre of mass of all, or of what joints carry."""
        if joints is None and self._columns is None:  # it writes placements and columns as they are
            return np.array(pin.jacobianCenterOfMass(self.model, self.data, self.q)).reshape(3, -1)
        joints = range(1, self.model.njoints) if joints is None else joints
        mass, moment = self._moments(joints)
        moved = self.support[joints.start : joints.stop].T  # a column moves what hangs on its joint
        linear, turn = self.columns[:, :3], self.columns[:, 3:]
        rows = (moved @ mass)[:, None] * linear + cross(turn, moved @ moment)
        return self.folded(rows.T / mass.sum())


def _restored(model: pin.Model, q: Array) -> State:
    return State(model).update(q)


def free_roots(model: pin.Model) -> tuple[int, ...]:
    """The joints that are floating bases: the first one, and of figures that were joined those with a root's name."""
    return tuple(
        k
        for k in range(1, model.njoints)
        if (k == 1 or model.names[k].endswith(f"/{ROOT_JOINT}")) and model.joints[k].nq == 7
    )


def root_freedoms(model: pin.Model) -> NDArray[np.bool_]:
    """(nv,) whether a degree of freedom is one of the six of a floating base."""
    found = np.zeros(model.nv, dtype=bool)
    for joint in free_roots(model):
        found[model.joints[joint].idx_v : model.joints[joint].idx_v + 6] = True
    return found


def joint_support(model: pin.Model) -> Array:
    """Which columns of the joint Jacobian move which joint: 0/1 array (njoints, n); the world's row is zero."""
    parents, firsts, widths = (vector.tolist() for vector in (model.parents, model.idx_vExtendeds, model.nvExtendeds))
    support = np.zeros((model.njoints, sum(widths)))
    for joint in range(1, model.njoints):
        support[joint] = support[parents[joint]]
        support[joint, firsts[joint] : firsts[joint] + widths[joint]] = 1.0
    return support


def extended_columns(model: pin.Model) -> NDArray[np.intp] | None:
    """Place in the tangent of each column of the joint Jacobian; None where no joint follows another."""
    widths, extended = model.nvs.tolist(), model.nvExtendeds.tolist()
    if widths == extended:
        return None
    places, first = model.idx_vs.tolist(), model.idx_vExtendeds.tolist()
    columns = np.zeros(sum(extended), dtype=np.intp)
    for joint in range(1, model.njoints):
        size = extended[joint]
        columns[first[joint] : first[joint] + size] = np.arange(places[joint], places[joint] + size)
    return columns
