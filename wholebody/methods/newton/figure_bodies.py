"""A figure in full coordinates: its joints as equations, postures to and from variables, displacements as rows."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask, cross
from wholebody.figures.description import Follower, follows
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.geometry.memory_views import placement_view
from wholebody.geometry.placement import quaternions
from wholebody.methods.base import UnsupportedTermError
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.batches import HARD, OBJECTIVE, ONE_SIDED, Angle, Batch, EquationSet, Slide, with_world
from wholebody.methods.newton.quaternions import axes_with_z, relative_forms


class Chart:
    """Which bodies each degree of freedom of a model is a function of, one body a joint, and its derivative by them.

    Attributes:
        bodies: (n,) their numbers.
        pattern: (nv, 7 n) the variables that each degree of freedom depends on.
    """

    def __init__(self, model: pin.Model, first: int = 0) -> None:
        """Find the bodies (2, nv) and the axes (2, nv, 3) of each degree of freedom; `first` is Pinocchio's joint 1."""
        self._ends: Indices = np.zeros((2, model.nv), dtype=np.intp)
        self._axes = np.zeros((2, model.nv, 3))  # translation, rotation
        for joint in range(1, model.njoints):
            kind, parent = model.joints[joint], int(model.parents[joint])
            if not kind.nv:  # it follows another joint
                continue
            place = slice(kind.idx_v, kind.idx_v + kind.nv)
            self._ends[:, place] = [[first + joint - 1], [first + parent - 1 if parent else -1]]
            self._axes[:, place] = np.array(kind.createData().S).reshape(2, 3, -1).transpose(0, 2, 1)
        columns = (7 * (self._ends.T[:, :, None] - first) + np.arange(7)).reshape(model.nv, 14)
        sliding = self._axes[0].any(axis=1)[:, None]
        self._reads: Mask = (columns >= 0) & (sliding | (np.arange(14) % 7 >= 3))  # nothing of the world
        self._entries = np.nonzero(self._reads)[0], columns[self._reads]
        self.bodies: Indices = first + np.arange(model.njoints - 1)
        self._seen: tuple[Array, Array] = np.zeros(0), np.zeros(0)
        self.pattern: Mask = np.zeros((model.nv, 7 * (model.njoints - 1)), dtype=bool)
        self.pattern[self._entries] = True

    def rows(self, x: Array) -> Array:
        """Derivative (nv, 7 n) at bodies x (n + 1, 7), done once."""
        if self._seen[0] is not x:
            self._seen = x, self._rows(x)
        return self._seen[1]

    def _rows(self, x: Array) -> Array:
        """The velocity of each child relative to its parent, along the axes of the joint between them."""
        (child, parent), (slides, turns) = self._ends, self._axes
        first, second = x[child], x[parent]
        along, about = (quat.rotate(first[:, 3:], axes) for axes in (slides, turns))  # in the world
        lever = about + cross(first[:, :3] - second[:, :3], along)
        spins = quat.spin(first[:, 3:]), quat.spin(second[:, 3:])
        ours = np.hstack([along, np.einsum("ki,kij->kj", about, spins[0])])
        theirs = -np.hstack([along, np.einsum("ki,kij->kj", lever, spins[1])])
        result = np.zeros(self.pattern.shape)
        result[self._entries] = np.hstack([ours, theirs])[self._reads]
        return result


class DisplacementRows(Batch):
    """The displacement of a posture from another one, in its tangent, less a target: a row for each freedom."""

    role = OBJECTIVE

    def __init__(self, model: pin.Model, chart: Chart, posture: Callable[[Array], Array]) -> None:
        """Take what gives the posture (nq,) at bodies (n + 1, 7); `anchor` says from where it moves."""
        super().__init__(chart.bodies[None], ["the measures"])
        self.size, self.pattern = model.nv, chart.pattern
        self._model, self._chart, self._posture = model, chart, posture
        self.anchor(pin.neutral(model), np.zeros(model.nv))

    def anchor(self, q: Array, target: Array) -> None:
        """Count from the posture q (nq,), towards a displacement (nv,)."""
        self._from, self._target = q, target

    def residual(self, x: Array) -> Array:  # noqa: D102
        result: Array = pin.difference(self._model, self._from, self._posture(x)) - self._target
        return result[None]

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        return self._chart.rows(x)[None]


