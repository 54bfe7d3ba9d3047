"""First-order optimality of a posture, and its blockers: the limits, constraints and contacts with large multipliers.

At an optimum the objective's gradient is a combination of the gradients of all active constraints, with nonnegative
multipliers for inequalities (Karush, Kuhn and Tucker). Nonnegative least squares finds the combination. Its residual
measures the distance from an optimum, and its largest parts are the blockers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import coal
import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.errors import InputError
from wholebody.figures.state import State, Wrench
from wholebody.geometry.guesses import Guesses
from wholebody.problem import Problem
from wholebody.scene_geometry import SceneGeometry

ACTIVE = 1e-4  # m, rad: a constraint nearer to its bound than this counts as active
FLAT = 1e-2  # share of the largest curvature below which a degree of freedom counts as having that much
MET = 1e-4  # m, rad: goals with smaller errors count as met, and constraints with smaller violations as holding
WORTH = 0.05  # share of the largest multiplier from which a constraint counts as a blocker


@dataclass(frozen=True)
class Blocker:
    """A limit, constraint or contact that blocks a better posture.

    Attributes:
        kind: "contact" between two owners, "limit" of a joint, "bound" on a joint (as by `Freeze`), or "constraint".
        names: the two segments or objects; the joint; or the constraint as in "constraints[0], Hold".
        share: its part of the gradient, relative to the strongest blocker, from 0 to 1.
        violated: whether it is violated at the posture.
        frame: name of the frame of a constraint on one frame.
    """

    kind: Literal["contact", "limit", "bound", "constraint"]
    names: tuple[str, ...]
    share: float
    violated: bool
    frame: str | None = None

    def __str__(self) -> str:
        """Describe it in words."""
        if self.kind == "contact":
            return f"{self.names[0]} against {self.names[1]}"
        return {"limit": "the limit of ", "bound": "the bound on ", "constraint": ""}[self.kind] + self.names[0]


Label = tuple[Literal["contact", "limit", "bound", "constraint"], tuple[str, ...]]


class _Rows:
    """Gradients of active constraints, with their labels."""

    def __init__(self, nv: int) -> None:
        self.rows, self.labels = [np.zeros((0, nv))], list[Label]()

    def add(self, rows: Array, labels: list[Label]) -> None:
        self.rows.append(rows)
        self.labels += labels


class AllPairs:
    """All pairs of a scene, at one posture at a time. It has its own data, and one assessment at a time uses it."""

    def __init__(self, built: SceneGeometry) -> None:
        """Allocate."""
        self.model, self.geometry, self._lock = built.model, built.geometry, built.lock
        self.state = State(self.model)
        self.results = pin.GeometryData(self.geometry)
        self._guesses = Guesses(self.results)
        self._owners = built.owners
        moves = [piece.parentJoint for piece in self.geometry.geometryObjects]
        sides = [(moves[pair.first], moves[pair.second]) for pair in self.geometry.collisionPairs]
        self._joints = np.array(sides, dtype=np.intp).reshape(-1, 2)  # joints that carry the pieces of a pair; 0: none

    def move(self, q: Array) -> None:
        """Compute the distances of all pairs at the posture q."""
        self.state.update(q)
        with self._lock:  # not while a thing is being moved, piece by piece
            pin.updateGeometryPlacements(self.model, self.state.data, self.geometry, self.results)
        self._guesses.forget()  # the assessment of a posture must not depend on the previous one
        pin.computeDistances(self.geometry, self.results)
        self.distance = np.array([result.min_distance for result in self.results.distanceResults])
        if np.isnan(self.distance).any():
            raise InputError("a distance is not a number; an object's placement or shape is broken")
        self.least = float(self.distance.min()) if len(self.distance) else float("inf")

    def gradients(self, problem: Problem, state: State) -> tuple[Array, list[int]]:
        """Derivatives (k, nv) of the gaps of all active pairs, at the corners of their patches; the pairs (k,)."""
        corners = [
            (pair, normal, point)
            for pair in np.flatnonzero(self.distance < problem.clearances + ACTIVE).tolist()
            for normal, point in self._patch(pair)
        ]
        rows = np.zeros((len(corners), state.model.nv))
        numbers = [corner[0] for corner in corners]
        if not corners:
            return rows, numbers
        normals, points = np.array([corner[1] for corner in corners]), np.array([corner[2] for corner in corners])
        wrenches = np.hstack([normals, np.cross(points, normals)])
        joints = self._joints[numbers]
        for side, sign in ((1, 1.0), (0, -1.0)):
            for joint in set(joints[:, side].tolist()) - {0}:
                moved = joints[:, side] == joint
                jacobian = pin.getJointJacobian(state.model, state.data, joint, pin.WORLD)
                rows[moved] += sign * wrenches[moved] @ jacobian.reshape(6, -1)  # of one degree of freedom it is (6,)
        return rows, numbers

    def label(self, pair: int) -> Label:
        """Label of a collision pair."""
        index = self.geometry.collisionPairs[pair]
        return "contact", (self._owners[index.first], self._owners[index.second])

    def _patch(self, pair: int) -> list[tuple[Array, Array]]:
        """Normal and position of the witness point and of the corners of the contact patch."""
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
                pass  # coal has no patch for this pair of shapes; only the witness point is used
        return [(normal, place) for place in places]

    def _placed(self, pair: int) -> tuple[Any, Any, Any, Any]:
        index = self.geometry.collisionPairs[pair]
        pieces = [self.geometry.geometryObjects[i].geometry for i in (index.first, index.second)]
        places = [self.results.oMg[i] for i in (index.first, index.second)]
        return (*pieces, *(coal.Transform3s(place.rotation, place.translation) for place in places))


def _dense(part: Wrench | Array, state: State) -> Array:
    return state.wrench_jacobian(part) if isinstance(part, Wrench) else np.atleast_2d(part)


def optimality(problem: Problem, state: State, pairs: AllPairs) -> float:
    """Residual of the objective's gradient after the best combination of all active gradients; see `Assessment`."""
    nv = state.model.nv
    goals = [(np.atleast_1d(goal.error(state)), _dense(goal.jacobian(state), state), goal) for goal in problem.goals]
    met = all(np.abs(error).max(initial=0.0) <= MET for error, _, _ in goals)
    signed, one_sided = _active(problem, state, pairs)
    if met:
        objective = sum((term.weight * term.gradient(state) for term in problem.measures), np.zeros(nv))
        curvature = sum((term.weight * term.curvature(state) for term in problem.measures), np.zeros(nv))
        signed.rows += [jacobian for _, jacobian, _ in goals]
    else:
        objective = sum((goal.weight * error @ jacobian for error, jacobian, goal in goals), np.zeros(nv))
        curvature = sum((goal.weight * (jacobian**2).sum(axis=0) for _, jacobian, goal in goals), np.zeros(nv))
    scale = np.maximum(curvature, FLAT * curvature.max(initial=0.0))
    if not scale.any():
        return 0.0
    _, left = _balanced(objective, signed, one_sided)
    return float((np.abs(left) / scale).max())


