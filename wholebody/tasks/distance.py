"""Measures that are squared distances: efforts, `Displacement`, and the squared error of a goal that may give way."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import instance
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import Expansion, Goal, Measure, filled

LEAST_CURVATURE = 1e-6
"""Curvature [1/rad^2] of degrees of freedom without weight: positive, as methods require, and far below any in use."""


class SumOfSquares(Measure):
    """A measure that is the sum of the squares of its residuals r, with the derivatives R of `squares`."""

    @abstractmethod
    def squares(self, state: State) -> tuple[Array, Array]:
        """Residuals (k,) and their derivatives (k, nv), always as many."""

    def value(self, state: State) -> float:
        """``r' r``."""
        residuals = self.squares(state)[0]
        return float(residuals @ residuals)

    def gradient(self, state: State) -> Array:
        """(nv,) ``2 R' r``."""
        residuals, rows = self.squares(state)
        return np.asarray(2.0 * residuals @ rows)

    def curvature(self, state: State) -> Array:
        """(nv,) that of the residuals' derivatives, `curvature_of`."""
        return self.curvature_of(self.squares(state)[1], state)

    def curvature_of(self, rows: Array, state: State) -> Array:
        """(nv,) row sums of ``2 |R|' |R|``, which bound the second derivative of Gauss and Newton."""
        steep = np.abs(rows)
        return np.asarray(2.0 * steep.sum(axis=1) @ steep + LEAST_CURVATURE)

    def expansion(self, state: State) -> Expansion:
        """All of these from the same residuals."""
        residuals, rows = self.squares(state)
        gradient = np.asarray(2.0 * residuals @ rows)
        return Expansion(float(residuals @ residuals), gradient, self.curvature_of(rows, state), rows)


class SquaredDistance(NamedTuple):
    """``sum_i w_i d_i^2`` with d the tangent vector (nv,) from a reference posture."""

    reference: Array  # (nq,) posture that has distance zero
    weights: Array  # (nv,) not negative
    curvature: Array  # (nv,) positive diagonal of the second derivative

    @classmethod
    def build(cls, reference: Array, weights: Array) -> SquaredDistance:
        """Distance of postures from `reference`."""
        weights = np.array(weights, dtype=float)
        curvature = np.maximum(2.0 * weights, LEAST_CURVATURE)
        return cls(np.array(reference, dtype=float), weights, curvature)

    def value(self, state: State) -> float:
        """The distance."""
        difference = pin.difference(state.model, self.reference, state.q)
        return float(self.weights @ (difference * difference))

    def gradient(self, state: State) -> Array:
        """(nv,) its derivative."""
        force = 2.0 * self.weights * pin.difference(state.model, self.reference, state.q)
        return np.asarray(force @ self._derivative(state))

    def squares(self, state: State) -> tuple[Array, Array]:
        """Residuals (k,) whose squares the distance is the sum of, and their derivatives (k, nv)."""
        counts = np.flatnonzero(self.weights)
        roots = np.sqrt(self.weights[counts])
        difference = pin.difference(state.model, self.reference, state.q)
        return roots * difference[counts], roots[:, None] * self._derivative(state)[counts]

    def _derivative(self, state: State) -> Array:
        """(nv, nv) derivative of d."""
        if state.model.nq == state.model.nv:
            return np.eye(state.model.nv)
        return np.asarray(pin.dDifference(state.model, self.reference, state.q, pin.ARG1))


class DistanceMeasure(Measure):
    """A measure that is a weighted squared distance from a posture."""

    distance: SquaredDistance  # the posture, and the weight of every degree of freedom; once resolved

    def value(self, state: State) -> float:
        """The distance [rad^2]."""
        return self.distance.value(state)

    def gradient(self, state: State) -> Array:
        """(nv,) derivative [rad]."""
        return self.distance.gradient(state)

    def curvature(self, state: State) -> Array:
        """(nv,) second derivative; exact for joints of one degree of freedom."""
        return self.distance.curvature


@dataclass(frozen=True, eq=False)
class Effort(DistanceMeasure):
    """Squared displacement of every joint from the start, weighted by joint [rad^2].

    ``sum_i gamma_i (q_i - q_i_start)^2`` (Marler and Arora's effort; eq. 2.5 of the thesis on posture prediction), with
    the figure's `effort_weights` for gamma: moving the spine costs more than moving an arm.

    The angles of a ball joint that is made of three hinges count one by one, which is not the square of its rotation
    vector: near an arm stretched to the side two of them turn it alike. `RotationEffort` counts the rotation vector;
    docs/theory/person.md says how far the two are apart.

    Attributes:
        weight: factor on the measure [1/rad^2].

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> least = wb.Effort(weight=1.0)
    """

    weight: inputs.Weight = 1.0
    distance: SquaredDistance = field(init=False, repr=False)  # the start, and the weight of every degree of freedom

    def resolve(self, scene: Scene, start: Array) -> Effort:
        """Store the start."""
        return filled(self, distance=SquaredDistance.build(start, scene.figure.effort_weights))


