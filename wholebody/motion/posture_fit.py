"""Postures that bring points and frames of a figure nearest to given ones: Levenberg-Marquardt within hard limits.

`Fitter.fit` does so for one frame, `smooth` for all frames of a motion with their accelerations. A step of a frame is a
quadratic program: least squares of the linearised errors, subject to joint limits and to reach cones to first order.
Limits hold exactly, cones to second order of the last step; a step that leaves a cone further than before is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import daqp
import numpy as np
import pinocchio as pin
from scipy.linalg import LinAlgError, solveh_banded

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.figures.figure import Figure
from wholebody.figures.state import State

STEP = 0.6  # rad: largest change of a joint in one iteration; beyond it the linearisation says little
CONE_MARGIN, CONE_SLACK = 2e-3, 1e-6  # rad: inside of a cone that rows aim at, as they are curved; outside, of rounding


class Goals(NamedTuple):
    """What one frame is to reach.

    Attributes:
        points: (p, 3) where the points are to be, metres.
        point_weights: (p,) weight of each distance.
        turns: (t, 3, 3) orientations that frames are to have.
        turn_weights: (t,) weight of each angle, metres per radian.
        posture: (nq,) a posture to stay near to.
        posture_weights: (nv,) weight of each difference from it, metres per radian.
    """

    points: Array
    point_weights: Array
    turns: Array
    turn_weights: Array
    posture: Array
    posture_weights: Array


class Fitter:
    """Fits postures of a figure; it has a workspace of its own, so each thread needs one.

    Attributes:
        figure: the figure.
    """

    def __init__(self, figure: Figure, points: list[str], turns: list[str]) -> None:
        """Choose the frames whose origins are the points, and those that have goals of orientation."""
        self.figure, self.model = figure, figure.model
        self._state = State(figure.model)
        self._point_joints, self._point_parts = self._carried(points)
        self._turn_joints, self._turn_parts = self._carried(turns)
        self._joints = np.concatenate([np.repeat(self._point_joints, 3), np.repeat(self._turn_joints, 3)])
        self._world = np.zeros(len(self._joints), dtype=np.intp)
        count = len(points)
        self._wrenches = np.zeros((len(self._joints), 6))
        for axis in range(3):
            self._wrenches[axis : 3 * count : 3, axis] = 1.0
            self._wrenches[3 * count + axis :: 3, 3 + axis] = 1.0
        self._cones = list(figure.cones.values())
        self._limb_joints, limb_parts = self._carried([cone.limb for cone in self._cones])
        self._base_joints, base_parts = self._carried([cone.reference for cone in self._cones])
        self._base_turns = base_parts[:, :3]
        self._axes = np.array([part[:3] @ cone.axis for part, cone in zip(limb_parts, self._cones, strict=True)])
        self._free = 6 if figure.root == "free" else 0
        self._identity = np.eye(self.model.nv)

    def _carried(self, frames: list[str]) -> tuple[Indices, Array]:
        """The joint that carries each frame, and in it the frame's rotation (3, 3) over its place: (k, 4, 3)."""
        found = [self.model.frames[self.figure.frame_id(name)] for name in frames]
        parts = [np.vstack([frame.placement.rotation, frame.placement.translation]) for frame in found]
        return np.array([frame.parentJoint for frame in found], dtype=np.intp), np.array(parts).reshape(-1, 4, 3)

    def places(self, q: Array) -> Array:
        """(p, 3) where the points are."""
        self._state.update(q)
        return self._places()

    def turns(self, q: Array) -> Array:
        """(t, 3, 3) orientations of the frames."""
        self._state.update(q)
        return self._orientations()

    def _places(self) -> Array:
        at = self._state.joints[self._point_joints]
        return np.asarray(np.einsum("pki,pk->pi", at[:, :3], self._point_parts[:, 3]) + at[:, 3])

    def _orientations(self) -> Array:
        at = self._state.joints[self._turn_joints]
        return np.asarray(np.swapaxes(at[:, :3], 1, 2) @ self._turn_parts[:, :3])

    def outside(self, q: Array) -> Mask:
        """(n,) which postures (n, nq) have a limb outside of its reach cone."""
        found = np.zeros(len(q), dtype=bool)
        if not self._cones:
            return found
        directions = np.array([self._directions() for posture in q if self._state.update(posture)])
        for row, cone in enumerate(self._cones):
            found |= np.array([cone.cone.signed_angle(each)[0] for each in directions[:, row]]) < -CONE_SLACK
        return found

    def _directions(self) -> Array:
        """(c, 3) directions of the limbs in the axes of their cones."""
        joints = self._state.joints
        worlds = np.einsum("cki,ck->ci", joints[self._limb_joints][:, :3], self._axes)
        found: Array = np.einsum("cki,ci->ck", joints[self._base_joints][:, :3], worlds)
        return np.asarray(np.einsum("ckj,ck->cj", self._base_turns, found))

    def cost(self, q: Array, goals: Goals, cones: float = 0.0) -> float:
        """Half the sum of the squared weighted errors; `cones` weighs angles outside of reach cones, m/rad."""
        self._state.update(q)
        errors, posture = self._errors(q, goals)
        cost = 0.5 * float(errors @ errors + posture @ posture)
        if cones and self._cones:
            cost += 0.5 * float(((cones * np.minimum(self._angles() - CONE_MARGIN, 0.0)) ** 2).sum())
        return cost

    def quadratic(self, q: Array, goals: Goals, cones: float = 0.0) -> tuple[Array, Array, float]:
        """Gradient (nv,) and Gauss-Newton matrix (nv, nv) of the cost, and the cost."""
        gradient, hessian = self._quadratic(q, goals)
        errors, posture = self._errors(q, goals)
        cost = 0.5 * float(errors @ errors + posture @ posture)
        if cones and self._cones:
            short = cones * np.minimum(self._angles() - CONE_MARGIN, 0.0)
            if short.any():
                rows = cones * self._cone_rows()[short < 0.0]
                short = short[short < 0.0]
                gradient, hessian = gradient + rows.T @ short, hessian + rows.T @ rows
                cost += 0.5 * float(short @ short)
        return gradient, hessian, cost

    def bounds(self, q: Array) -> tuple[Array, Array]:
        """Least and greatest step (nv,) within the limits, and not too long for the linearisation."""
        lower, upper = self.figure.tangent_bounds(q)
        lower, upper = np.maximum(lower, -STEP), np.minimum(upper, STEP)
        lower[: self._free], upper[: self._free] = -10.0, 10.0  # m, rad
        return lower, upper

    def fit(
        self, q: Array, goals: Goals, iterations: int, cones: bool = True, tolerance: float = 1e-3
    ) -> tuple[Array, float]:
        """The posture of least cost that a descent from q finds; q is moved within its limits first.

        Args:
            q: (nq,) where the descent begins.
            goals: what is to be reached.
            iterations: at most.
            cones: whether reach cones are kept; without them a fit takes half of the time.
            tolerance: radians; the descent ends at a step that is smaller.

        Returns:
            The posture, and its cost.
        """
        q = self.figure.clamp(q)
        cost, damping = self.cost(q, goals), 1e-4  # m²/rad², the least
        cones = cones and bool(self._cones)
        inside = self._angles() if cones else np.zeros(0)
        for _ in range(iterations):
            gradient, hessian = self._quadratic(q, goals)
            rows = self._cone_rows() if cones else np.zeros((0, self.model.nv))
            while True:
                step = self._program(q, gradient, hessian + damping * self._identity, rows, inside)
                if step is None:
                    return q, cost
                trial = self.figure.clamp(pin.integrate(self.model, q, step))
                tried = self.cost(trial, goals)
                left = self._angles() if cones else inside
                kept = bool((left >= np.minimum(inside, 0.0) - CONE_SLACK).all())
                if kept and (tried <= cost or (inside < 0.0).any()):
                    break
                damping *= 8.0
                if damping > 1e3:
                    return q, cost
            done = (cost - tried < 1e-4 * cost or np.abs(step).max() < tolerance) and not (left < -CONE_SLACK).any()
            q, cost, inside, damping = trial, tried, left, max(1e-4, damping / 8.0)
            if done:
                break
        return q, cost

    def _errors(self, q: Array, goals: Goals) -> tuple[Array, Array]:
        """Weighted errors of points and orientations (3 p + 3 t,), and of the posture (nv,)."""
        errors = np.empty(len(self._joints))
        points = 3 * len(self._point_joints)
        errors[:points] = (goals.point_weights[:, None] * (self._places() - goals.points)).ravel()
        left = self._orientations() @ np.swapaxes(goals.turns, 1, 2)
        for k, turn in enumerate(left):
            errors[points + 3 * k : points + 3 * k + 3] = goals.turn_weights[k] * pin.log3(turn)
        return errors, goals.posture_weights * pin.difference(self.model, goals.posture, q)

    def _quadratic(self, q: Array, goals: Goals) -> tuple[Array, Array]:
        """Gradient (nv,) and Gauss-Newton matrix (nv, nv) of the cost."""
        self._state.update(q)
        errors, posture = self._errors(q, goals)
        x, y, z = self._places().T
        count = 3 * len(x)
        wrenches = self._wrenches  # rows of a point p along n are [n, p x n]
        wrenches[0:count:3, 4], wrenches[0:count:3, 5] = z, -y
        wrenches[1:count:3, 3], wrenches[1:count:3, 5] = -z, x
        wrenches[2:count:3, 3], wrenches[2:count:3, 4] = y, -x
        rows = self._state.rows(wrenches, self._joints, self._world)
        weights = np.repeat(np.concatenate([goals.point_weights, goals.turn_weights]), 3)
        rows = rows * weights[:, None]
        gradient: Array = rows.T @ errors + goals.posture_weights * posture
        hessian: Array = rows.T @ rows
        hessian[np.diag_indices(len(hessian))] += goals.posture_weights**2
        return gradient, hessian

    def _angles(self) -> Array:
        """(c,) angle of each limb to the edge of its cone, radians, positive inside."""
        directions = self._directions()
        return np.array([cone.cone.signed_angle(along)[0] for cone, along in zip(self._cones, directions, strict=True)])

    def _cone_rows(self) -> Array:
        """(c, nv) rows of these angles."""
        wrenches = np.zeros((len(self._cones), 6))
        for row, (cone, along) in enumerate(zip(self._cones, self._directions(), strict=True)):
            turn = self._state.joints[self._base_joints[row], :3].T @ self._base_turns[row]
            wrenches[row, 3:] = np.cross(turn @ along, turn @ cone.cone.signed_angle(along)[1])
        return self._state.rows(wrenches, self._limb_joints, self._base_joints)

    def _program(self, q: Array, gradient: Array, hessian: Array, rows: Array, inside: Array) -> Array | None:
        """The step within the limits; None where there is none."""
        lower, upper = self.bounds(q)
        low, high = np.empty(len(lower) + len(rows)), np.full(len(lower) + len(rows), 1e30)
        low[: len(lower)], high[: len(lower)] = lower, upper
        # A limb outside of its cone returns by half a step at a time; nearer to the edge it stays inside.
        low[len(lower) :] = np.minimum(CONE_MARGIN - inside, 0.5 * STEP)
        x, _, flag, _ = daqp.solve(hessian, gradient, rows, high, low, np.zeros(len(low), dtype=np.int32))
        return np.asarray(x) if flag > 0 else None


