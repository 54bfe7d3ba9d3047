"""What any method's answer is judged by, computed from the posture alone.

Independent of every method: it looks at all pairs without culling, reads Pinocchio's and coal's results through their
official getters, and takes contact normals' derivatives from Pinocchio's own joint Jacobians.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from math import inf
from typing import Any
from weakref import WeakKeyDictionary

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.optimize import nnls

from wholebody.checks import a, number, posture
from wholebody.errors import InputError
from wholebody.figures.state import State, Wrench
from wholebody.problem import Problem

Array = NDArray[np.float64]

ACTIVE = 1e-4  # m, rad: nearer to its bound than this a constraint may push back
FLAT = 1e-2  # share of the largest curvature below which a degree of freedom counts as having that much
MET = 1e-4  # m, rad: goals nearer than this count as met when optimality is judged


@dataclass(frozen=True)
class Assessment:
    """How good a posture is for a problem.

    Attributes:
        goal_error: largest distance left to a goal, metres.
        goal_angle: largest angle left to a goal, radians.
        penetration: depth of the deepest overlap of any pair, metres; 0 where nothing overlaps.
        least_distance: least signed distance of any pair, metres; inf without pairs.
        clearance_lack: by how much the worst pair misses the distance asked of it, metres.
        limit_violation: how far the worst joint is out of its limits, radians or metres.
        constraint_violation: how far the worst constraint is from holding, metres or radians.
        measure: weighted sum of the measures.
        optimality: first-order optimality, radians or metres, 0 at a perfect one: what no goal, limit, constraint or
            contact balances of the objective's gradient, divided by the objective's curvature; largest entry. The
            objective is the measures where the goals are met, else the squared goal errors.
        goal_errors: (goals,) norm of each goal's error, metres or radians (whichever is larger).
        seconds: wall time that the judgement itself took; a method's own time is its solution's less this.
    """

    goal_error: float
    goal_angle: float
    penetration: float
    least_distance: float
    clearance_lack: float
    limit_violation: float
    constraint_violation: float
    measure: float
    optimality: float
    goal_errors: tuple[float, ...]
    seconds: float = field(default=0.0, compare=False, repr=False)

    def holds(self, tolerance: float) -> bool:
        """Whether limits, constraints and clearances hold to a tolerance, metres and radians."""
        tolerance = number(tolerance, "tolerance", 0.0, inf)
        worst = max(self.limit_violation, self.constraint_violation, self.clearance_lack, self.penetration)
        return bool(worst <= tolerance)

    def met(self, tolerance: float) -> bool:
        """Whether the goals are met to a tolerance, metres and radians."""
        return bool(max(self.goal_error, self.goal_angle) <= number(tolerance, "tolerance", 0.0, inf))


def assess(problem: Problem, q: Array) -> Assessment:
    """Judge a posture.

    Args:
        problem: what was asked.
        q: (nq,) the posture.

    Raises:
        InputError: q has the wrong shape or a value that is not finite.
    """
    began = time.perf_counter()
    if not isinstance(problem, Problem):
        raise InputError(f"assess: problem is {a(type(problem))}, not a Problem; state one with wb.Problem(scene)")
    q = posture(q, problem.scene.model.nq)
    problem.check_fresh()
    if problem not in _PAIRS:
        _PAIRS[problem] = _Pairs(problem)
    pairs = _PAIRS[problem]
    pairs.move(q)
    state = pairs.state
    distance, angle, each = _goal_errors(problem, state)
    return Assessment(
        goal_error=distance,
        goal_angle=angle,
        penetration=max(0.0, -pairs.least) if np.isfinite(pairs.least) else 0.0,
        least_distance=pairs.least,
        clearance_lack=pairs.lack,
        limit_violation=_limit_violation(problem, q),
        constraint_violation=_constraint_violation(problem, state),
        measure=sum(term.weight * term.value(state) for term in problem.measures),
        optimality=_optimality(problem, state, pairs),
        goal_errors=each,
        seconds=time.perf_counter() - began,
    )


class _Pairs:
    """All pairs of a problem's scene, at one posture after the other; on data of its own."""

    def __init__(self, problem: Problem) -> None:
        """Allocate."""
        self.model, self.geometry = problem.scene.model, problem.scene.geometry
        self.clearances = problem.clearances
        self.state = State(self.model)
        self.results = pin.GeometryData(self.geometry)
        moves = [piece.parentJoint for piece in self.geometry.geometryObjects]
        sides = [(moves[pair.first], moves[pair.second]) for pair in self.geometry.collisionPairs]
        self._joints = np.array(sides, dtype=np.intp).reshape(-1, 2)  # that move the pieces of each pair; 0: none

    def move(self, q: Array) -> None:
        """Measure all pairs at the posture q."""
        self.state.update(q)
        pin.updateGeometryPlacements(self.model, self.state.data, self.geometry, self.results)
        pin.computeDistances(self.geometry, self.results)
        count = len(self.geometry.collisionPairs)
        self.distance = np.array([result.min_distance for result in self.results.distanceResults])
        if np.isnan(self.distance).any():
            raise InputError("a distance is not a number; an object's placement or shape is broken")
        self.least = float(self.distance.min()) if count else float("inf")
        self.lack = float(max(0.0, (self.clearances - self.distance).max())) if count else 0.0

    def gradients(self, problem: Problem, state: State) -> Array:
        """Derivatives (k, nv) of the gaps of all pairs that push: at every corner of their contact patch."""
        corners = [
            (pair, normal, point)
            for pair in np.flatnonzero(self.distance < problem.clearances + ACTIVE).tolist()
            for normal, point in self._patch(pair)
        ]
        rows = np.zeros((len(corners), state.model.nv))
        if not corners:
            return rows
        normals, points = np.array([corner[1] for corner in corners]), np.array([corner[2] for corner in corners])
        wrenches = np.hstack([normals, np.cross(points, normals)])
        joints = self._joints[[corner[0] for corner in corners]]
        for side, sign in ((1, 1.0), (0, -1.0)):
            for joint in set(joints[:, side].tolist()) - {0}:
                moved = joints[:, side] == joint
                rows[moved] += sign * wrenches[moved] @ pin.getJointJacobian(state.model, state.data, joint, pin.WORLD)
        return rows

    def _patch(self, pair: int) -> list[tuple[Array, Array]]:
        """Normal and place of the witness point and of the corners of the contact patch."""
        result = self.results.distanceResults[pair]
        normal = np.array(result.normal)
        if np.linalg.norm(normal) < 0.5:
            return []
        places = [np.array(result.getNearestPoint1())]
        first, second, placed_first, placed_second = self._placed(pair)
        request, contact = coal.CollisionRequest(), coal.CollisionResult()
        request.security_margin = float(self.distance[pair]) + ACTIVE
        coal.collide(first, placed_first, second, placed_second, request, contact)
        if contact.isCollision():
            patch = coal.ContactPatchResult()
            try:
                coal.computeContactPatch(
                    first, placed_first, second, placed_second, contact, coal.ContactPatchRequest(), patch
                )
                for number in range(patch.numContactPatches()):
                    polygon = patch.getContactPatch(number)
                    places += [np.array(polygon.getPoint(i)) for i in range(polygon.size())]
            except (RuntimeError, ValueError):
                pass  # coal has no patch for this pair of shapes; the witness point stands alone
        return [(normal, place) for place in places]

    def _placed(self, pair: int) -> tuple[Any, Any, Any, Any]:
        index = self.geometry.collisionPairs[pair]
        pieces = [self.geometry.geometryObjects[i].geometry for i in (index.first, index.second)]
        places = [self.results.oMg[i] for i in (index.first, index.second)]
        return (*pieces, *(coal.Transform3s(place.rotation, place.translation) for place in places))