def scaled(effort: Effort, factors: Mapping[int, float]) -> Effort:
    """A resolved effort with the weights at some places in the tangent multiplied by factors."""
    weights = effort.distance.weights.copy()
    weights[list(factors)] *= list(factors.values())
    return filled(effort, distance=SquaredDistance.build(effort.distance.reference, weights))


@dataclass(frozen=True, eq=False)
class Displacement(DistanceMeasure):
    """Squared displacement of every joint from the neutral posture, weighted by joint [rad^2].

    ``sum_i w_i (q_i - q_i_neutral)^2``, the joint displacement of Abdel-Malek and Arora 2013 ("Human Motion Simulation:
    Predictive Dynamics", chapter 3), with the figure's `neutral_weights` for w.

    Attributes:
        weight: factor on the measure [1/rad^2].

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> upright = wb.tasks.Displacement(weight=0.1)
    """

    weight: inputs.Weight = 1.0
    distance: SquaredDistance = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> Displacement:
        """Read the neutral posture and the weights of the figure."""
        figure = scene.figure
        return filled(self, distance=SquaredDistance.build(figure.neutral, figure.neutral_weights))


SAME = 1e-9
"""Metres between the centres of hinges, and cosine of the angle between their axes: rounding of a model's file."""


class BallJoint(NamedTuple):
    """Three hinges with one centre, whose axes are at right angles where all three angles are zero."""

    idx_q: tuple[int, int, int]  # places in the posture
    idx_v: tuple[int, int, int]  # the same in the tangent
    axes: Array  # (3, 3) a hinge's axis a row, in what carries the first hinge, where the angles are zero
    weights: Array  # (3,) of the rotation vector's part along each axis, not negative
    start: Array  # (3, 3) rotation of the last hinge against that of zero angles, at the start

    def turn(self, q: Array) -> tuple[Array, Array]:
        """Rotation (3, 3) at a posture, and the hinges' axes there (3, 3), an axis a column."""
        rotation, axes = np.eye(3), np.empty((3, 3))
        for k, place in enumerate(self.idx_q):
            axes[:, k] = rotation @ self.axes[k]
            rotation = rotation @ pin.exp3(self.axes[k] * float(q[place]))
        return rotation, axes

    def residuals(self, q: Array) -> tuple[Array, Array]:
        """Weighted parts of the rotation vector (3,), and their derivatives (3, 3) by the three angles."""
        # dv = J_l^-1(v) sum_k axis_k dq_k; J_l^-1 is the transpose of the right one (Chirikjian 2011, section 10.6).
        rotation, axes = self.turn(q)
        away = rotation @ self.start.T
        share = np.sqrt(self.weights)[:, None] * self.axes
        return share @ pin.log3(away), share @ pin.Jlog3(away).T @ axes


@dataclass(frozen=True, eq=False)
class RotationEffort(SumOfSquares):
    """Squared displacement of every joint from the start, a ball joint's by its rotation vector [rad^2].

    ``sum_i gamma_i d_i^2`` as in `Effort`, with the same weights; but of three hinges with one centre (shoulder, hip, a
    level of the spine) d is the rotation vector ``log(R R_start')`` along the hinges' axes at zero angles. It depends
    on the rotation alone: where two of the hinges' axes coincide, as in the T-pose, a turn of both that leaves the arm
    where it is costs nothing. It has a kink where a joint is turned by 180 degrees from the start.

    It is a sum of squares (see `Measure.squares`). For a figure without ball joints it is `Effort`.

    Attributes:
        weight: factor on the measure [1/rad^2].
        others: the start, and the weights of all other degrees of freedom; once resolved.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> least = wb.tasks.RotationEffort()
    """

    weight: inputs.Weight = 1.0
    balls: tuple[BallJoint, ...] = field(init=False, repr=False)  # the ball joints
    others: SquaredDistance = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> RotationEffort:
        """Find the ball joints, and store the start."""
        weights = np.array(scene.figure.effort_weights, dtype=float)
        balls = ball_joints(scene.model, start, weights)
        for ball in balls:
            weights[list(ball.idx_v)] = 0.0
        return filled(self, balls=balls, others=SquaredDistance.build(start, weights))

    def curvature_of(self, rows: Array, state: State) -> Array:
        """(nv,) that of the other joints, and row sums of the squares' second derivative of Gauss and Newton."""
        result: Array = self.others.curvature.copy()
        for ball in self.balls:
            steep = np.abs(ball.residuals(state.q)[1])
            result[list(ball.idx_v)] = 2.0 * steep.T @ steep.sum(axis=1) + LEAST_CURVATURE
        return result

    def squares(self, state: State) -> tuple[Array, Array]:
        """Residuals (k,) and their derivatives (k, nv): of each ball joint, then of the other joints that count."""
        residuals, rows = self.others.squares(state)
        made = np.zeros((3 * len(self.balls), state.model.nv))
        found = np.zeros(len(made))
        for k, ball in enumerate(self.balls):
            found[3 * k : 3 * k + 3], made[3 * k : 3 * k + 3, list(ball.idx_v)] = ball.residuals(state.q)
        return np.concatenate([found, residuals]), np.vstack([made, rows])