def blockers(problem: Problem, state: State, pairs: AllPairs) -> tuple[Blocker, ...]:
    """The constraints that block the goals, or the repair of violations; the strongest first.

    If something is violated, the violated constraints come first, ordered by violation, then those that block repair.
    """
    nv = state.model.nv
    signed, one_sided = _active(problem, state, pairs)
    pull = np.zeros(nv)
    violated: dict[Label, float] = {}
    for number in np.flatnonzero(pairs.distance < problem.clearances - MET).tolist():
        violated[pairs.label(number)] = float(problem.clearances[number] - pairs.distance[number])
    for number, constraint in enumerate(problem.constraints):
        value = np.atleast_1d(constraint.value(state))
        missed = np.minimum(value - constraint.lower, 0.0) + np.maximum(value - constraint.upper, 0.0)
        if np.abs(missed).max(initial=0.0) > MET:
            violated[_constraint(number, constraint)] = float(np.abs(missed).max())
            pull += missed @ _dense(constraint.jacobian(state), state)
    if violated:
        rows, numbers = pairs.gradients(problem, state)
        for row, number in zip(rows, numbers, strict=True):
            pull -= violated.get(pairs.label(number), 0.0) * row
        signed, one_sided = _without(signed, violated), _without(one_sided, violated)
    else:
        for goal in problem.goals:
            pull += goal.weight * np.atleast_1d(goal.error(state)) @ _dense(goal.jacobian(state), state)
    push, _ = _balanced(pull, signed, one_sided)
    found: dict[Label, float] = {}
    for label, size in zip([*signed.labels, *one_sided.labels], push.tolist(), strict=True):
        found[label] = found.get(label, 0.0) + size
    most, deepest = max(found.values(), default=0.0), max(violated.values(), default=0.0)
    frames = {_constraint(k, term): getattr(term, "frame", None) for k, term in enumerate(problem.constraints)}
    first = [Blocker(*label, size / deepest, True, frames.get(label)) for label, size in violated.items()]
    second = [
        Blocker(*label, size / most, False, frames.get(label)) for label, size in found.items() if size > WORTH * most
    ]
    return tuple(part for group in (first, second) for part in sorted(group, key=lambda blocker: -blocker.share))