_PAIRS: WeakKeyDictionary[Problem, _Pairs] = WeakKeyDictionary()


def _goal_errors(problem: Problem, state: State) -> tuple[float, float, tuple[float, ...]]:
    distances, angles, each = [0.0], [0.0], []
    for goal in problem.goals:
        error = np.atleast_1d(goal.error(state))
        angular = np.broadcast_to(goal.angular, error.shape)
        distances.append(float(np.linalg.norm(error[~angular])))
        angles.append(float(np.linalg.norm(error[angular])))
        each.append(max(distances[-1], angles[-1]))
    return max(distances), max(angles), tuple(each)


def _limit_violation(problem: Problem, q: Array) -> float:
    limits = problem.scene.figure.limits
    values = q[limits.idx_q]
    return float(np.maximum(limits.lower - values, values - limits.upper).max(initial=0.0))


def _constraint_violation(problem: Problem, state: State) -> float:
    worst = 0.0
    for constraint in problem.constraints:
        value = np.atleast_1d(constraint.value(state))
        worst = max(worst, float(np.maximum(constraint.lower - value, value - constraint.upper).max(initial=0.0)))
    return worst


def _dense(part: Wrench | Array, state: State) -> Array:
    return state.wrench_jacobian(part) if isinstance(part, Wrench) else np.atleast_2d(part)


def _optimality(problem: Problem, state: State, pairs: _Pairs) -> float:
    """What is left of the objective's gradient after the best nonnegative combination of all active gradients."""
    nv = state.model.nv
    goals = [(np.atleast_1d(goal.error(state)), _dense(goal.jacobian(state), state), goal) for goal in problem.goals]
    met = all(np.abs(error).max(initial=0.0) <= MET for error, _, _ in goals)
    if met:
        objective = sum((term.weight * term.gradient(state) for term in problem.measures), np.zeros(nv))
        curvature = sum((term.weight * term.curvature(state) for term in problem.measures), np.zeros(nv))
        free = [jacobian for _, jacobian, _ in goals]
    else:
        objective = sum((goal.weight * error @ jacobian for error, jacobian, goal in goals), np.zeros(nv))
        curvature = sum((goal.weight * (jacobian**2).sum(axis=0) for _, jacobian, goal in goals), np.zeros(nv))
        free = []
    pushing = [pairs.gradients(problem, state)]
    for constraint in problem.constraints:
        value = np.atleast_1d(constraint.value(state))
        jacobian = _dense(constraint.jacobian(state), state)
        low = value <= constraint.lower + ACTIVE
        high = value >= constraint.upper - ACTIVE
        free.append(jacobian[low & high])
        pushing += [jacobian[low & ~high], -jacobian[high & ~low]]
    lower, upper = problem.scene.figure.tangent_bounds(state.q)
    for bound in problem.bounds:
        low_bound, high_bound = bound.bounds(state, None)
        lower, upper = np.maximum(lower, low_bound), np.minimum(upper, high_bound)
    identity = np.eye(nv)
    pushing += [identity[lower >= -ACTIVE], -identity[upper <= ACTIVE]]
    signed, one_sided = np.vstack([np.zeros((0, nv)), *free]), np.vstack(pushing)
    scale = np.maximum(curvature, FLAT * curvature.max(initial=0.0))
    if not scale.any():
        return 0.0
    rows = np.vstack([signed, -signed, one_sided])
    left = objective
    if len(rows):
        push, _ = nnls(rows.T, objective, maxiter=20 * (len(rows) + nv))
        left = objective - push @ rows
    return float((np.abs(left) / scale).max())