def ball_joints(model: Any, start: Array, weights: Array) -> tuple[BallJoint, ...]:
    """The ball joints of a model: three hinges in a row with one centre and axes at right angles."""
    state = State(model).update(pin.neutral(model))
    jacobian = pin.computeJointJacobians(model, state.data, state.q)
    found: list[BallJoint] = []
    taken: set[int] = set()
    for first in range(1, model.njoints):
        chain = _hinges_of_one_centre(model, first)
        if len(chain) < 3 or taken & set(chain):
            continue
        joints = [model.joints[joint] for joint in chain]
        carrier = state.data.oMi[model.parents[first]].rotation
        axes = np.array([carrier.T @ jacobian[3:, joint.idx_v] for joint in joints])
        if np.abs(axes @ axes.T - np.eye(3)).max() > SAME:
            continue
        taken |= set(chain)
        a, b, c = joints
        idx_q, idx_v = (a.idx_q, b.idx_q, c.idx_q), (a.idx_v, b.idx_v, c.idx_v)
        ball = BallJoint(idx_q, idx_v, axes, weights[list(idx_v)], np.eye(3))
        found.append(with_values(ball, start=ball.turn(start)[0]))
    return tuple(found)


def _hinges_of_one_centre(model: Any, first: int) -> list[int]:
    """A hinge and at most two after it in a row, as long as all have one centre."""
    chain: list[int] = []
    after = [first]
    while len(chain) < 3 and len(after) == 1:
        joint = model.joints[after[0]]
        centred = not chain or np.abs(model.jointPlacements[after[0]].translation).max() < SAME
        if not centred or (joint.nq, joint.nv) != (1, 1) or "JointModelR" not in joint.shortname():
            break
        chain += after
        after = [k for k in range(1, model.njoints) if model.parents[k] == chain[-1]]
    return chain


@dataclass(frozen=True, eq=False)
class Soft(SumOfSquares):
    """A goal as a preference: its squared error [m^2, rad^2], which is weighed against the other measures.

    Goals and constraints come first: where a preference cannot be met, or costs more than its weight, the answer is
    solved all the same. The error that is left is ``problem.measures[k].goal.error(state)``. Of a preference
    that stays far off "newton" converges slowly; take "qp". "ccd" and "placo" refuse it, and "dls" leaves it out.

    Attributes:
        goal: any goal, such as `wb.Point("left_palm", place)`. Its weight is a factor too.
        weight: factor on the squared error. `Effort` of a person who reaches is about 1: with a weight of 100, 0.1 m
            cost as much.

    Raises:
        InputError: no goal, or a weight out of range.

    Examples:
        >>> rather = wb.Soft(wb.Point("left_palm", (0.3, 0.3, 1.0)), weight=10.0)
    """

    goal: Goal
    weight: inputs.Weight = 100.0

    def __post_init__(self) -> None:
        """Check the goal."""
        super().__post_init__()
        instance(self.goal, Goal, "Soft: goal", 'give a goal such as wb.Point("left_palm", place)')

    def resolve(self, scene: Scene, start: Array) -> Soft:
        """Resolve the goal."""
        return filled(self, goal=self.goal.resolve(scene, start))

    @property
    def touching(self) -> tuple[tuple[str, str], ...]:
        """Those of the goal."""
        return self.goal.touching

    def squares(self, state: State) -> tuple[Array, Array]:
        """The error (m,) and its derivative (m, nv), times the root of the goal's weight."""
        error, part = self.goal.value_and_jacobian(state, self.goal.error)
        root = np.sqrt(self.goal.weight)
        return root * np.atleast_1d(error), root * state.dense_jacobian(part)