def smooth(
    fitter: Fitter, q: Array, goals: Callable[[int], Goals], dt: float, iterations: int, told: Callable[[], None]
) -> Array:
    """The postures (n, nq) of least sum of costs and squared accelerations, by descent from q within the limits."""
    if len(q) < 3:
        return q
    # m²/rad²: where errors are left, their curvature is about the error times a limb's length, which Gauss-Newton omits
    damping = 3e-3
    for _ in range(iterations):
        q, damping = _iteration(fitter, q, goals, dt, damping)
        told()
    return q


def _iteration(
    fitter: Fitter, q: Array, goals: Callable[[int], Goals], dt: float, damping: float
) -> tuple[Array, float]:
    """Better postures, and the damping for the next iteration."""
    model, count, size = fitter.model, len(q), fitter.model.nv
    cones = 3.0  # m/rad: weight of an angle outside of a reach cone
    # 1e-4 m for each rad/s², and m/s² of the root: 900 rad/s² weigh as much as 90 mm
    weights = np.full(size, (1e-4 / dt**2) ** 2)
    gradients, blocks = np.empty((count, size)), np.empty((count, size, size))
    before = np.empty(count)
    for k in range(count):
        gradients[k], blocks[k], before[k] = fitter.quadratic(q[k], goals(k), cones)
    a = _second_differences(model, q)
    pulled = weights * a
    gradients[:-2] += pulled
    gradients[1:-1] -= 2.0 * pulled
    gradients[2:] += pulled
    lower, upper = (np.array(ends) for ends in zip(*(fitter.bounds(posture) for posture in q), strict=True))
    least = before.sum() + 0.5 * float((weights * a * a).sum())
    for _ in range(4):
        step = _bounded(blocks, gradients, weights, lower, upper, damping)
        trial = np.array([fitter.figure.clamp(pin.integrate(model, *pair)) for pair in zip(q, step, strict=True)])
        a = _second_differences(model, trial)
        cost = sum(fitter.cost(trial[k], goals(k), cones) for k in range(count))
        if cost + 0.5 * float((weights * a * a).sum()) <= least:
            return trial, damping / 10.0
        damping *= 10.0
    return q, damping