class Following(Batch):
    """A joint whose value is that of another times a slope plus an offset: one row of all bodies of a figure."""

    size = 1

    def __init__(self, bodies: Indices, label: str, values: tuple[Batch, Batch], law: Follower) -> None:
        """Take the bodies (n,), of which the first is Pinocchio's joint 1, and what tells the values of both joints."""
        super().__init__(bodies[None], [label])
        self._values, self._law = values, law
        columns = [(7 * (value.bodies - bodies[0])[0, :, None] + np.arange(7)).ravel() for value in values]
        self._kept = [(np.flatnonzero(column >= 0), column[column >= 0]) for column in columns]
        self.pattern = np.zeros((1, 7 * len(bodies)), dtype=bool)
        for value, (kept, column) in zip(values, self._kept, strict=True):
            self.pattern[0, column] |= value.pattern[0, kept]

    def residual(self, x: Array) -> Array:  # noqa: D102
        own, other = (value.residual(x) for value in self._values)
        off = np.asarray(own - self._law.slope * other - self._law.offset)
        # one that follows a few times as far turns more than once
        return off - 2.0 * np.pi * np.round(off / (2.0 * np.pi)) if isinstance(self._values[0], Angle) else off

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        result = np.zeros((1, 1, self.pattern.shape[1]))
        parts = zip(self._values, self._kept, (1.0, -self._law.slope), strict=True)
        for value, (kept, column), sign in parts:
            result[0, 0, column] += sign * value.jacobian(x)[0, 0, kept]
        return result