def _without(rows: _Rows, labels: dict[Label, float]) -> _Rows:
    kept = np.array([label not in labels for label in rows.labels], dtype=bool)
    left = _Rows(rows.rows[0].shape[1])
    left.add(np.vstack(rows.rows)[kept], [label for label, keep in zip(rows.labels, kept, strict=True) if keep])
    return left


def _constraint(number: int, constraint: Any) -> Label:
    name = getattr(constraint, "frame", None)
    return "constraint", (f"constraints[{number}], {type(constraint).__name__}" + (f"({name!r})" if name else ""),)


def _active(problem: Problem, state: State, pairs: AllPairs) -> tuple[_Rows, _Rows]:
    """Gradients of all active constraints: those of equalities, and those of inequalities."""
    nv = state.model.nv
    signed, one_sided = _Rows(nv), _Rows(nv)
    rows, numbers = pairs.gradients(problem, state)
    one_sided.add(rows, [pairs.label(number) for number in numbers])
    for number, constraint in enumerate(problem.constraints):
        value = np.atleast_1d(constraint.value(state))
        jacobian = _dense(constraint.jacobian(state), state)
        low, high = value <= constraint.lower + ACTIVE, value >= constraint.upper - ACTIVE
        label = _constraint(number, constraint)
        signed.add(jacobian[low & high], [label] * int((low & high).sum()))
        one_sided.add(jacobian[low & ~high], [label] * int((low & ~high).sum()))
        one_sided.add(-jacobian[high & ~low], [label] * int((high & ~low).sum()))
    lower, upper = problem.scene.figure.tangent_bounds(state.q)
    limited_low, limited_high = lower >= -ACTIVE, upper <= ACTIVE
    for bound in problem.bounds:
        low_bound, high_bound = bound.bounds(state, None)
        lower, upper = np.maximum(lower, low_bound), np.minimum(upper, high_bound)
    identity = np.eye(nv)
    for at_work, sign, limited in ((lower >= -ACTIVE, 1.0, limited_low), (upper <= ACTIVE, -1.0, limited_high)):
        columns = np.flatnonzero(at_work)
        one_sided.add(sign * identity[columns], [_of_joint(state.model, int(k), bool(limited[k])) for k in columns])
    return signed, one_sided


def _of_joint(model: pin.Model, column: int, limited: bool) -> Label:
    joint = next(j for j in range(1, model.njoints) if model.joints[j].idx_v <= column < model.idx_vs[j] + model.nvs[j])
    return ("limit" if limited else "bound"), (model.names[joint],)


def _balanced(objective: Array, signed: _Rows, one_sided: _Rows) -> tuple[Array, Array]:
    """The part of each labelled row in the objective's gradient (nv,), and the residual (nv,)."""
    from scipy.optimize import nnls

    equal, pushing = np.vstack(signed.rows), np.vstack(one_sided.rows)
    rows = np.vstack([equal, -equal, pushing])
    if not rows.size:
        return np.zeros(len(signed.labels) + len(pushing)), objective
    push, _ = nnls(rows.T, objective, maxiter=20 * (len(rows) + len(objective)))
    left = objective - push @ rows
    size = push * np.sqrt((rows**2).sum(axis=1))
    count, named = len(equal), len(signed.labels)
    return np.concatenate([(size[:count] + size[count : 2 * count])[:named], size[2 * count :]]), left