def _second_differences(model: pin.Model, q: Array) -> Array:
    """(n - 2, nv) displacement to the next frame plus that to the one before."""
    found = np.empty((len(q) - 2, model.nv))
    for k in range(1, len(q) - 1):
        found[k - 1] = pin.difference(model, q[k], q[k + 1]) + pin.difference(model, q[k], q[k - 1])
    return found


def _bounded(blocks: Array, gradients: Array, weights: Array, lower: Array, upper: Array, damping: float) -> Array:
    """The step (n, nv) within bounds; those that it would exceed are met, and the rest is solved again."""
    fixed: Mask = np.zeros(gradients.shape, dtype=bool)
    at = np.zeros_like(gradients)
    step = at
    for _ in range(3):  # in each more joints are kept at their limits
        step = _in_parts(blocks, gradients, weights, fixed, at, damping)
        beyond = ((step < lower) | (step > upper)) & ~fixed
        if not beyond.any():
            break
        fixed |= beyond
        at = np.where(fixed, np.clip(step, lower, upper), at)
    clipped: Array = np.clip(step, lower, upper)
    return clipped


def _in_parts(blocks: Array, gradients: Array, weights: Array, fixed: Mask, at: Array, damping: float) -> Array:
    """The step of all frames, from parts that overlap; in the middle of an overlap they are joined smoothly."""
    count, overlap = len(gradients), 60
    step, total = np.zeros_like(gradients), np.zeros(count)
    first = 0
    while True:
        last = min(count, first + 600)  # memory grows with it
        frames = slice(first, last)
        share = np.ones(last - first)
        if first:
            share[:overlap] = np.linspace(0.0, 1.0, overlap)
        if last < count:
            share[-overlap:] = np.minimum(share[-overlap:], np.linspace(1.0, 0.0, overlap))
        part = _solved(blocks[frames], gradients[frames], weights, fixed[frames], at[frames], damping)
        step[frames] += share[:, None] * part
        total[frames] += share
        if last == count:
            return step / total[:, None]
        first = last - overlap