class FigureBodies:
    """Bodies of a figure: one for each joint, at the joint's placement.

    Attributes:
        first: index of the first body, among all bodies, which moves with Pinocchio's joint 1.
        count: number of bodies.
        weight: (7 count,) weight of each variable in the least motion.
        names: of the joints.
        equations: the joints.
        limits: one row for each limited joint, for the nearer of its two limits; `choose_limits` chooses it.
        q: (nq,) the posture at the last `retract`.
        step: a posture (nq,), and tangent displacements (nv,) from it within which later ones are kept, for velocity
            bounds of a frame; None for limits alone.
        chart: the tangent displacement as a function of the bodies.
        data: Pinocchio's, with the placements of the joints at the last `variables` or `retract`.
    """

    def __init__(self, figure: Figure, start: Array | None = None, first: int = 0) -> None:
        """Read the joints; `start` (nq,) tells how many rows terms of one's own have."""
        self.figure, self.model, self.first = figure, figure.model, first
        self.count = self.model.njoints - 1
        self.names = list(self.model.names)[1:]
        self.data = self.model.createData()
        self.equations = EquationSet()
        self._turning: list[tuple[int, int, Array, Array]] = []  # joint, parent, axes in the parent, axes in the child
        self._others: list[int] = []
        for joint in range(1, self.model.njoints):
            self._add(joint)
        pin.forwardKinematics(self.model, self.data, pin.neutral(self.model))
        self._placements = placement_view(self.data.oMi)
        axes = [np.array([row[k] for row in self._turning]).reshape(-1, 4) for k in (2, 3)]
        pairs = [(self.index(row[1]), self.index(row[0])) for row in self._turning]
        turning: Indices = np.array(pairs, dtype=np.intp).reshape(-1, 2)
        limits = figure.limits
        low, high = np.full(self.model.nq, -np.inf), np.full(self.model.nq, np.inf)
        low[limits.idx_q], high[limits.idx_q] = limits.lower, limits.upper
        self._places: Indices = np.array([self.model.joints[row[0]].idx_q for row in self._turning], dtype=np.intp)
        self.low, self.high = low[self._places], high[self._places]
        finite = np.isfinite(self.low) & np.isfinite(self.high)
        center = np.zeros(len(pairs))
        center[finite] = 0.5 * (self.low[finite] + self.high[finite])
        labels = [f"the limit of {self.names[row[0] - 1]!r}" for row in self._turning]
        forms = relative_forms(*axes)[:, 2:]
        self.angles = Angle(turning, labels, forms, center, np.zeros(len(pairs)), np.ones(len(pairs)))
        self._limited = np.flatnonzero(np.isfinite(self.low) | np.isfinite(self.high))
        self.limits = self._limit_rows()
        self.limits.role = ONE_SIDED
        self.weight = self._weight()
        self.step: tuple[Array, Array, Array] | None = None
        self.q = self._start = pin.neutral(self.model) if start is None else start
        self._state_of: Array | None = None
        self._made: tuple[Array, Array] = np.zeros(0), self._start
        self.chart = Chart(self.model, first)

    def index(self, joint: int) -> int:
        """Index of the body of one of Pinocchio's joints; -1, the world, for joint 0."""
        return self.first + joint - 1 if joint else -1

    @property
    def start_state(self) -> State:
        """The state that `state_at` and `state_of` move, at the start."""
        return self.state_of(self._start)

    @cached_property
    def _present(self) -> State:
        """The state that `state_at` and `state_of` move."""
        return State(self.model)

    def state_at(self, x: Array) -> State:
        """The kinematic state at the bodies x (count + 1, 7)."""
        if self._state_of is not x:
            self._present.update(self.posture_at(x))
            self._state_of = x
        return self._present

    def posture_at(self, x: Array) -> Array:
        """The posture (nq,), within limits, at all bodies x (n + 1, 7); that of the last `variables` is known."""
        made, q = self._made
        return q if np.array_equal(x[self.first : self.first + self.count], made) else self._posture(x)

    def state_of(self, q: Array) -> State:
        """The same at the posture q (nq,)."""
        self._state_of = None
        return self._present.update(q)

    def displacement(self) -> DisplacementRows:
        """One row for each degree of freedom: the figure's displacement from a posture."""
        return DisplacementRows(self.model, self.chart, self.posture_at)

    def choose_limits(self) -> None:
        """Set the rows of `limits` to the limits that are nearer at the last posture."""
        value = self.q[self._places][self._limited]
        low, high = self.low[self._limited], self.high[self._limited]
        upper = high - value < value - low
        self.limits.bound = np.where(upper, high, low)
        self.limits.sign = np.where(upper, -1.0, 1.0)

    def _limit_rows(self) -> Angle:
        """One row for each limited revolute joint, its angle beyond a bound."""
        part, chosen = self.angles, self._limited
        labels, bound = [part.labels[k] for k in chosen], self.low[chosen].copy()
        return Angle(part.bodies[chosen], labels, part.forms[chosen], part.center[chosen], bound, np.ones(len(chosen)))

    def retract(self, x: Array) -> None:
        """Move the figure's bodies, among the variables x (7 n,), to the nearest posture, which becomes `q`."""
        self.q = self.posture(x)
        x[7 * self.first : 7 * (self.first + self.count)] = self.variables(self.q)

    def variables(self, q: Array) -> Array:
        """The bodies (7 count,) at the posture q (nq,)."""
        pin.forwardKinematics(self.model, self.data, q)
        if self._placements is None:
            places = np.array([[*M.rotation.T, M.translation] for M in self.data.oMi])
        else:
            places = self._placements
        bodies = np.empty((self.count, 7))
        bodies[:, :3] = places[1:, 3]
        bodies[:, 3:] = quaternions(places[1:, :3].transpose(0, 2, 1))
        self._made = bodies, q
        result: Array = bodies.flatten()  # a copy
        return result

    def posture(self, x: Array) -> Array:
        """The posture (nq,), within limits, at all variables x (7 n,): each joint from its own two bodies."""
        return self._posture(with_world(x))

    def _posture(self, bodies: Array) -> Array:
        q = pin.neutral(self.model)
        q[self._places] = self.angles.angle(bodies)
        for joint in self._others:
            kind = self.model.joints[joint]
            parent, child = (bodies[self.index(int(one))] for one in (self.model.parents[joint], joint))
            before = pin.XYZQUATToSE3(_unit(parent)) * self.model.jointPlacements[joint]
            place = before.actInv(pin.XYZQUATToSE3(_unit(child)))
            if kind.nq == 7:
                q[kind.idx_q : kind.idx_q + 7] = pin.SE3ToXYZQUAT(place)
            elif kind.nq == 4:
                q[kind.idx_q : kind.idx_q + 4] = pin.Quaternion(place.rotation).coeffs()
            elif kind.nq == 2:
                axes = axes_with_z(_axis(kind)[None])[0]
                turn = pin.Quaternion(axes).toRotationMatrix().T @ place.rotation @ pin.Quaternion(axes).matrix()
                q[kind.idx_q : kind.idx_q + 2] = np.array((turn[0, 0], turn[1, 0])) / np.hypot(turn[0, 0], turn[1, 0])
            else:
                q[kind.idx_q] = place.translation @ _axis(kind)
        if self.step is not None:
            start, lower, upper = self.step
            motion = np.asarray(pin.difference(self.model, start, q))
            # all joints by the same share: clipping them one by one would change the direction of the motion
            room = np.where(motion > 0.0, upper, -lower)
            share = float(np.min(room / np.maximum(np.abs(motion), 1e-300), initial=1.0))
            q = pin.integrate(self.model, start, share * motion)
        result: Array = self.figure.clamp(q)
        return result

    def _add(self, joint: int) -> None:
        model, equations = self.model, self.equations
        kind, parent, placement = model.joints[joint], int(model.parents[joint]), model.jointPlacements[joint]
        name, label = kind.shortname(), f"the joint {model.names[joint]!r}"
        if follows(kind):
            self._add_follower(joint)
            return
        a, b = self.index(parent), self.index(joint)
        place, turn = np.array(placement.translation), pin.Quaternion(placement.rotation)
        if name == "JointModelFreeFlyer":
            self._others.append(joint)
        elif name == "JointModelSpherical":
            equations.coincide(a, b, label, place, np.zeros(3))
            self._others.append(joint)
        elif name.startswith("JointModelR") and kind.nv == 1:
            basis = pin.Quaternion(axes_with_z(_axis(kind)[None])[0])
            equations.coincide(a, b, label, place, np.zeros(3))
            equations.turn(a, b, label, turn * basis, basis, 2)
            if kind.nq == 1:
                self._turning.append((joint, parent, (turn * basis).coeffs(), basis.coeffs()))
            else:
                self._others.append(joint)
        elif name.startswith("JointModelP") and kind.nq == kind.nv == 1:
            axis = _axis(kind)
            basis = pin.Quaternion(axes_with_z(axis[None])[0])
            equations.turn(a, b, label, turn * basis, basis, 3)
            sides = (turn * basis).toRotationMatrix().T[:2]
            equations.slide(a, b, label, sides, np.zeros(3), sides @ place)
            along = turn * axis
            low, high = model.lowerPositionLimit[kind.idx_q], model.upperPositionLimit[kind.idx_q]
            for bound, sign in ((low, 1.0), (high, -1.0)):
                if np.isfinite(bound):
                    height = sign * float(along @ place + bound)
                    equations.slide(a, b, f"the limit of {label[4:]}", sign * along, np.zeros(3), height, ONE_SIDED)
            self._others.append(joint)
        else:
            raise UnsupportedTermError("newton", [f"{label}, a {name} (figure.reduced can lock it)"])

    def _add_follower(self, joint: int) -> None:
        """The equations of a joint that follows another: those of its kind, and its value by that of the other."""
        model, label = self.model, f"the joint {self.model.names[joint]!r}"
        law = self.figure.followers[model.names[joint]]
        values = self._value(joint), self._value(model.getJointId(law.joint))
        a, b = self.index(int(model.parents[joint])), self.index(joint)
        placement, axis = model.jointPlacements[joint], _axis(model.joints[joint])
        turn, basis = pin.Quaternion(placement.rotation), pin.Quaternion(axes_with_z(axis[None])[0])
        if isinstance(values[0], Angle):
            self.equations.coincide(a, b, label, np.array(placement.translation), np.zeros(3))
        else:
            sides = (turn * basis).toRotationMatrix().T[:2]
            self.equations.slide(a, b, label, sides, np.zeros(3), sides @ placement.translation)
        self.equations.turn(a, b, label, turn * basis, basis, 2 if isinstance(values[0], Angle) else 3)
        self.equations.add(Following(self.first + np.arange(self.count), label, values, law), HARD)

    def _value(self, joint: int) -> Batch:
        """The row that is the value of a joint that turns about one axis, or slides along one."""
        model, label = self.model, f"the joint {self.model.names[joint]!r}"
        bodies = np.array([[self.index(int(model.parents[joint])), self.index(joint)]])
        placement, (slide, turn) = model.jointPlacements[joint], _screw(model.joints[joint]).reshape(2, 3)
        if slide.any():
            along = placement.rotation @ slide
            return Slide(
                bodies, [label], along[None, None], np.zeros((1, 3)), np.array([[along @ placement.translation]])
            )
        basis = pin.Quaternion(axes_with_z(turn[None])[0])
        ends = ((pin.Quaternion(placement.rotation) * basis).coeffs()[None], basis.coeffs()[None])
        index = model.joints[joint].idx_q
        middle = 0.5 * (model.lowerPositionLimit[index] + model.upperPositionLimit[index])
        middle = middle if np.isfinite(middle) else 0.0
        return Angle(bodies, [label], relative_forms(*ends)[:, 2:], np.array([middle]), np.zeros(1), np.ones(1))

    def _weight(self) -> Array:
        """Weights: a rotation of a body counts as the motion of its farthest point."""
        size = np.full(self.count, 0.1)  # m: of a body without pieces; smaller = its rotations have less weight
        for joint in range(1, self.model.njoints):
            parent = int(self.model.parents[joint])
            if parent:
                reach = float(np.linalg.norm(self.model.jointPlacements[joint].translation))
                size[parent - 1] = max(size[parent - 1], reach)
        for frame in self.model.frames:
            if frame.parentJoint:
                reach = float(np.linalg.norm(frame.placement.translation))
                size[frame.parentJoint - 1] = max(size[frame.parentJoint - 1], reach)
        result: Array = np.concatenate([np.ones((self.count, 3)), np.tile((2.0 * size)[:, None] ** 2, 4)], axis=1)
        return result.ravel()


def _screw(kind: Any) -> Array:
    """The motion (6,) of a joint of one degree of freedom at unit speed; Pinocchio gives that of a leader's."""
    return np.array(kind.createData().S).ravel() / (kind.extract().scaling if follows(kind) else 1.0)


def _axis(kind: Any) -> Array:
    """Unit axis (3,) of a joint that slides along one or turns about one."""
    slide, turn = _screw(kind).reshape(2, 3)
    return slide if slide.any() else turn


def _unit(body: Array) -> Array:
    result: Array = body.copy()
    result[3:] /= np.linalg.norm(result[3:])
    return result
