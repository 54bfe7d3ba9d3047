"""Postures that bring bones, frames and points of a figure to given ones, among things: one quadratic program a step.

A step dq minimises, over joint limits, the greatest motion of a frame, reach cones and contacts,

    |W_b (B J dq + B (p - p*))|^2 + |W_t (J_t dq + log R R*')|^2 + |W_h (J_h dq + h - h*)|^2 + |W_q (dq + q - q*)|^2

with p the points and B their differences along bones, so that a body is moved as a whole at no cost to its bones; R
orientations; h points that are held; q* a posture to stay near to. Contacts are rows ``gap + J dq >= clearance`` of all
pairs that are near, relaxed at a high price. Joint limits hold exactly, cones to second order of the last step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import daqp
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.figures.figure import Figure
from wholebody.scene.workspace import Workspace

STEP = 0.6  # rad: largest change of a joint in one step; beyond it the linearisation says little
CONE_MARGIN, CONE_SLACK = 2e-3, 1e-6  # rad: inside of a cone that rows aim at, as they are curved; outside, of rounding
DAMPING = 1e-4  # m²/rad² of every joint, so that the program has one answer
WITHIN, CLEARANCE = 0.06, 5e-4  # m: nearer pairs have rows; distance that they keep
PUSH = 0.03  # m: by which a step brings an overlap out at most
SOFT = 8  # daqp's flag of a row that may be broken at a price
RELAXED = 1e-10  # of the price: less holds contacts more exactly, and costs the program digits


class Goals(NamedTuple):
    """What one frame is to reach."""

    points: Array  # (p, 3) where the points are to be, metres, to a common shift but for the anchor's weight
    turns: Array  # (t, 3, 3) orientations that frames are to have
    held: Array  # (h, 3) where held points are to be, metres
    held_weights: Array  # (h, 3) weight of each, along the axes of the world; 0 for none
    posture: Array  # (nq,) a posture to stay near to
    posture_weights: Array  # (nv,) weight of each difference from it, metres per radian


class Layout(NamedTuple):
    """What goals are of."""

    # points and turns: frames of the figure
    points: list[str]
    turns: list[str]
    bones: Array  # (b, p) combinations of points: a row has 1 and -1 for a bone, or positive shares for the anchor
    bone_weights: Array  # (b,) weight of each
    turn_weights: Array  # (t,) weight of each angle, metres per radian
    held: list[tuple[int, Array]]  # joint and place (3,) in it of each point that may be held


class Fitter:
    """Fits postures of a figure in its own workspace, so each thread needs its own."""

    def __init__(self, figure: Figure, layout: Layout, workspace: Workspace) -> None:
        self.figure, self.model, self.layout, self._workspace = figure, figure.model, layout, workspace
        self._state = workspace.state
        self._point_joints, self._point_parts = self._carried(layout.points)
        self._turn_joints, self._turn_parts = self._carried(layout.turns)
        self._held_joints = np.array([joint for joint, _ in layout.held], dtype=np.intp)
        self._held_places = np.array([place for _, place in layout.held]).reshape(-1, 3)
        joints = (self._point_joints, self._held_joints, self._turn_joints)
        self._joints = np.concatenate([np.repeat(each, 3) for each in joints])
        self._world = np.zeros(len(self._joints), dtype=np.intp)
        places = 3 * (len(layout.points) + len(layout.held))
        self._wrenches = np.zeros((len(self._joints), 6))
        for axis in range(3):
            self._wrenches[axis:places:3, axis] = 1.0
            self._wrenches[places + axis :: 3, 3 + axis] = 1.0
        self._bones = np.kron(layout.bone_weights[:, None] * layout.bones, np.eye(3))
        self._turn_weights = np.repeat(layout.turn_weights, 3)
        self._cones = list(figure.cones.values())
        self._limb_joints, limb_parts = self._carried([cone.limb for cone in self._cones])
        self._base_joints, base_parts = self._carried([cone.reference for cone in self._cones])
        self._base_turns = base_parts[:, :3]
        self._axes = np.array([part[:3] @ cone.axis for part, cone in zip(limb_parts, self._cones, strict=True)])
        self._free = 6 if figure.root == "free" else 0

    def _carried(self, frames: list[str]) -> tuple[Indices, Array]:
        """The joint that carries each frame, and in it the frame's rotation (3, 3) over its place: (k, 4, 3)."""
        found = [self.model.frames[self.figure.frame_id(name)] for name in frames]
        parts = [np.vstack([frame.placement.rotation, frame.placement.translation]) for frame in found]
        return np.array([frame.parentJoint for frame in found], dtype=np.intp), np.array(parts).reshape(-1, 4, 3)

    def see(self, things: Mapping[str, pin.SE3]) -> None:
        """See things at these placements from now on."""
        self._workspace.place(things)

    def held(self, q: Array) -> Array:
        """(h, 3) where the points are at a posture (nq,) that may be held."""
        self._state.update(q)
        return self._placed(self._held_joints, self._held_places)

    def outside(self, q: Array) -> bool:
        """Whether a posture (nq,) has a limb outside of its reach cone."""
        self._state.update(q)
        cones = zip(self._cones, self._directions(), strict=True) if self._cones else ()
        return any(cone.cone.signed_angle(along)[0] < -CONE_SLACK for cone, along in cones)

    def overlaps(self, q: Array) -> bool:
        """Whether a pair overlaps at a posture (nq,) by more than the clearance that rows ask for."""
        return bool(self._workspace.near(q, 0.0).distance.min(initial=0.0) < -CLEARANCE)

    def cost(self, q: Array, goals: Goals) -> float:
        """Half the sum of the squared weighted errors."""
        self._state.update(q)
        errors = self._errors(q, goals)
        posture = goals.posture_weights * pin.difference(self.model, goals.posture, q)
        return 0.5 * float(errors @ errors + posture @ posture)

    def step(
        self, q: Array, goals: Goals, *, damping: float = DAMPING, among: bool = True, most: Array | None = None
    ) -> Array:
        """The posture (nq,) after one program from q (nq,); `most` (2, nv) displacements, contacts only if `among`."""
        near = self._workspace.near(q, WITHIN) if among else None
        self._state.update(q)
        rows, errors = self._rows(goals), self._errors(q, goals)
        posture = np.asarray(pin.difference(self.model, goals.posture, q))
        square = goals.posture_weights**2
        gradient = rows.T @ errors + square * posture
        hessian = rows.T @ rows
        hessian[np.diag_indices(len(hessian))] += square + damping
        lower, upper = self.figure.tangent_bounds(q)
        lower, upper = np.maximum(lower, -STEP), np.minimum(upper, STEP)
        lower[: self._free], upper[: self._free] = -10.0, 10.0  # m, rad
        if most is not None:
            lower, upper = np.clip(most[0], lower, upper), np.clip(most[1], lower, upper)
        limits, least = [np.zeros((0, self.model.nv))], [np.zeros(0)]
        if self._cones:
            # a limb outside of its cone returns by half a step at a time; nearer to the edge it stays inside
            angles, cones = self._cone_rows()
            limits.append(cones)
            least.append(np.minimum(CONE_MARGIN - angles, 0.5 * STEP))
        if near is not None and len(near.distance):
            found = self._workspace.rows.rows(near, CLEARANCE)
            limits.append(self._state.rows(found.wrench, found.second, found.first))
            least.append(np.minimum(CLEARANCE - found.gap, PUSH))
        among_rows, low = np.concatenate(limits), np.concatenate(least)
        sense = np.zeros(len(lower) + len(low), dtype=np.int32)
        sense[len(lower) :] = SOFT
        x, _, flag, _ = daqp.solve(
            hessian, gradient, among_rows, np.concatenate([upper, np.full(len(low), 1e30)]),
            np.concatenate([lower, low]), sense, rho_soft=RELAXED,
        )  # fmt: skip
        if flag <= 0:
            return q
        return self.figure.clamp(np.asarray(pin.integrate(self.model, q, np.asarray(x))))

    def descend(self, q: Array, goals: Goals, iterations: int) -> tuple[Array, float]:
        """The posture (nq,) of least cost that a descent from q finds, without regard to contacts, and its cost."""
        q, damping = self.figure.clamp(q), DAMPING
        cost = self.cost(q, goals)
        for _ in range(iterations):
            trial = self.step(q, goals, damping=damping, among=False)
            tried = self.cost(trial, goals)
            if tried > cost:
                damping *= 8.0
                if damping > 1e3:
                    break
                continue
            done = cost - tried < 1e-4 * cost
            q, cost, damping = trial, tried, max(DAMPING, damping / 8.0)
            if done:
                break
        return q, cost

    def _placed(self, joints: Indices, places: Array) -> Array:
        at = self._state.joints[joints]
        return np.asarray(np.einsum("pki,pk->pi", at[:, :3], places) + at[:, 3])

    def _errors(self, q: Array, goals: Goals) -> Array:
        """Weighted errors of bones, held points and orientations."""
        points = self._placed(self._point_joints, self._point_parts[:, 3]) - goals.points
        held = goals.held_weights * (self._placed(self._held_joints, self._held_places) - goals.held)
        at = self._state.joints[self._turn_joints]
        turned = np.swapaxes(at[:, :3], 1, 2) @ self._turn_parts[:, :3] @ np.swapaxes(goals.turns, 1, 2)
        angles = self._turn_weights * np.array([pin.log3(turn) for turn in turned]).reshape(-1)
        return np.concatenate([self._bones @ points.ravel(), held.ravel(), angles])

    def _rows(self, goals: Goals) -> Array:
        """Derivatives (m, nv) of the weighted errors."""
        places = [
            self._placed(self._point_joints, self._point_parts[:, 3]),
            self._placed(self._held_joints, self._held_places),
        ]
        x, y, z = np.concatenate(places).T
        count = 3 * len(x)
        wrenches = self._wrenches  # rows of a point p along n are [n, p x n]
        wrenches[0:count:3, 4], wrenches[0:count:3, 5] = z, -y
        wrenches[1:count:3, 3], wrenches[1:count:3, 5] = -z, x
        wrenches[2:count:3, 3], wrenches[2:count:3, 4] = y, -x
        rows = self._state.rows(wrenches, self._joints, self._world)
        points = 3 * len(places[0])
        return np.concatenate([
            self._bones @ rows[:points],
            goals.held_weights.reshape(-1, 1) * rows[points:count],
            self._turn_weights[:, None] * rows[count:],
        ])  # fmt: skip

    def _directions(self) -> Array:
        """(c, 3) directions of the limbs in the axes of their cones."""
        joints = self._state.joints
        worlds = np.einsum("cki,ck->ci", joints[self._limb_joints][:, :3], self._axes)
        found: Array = np.einsum("cki,ci->ck", joints[self._base_joints][:, :3], worlds)
        return np.asarray(np.einsum("ckj,ck->cj", self._base_turns, found))

    def _cone_rows(self) -> tuple[Array, Array]:
        """Angles (k,) of the limbs that are near to the edges of their cones, and their rows (k, nv)."""
        near, angles, wrenches = list[int](), list[float](), list[list[float]]()
        for row, (cone, along) in enumerate(zip(self._cones, self._directions(), strict=True)):
            angle, gradient = cone.cone.signed_angle(along)
            if angle < STEP:
                turn = self._state.joints[self._base_joints[row], :3].T @ self._base_turns[row]
                (x, y, z), (u, v, w) = (turn @ along).tolist(), (turn @ gradient).tolist()
                near.append(row)
                angles.append(angle)
                wrenches.append([0.0, 0.0, 0.0, y * w - z * v, z * u - x * w, x * v - y * u])
        rows = self._state.rows(np.array(wrenches).reshape(-1, 6), self._limb_joints[near], self._base_joints[near])
        return np.array(angles), rows