def _solved(blocks: Array, gradients: Array, weights: Array, fixed: Mask, at: Array, damping: float) -> Array:
    """Solution of the banded system; what is fixed is held at its value."""
    count, size = gradients.shape
    stiff = np.where(fixed, 1e6, 0.0)  # m²/rad²
    band = np.zeros((2 * size + 1, count * size))  # row d has the entries (i + d, i), as scipy's lower form
    for offset in range(size):
        diagonal = np.zeros((count, size))
        diagonal[:, : size - offset] = np.diagonal(blocks, offset, axis1=1, axis2=2)
        band[offset] = diagonal.ravel()
    own, one, two = np.zeros(count), np.zeros(count), np.zeros(count)
    own[:-2] += 1.0
    own[1:-1] += 4.0
    own[2:] += 1.0
    one[:-2] -= 2.0
    one[1:-1] -= 2.0
    two[:-2] = 1.0
    band[0] += (own[:, None] * weights + stiff + damping).ravel()
    band[size] += (one[:, None] * weights).ravel()
    band[2 * size] += (two[:, None] * weights).ravel()
    right = (stiff * at - gradients).ravel()
    try:
        found: Array = solveh_banded(band, right, lower=True, overwrite_ab=True, check_finite=False)
    except LinAlgError:  # never where weights are finite and the damping is positive
        return np.zeros_like(gradients)
    return found.reshape(count, size)
