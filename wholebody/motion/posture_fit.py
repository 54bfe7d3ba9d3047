"""Postures that bring bones, frames and points of a figure to given ones, among things: one quadratic program a step.

A step dq minimises, over joint limits, the greatest motion of a frame, reach cones and contacts,

    |W_b (B J dq + B (p - p*))|^2 + |W_t (J_t dq + log R R*')|^2 + |W_h (J_h dq + h - h*)|^2 + |W_q (dq + q - q*)|^2

with p the points and B their differences along bones, so that a body is moved as a whole at no cost to its bones; R
orientations; h points that are held; q* a posture to stay near to. Contacts are rows ``gap + J dq >= clearance`` of all
pairs that are near, relaxed at a high price, and of those at given places of motions to other frames, at a lower one.
Joint limits hold exactly, cones to second order of the last step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import daqp
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.figures.figure import Figure
from wholebody.motion.held_points import HeldPoint
from wholebody.motion.retarget_targets import has_trunk, known_bones
from wholebody.motion.roles import Roles
from wholebody.motion.structure import LIMBS
from wholebody.scene.workspace import Workspace
from wholebody.terms.residual_kernel import cones as cone_angles

STEP = 0.6  # rad: largest change of a joint in one step; beyond it the linearisation says little
CONE_MARGIN, CONE_SLACK = 2e-3, 1e-6  # rad: inside of a cone that rows aim at, as they are curved; outside, of rounding
DAMPING = 1e-4  # m²/rad² of every joint, so that the program has one answer
WITHIN, FARTHER = 0.01, 0.2  # m: nearer pairs have rows; the same of steps that go far
CLEARANCE = 5e-4  # m: distance that pairs keep
NEAR, DEEP = 0.05, 1e-2  # rad, m: change of a value by a step that may meet other pairs; an overlap that tells it did
FAR, SHORTER = 0.5, 0.3  # rad, m: change of a value by a step that is looked at; share of it that the next try may take
PASSING, SPARE = 0.01, 1e-4  # m: the same between frames
PUSH = 0.03  # m: by which a step brings an overlap out at most
ASIDE = 10.0  # merit that a long step of what touches things may end with: it is 2 cm off, as its way is curved
LEAST_LEVER = 0.1  # m
WHOLE = 4.0, 2.0  # weights of a root's places and turns: they move the whole mass, so that legs give way first
BONES = {"hand": 0.5, "toe": 0.7, "head": 0.7}  # weights of bones by their far ends, where it is not 1
TURNS = {"pelvis": 0.3, "head": 0.15, "ankle": 0.15, "hand": 0.08}  # m/rad, weights of angles
RELAXED = 1e-10  # of the price: less holds contacts more exactly, and costs the program digits


class Goals(NamedTuple):
    """What one frame is to reach."""

    points: Array  # (p, 3) where the points are to be, metres, to a common shift but for the anchor's weight
    turns: Array  # (t, 3, 3) orientations that frames are to have
    held: Array  # (h, 3) where held points are to be, in the axes of their bases, metres
    held_weights: Array  # (h, 3) weight of each, along the axes of the world; 0 for none
    posture: Array  # (nq,) a posture to stay near to
    posture_weights: Array  # (nv,) weight of each difference from it, metres per radian


class Midway(NamedTuple):
    """A place on the motion from a posture to that of a frame beside it."""

    other: Array  # (nq,) the posture beside it
    share: float  # of the path to that
    part: float  # of what is missing there, that the posture is to give way
    weight: float  # of what is missing: 1 is that of a bone


class Layout(NamedTuple):
    """What goals are of."""

    points: list[tuple[int, Array]]  # joint and place (3,) in it of each
    turns: list[str]  # frames of the figure
    bones: Array  # (b, p) combinations of points: a row has 1 and -1 for a bone, or positive shares for the anchor
    bone_weights: Array  # (b,) weight of each
    turn_weights: Array  # (t,) weight of each angle, metres per radian
    held: list[HeldPoint]  # points that may be held


class Fitter:
    """Fits postures of a figure in its own workspace, so each thread needs its own."""

    def __init__(self, figure: Figure, layout: Layout, workspace: Workspace) -> None:
        self.figure, self.model, self.layout, self._workspace = figure, figure.model, layout, workspace
        self._state = workspace.state
        points = [*layout.points, *((point.joint, point.place) for point in layout.held)]
        self._place_joints = np.array([joint for joint, _ in points], dtype=np.intp)
        self._local = np.array([place for _, place in points]).reshape(-1, 3)
        self._bases = np.array([point.base for point in layout.held], dtype=np.intp)
        bearing = {
            joint for piece in figure.geometry.geometryObjects for joint in self.model.supports[piece.parentJoint]
        }
        bare = [bool(point.thing) and point.joint not in bearing for point in layout.held]
        self._touching = np.array([point.thing for point in layout.held], dtype=bool)
        self._bare = np.repeat(np.array(bare, dtype=bool), 3)
        self._turn_joints, self._turn_parts = self._carried(layout.turns)
        moved = self._state.support[[*self._place_joints, *self._turn_joints]]
        moved[len(layout.points) : len(self._local)] -= self._state.support[self._bases]
        self._moved = np.repeat(moved, 3, axis=0)
        places = 3 * len(self._local)
        self._wrenches = np.zeros((len(self._moved), 6))
        for axis in range(3):
            self._wrenches[axis:places:3, axis] = 1.0
            self._wrenches[places + axis :: 3, 3 + axis] = 1.0
        self._bones = np.kron(layout.bone_weights[:, None] * layout.bones, np.eye(3))
        self._turn_weights = np.repeat(layout.turn_weights, 3)
        cones = list(figure.cones.values())
        self._limb_joints, limb_parts = self._carried([cone.limb for cone in cones])
        self._base_joints, base_parts = self._carried([cone.reference for cone in cones])
        axes = [part[:3] @ cone.axis for part, cone in zip(limb_parts, cones, strict=True)]
        turns = np.swapaxes(base_parts[:, :3], 1, 2)
        edges = [cone.cone.planes.reshape(5, -1, 3).swapaxes(0, 1).reshape(-1, 15) for cone in cones]
        counts = np.array([len(each) for each in edges], dtype=np.int64)
        rows = np.arange(len(cones)), self._limb_joints, self._base_joints, counts, np.cumsum(counts) - counts
        # what `terms.entries.CONE` says
        self._cones = (
            np.hstack([np.array(axes).reshape(-1, 3), turns.reshape(-1, 9)]), np.column_stack(rows).astype(np.int64),
            np.concatenate([*edges, np.zeros((0, 15))]),
        )  # fmt: skip
        self._cone_rows, self._angles = np.zeros((len(cones), 6)), np.zeros(len(cones))
        self._free = 6 if figure.root == "free" else 0
        self._diagonal = np.diag_indices(figure.model.nv)
        self._turning = np.ones(figure.model.nv)  # 0 for what moves along lines
        self._turning[: self._free // 2] = 0.0

    def _carried(self, frames: list[str]) -> tuple[Indices, Array]:
        """The joint that carries each frame, and in it the frame's rotation (3, 3) over its place: (k, 4, 3)."""
        found = [self.model.frames[self.figure.frame_id(name)] for name in frames]
        parts = [np.vstack([frame.placement.rotation, frame.placement.translation]) for frame in found]
        return np.array([frame.parentJoint for frame in found], dtype=np.intp), np.array(parts).reshape(-1, 4, 3)

    def see(self, things: Mapping[str, pin.SE3]) -> None:
        """See things at these placements from now on."""
        self._workspace.place(things)

    def held(self, q: Array) -> Array:
        """(h, 3) where the points that may be held are at a posture (nq,), in the axes of their bases."""
        self._state.update(q)
        base = self._state.joints[self._bases]
        return np.asarray(np.einsum("hki,hi->hk", base[:, :3], self._places()[len(self.layout.points) :] - base[:, 3]))

    def places(self, q: Array) -> Array:
        """(p, 3) where the points are at a posture (nq,)."""
        self._state.update(q)
        return self._places()[: len(self.layout.points)]

    def outside(self, q: Array) -> bool:
        """Whether a posture (nq,) has a limb outside of its reach cone."""
        self._state.update(q)
        return bool((self._cone_angles() < -CONE_SLACK).any())

    def depth(self, q: Array) -> float:
        """The deepest overlap at a posture (nq,), metres; 0 without one."""
        return self._workspace.deepest(q)

    def deepest(self, q: Array) -> tuple[str, str]:
        """What the pair that overlaps most at a posture (nq,) is part of."""
        near, owners = self._workspace.near(q, 0.0), self._workspace.owners
        first, second = near.pair[near.distance.argmin()]
        return owners[first], owners[second]

    def cost(self, q: Array, goals: Goals) -> float:
        """Half the sum of the squared weighted errors."""
        self._state.update(q)
        errors = self._errors(self._places(), goals)
        posture = goals.posture_weights * pin.difference(self.model, goals.posture, q)
        return 0.5 * float(errors @ errors + posture @ posture)

    def step(
        self,
        q: Array,
        goals: Goals,
        *,
        damping: float = DAMPING,
        among: bool = True,
        most: Array | None = None,
        midway: Sequence[Midway] = (),
        within: float = WITHIN,
    ) -> Array:
        """The posture (nq,) after one program; `most` (2, nv) displacements, rows of pairs `within` [m] if `among`."""
        self._state.update(q)
        near = self._workspace.proximity.query(self._state.data, within) if among else None
        places = self._places()
        rows, errors = self._rows(places, goals), self._errors(places, goals)
        posture = np.asarray(pin.difference(self.model, goals.posture, q))
        square = goals.posture_weights**2
        gradient = rows.T @ errors + square * posture
        hessian = rows.T @ rows
        hessian[self._diagonal] += square + damping + self._curvature(errors, goals)
        lower, upper = self.figure.tangent_bounds(q)
        lower, upper = np.maximum(lower, -STEP), np.minimum(upper, STEP)
        lower[: self._free], upper[: self._free] = -10.0, 10.0  # m, rad
        if most is not None:
            lower, upper = np.clip(most[0], lower, upper), np.clip(most[1], lower, upper)
        # a limb outside of its cone returns by half a step at a time; nearer to the edge it stays inside
        edge = self._cone_angles() < STEP
        joints = self._limb_joints[edge], self._base_joints[edge]
        cones = self._state.rows(self._cone_rows[edge], *joints)
        contacts, missing = [np.zeros((0, len(lower)))], [np.zeros(0)]
        if near is not None and len(near.distance):
            if len(near.distance) > len(lower):  # of more rows, see below, none of a farther pair is kept
                farthest = float(np.partition(near.distance, len(lower))[len(lower)])
                near = near.nearer(np.nextafter(farthest, np.inf))  # of a floor of tiles many are as near
            found = self._workspace.rows.rows(near, CLEARANCE)
            contacts.append(self._state.rows(found.wrench, found.second, found.first))
            missing.append(np.minimum(CLEARANCE - found.gap, PUSH))
        for other, share, part, weight in midway:
            self._state.update(pin.interpolate(self.model, q, other, share))
            found = self._workspace.rows.rows(self._workspace.proximity.query(self._state.data, PASSING), SPARE)
            pull = weight * RELAXED**0.5  # what a row is multiplied by, its price is by the square of
            way = SPARE - found.gap
            contacts.append(pull * (1.0 - share) * self._state.rows(found.wrench, found.second, found.first))
            missing.append(pull * np.minimum(np.where(way > 0.0, part, 1.0) * way, PUSH))
        among_rows, low = np.concatenate(contacts), np.concatenate(missing)
        if len(low) > len(lower):
            # where there is room, no more rows are active than this; where there is none, hundreds would take seconds
            kept = np.sort(np.argpartition(-low, len(lower))[: len(lower)])
            among_rows, low = among_rows[kept], low[kept]
        among_rows = np.concatenate([cones, among_rows])
        low = np.concatenate([np.minimum(CONE_MARGIN - self._angles[edge], 0.5 * STEP), low])
        sense = np.zeros(len(lower) + len(low), dtype=np.int32)
        sense[len(lower) :] = 8  # daqp's flag of a row that may be broken at a price
        x, _, flag, _ = daqp.solve(
            hessian, gradient, among_rows, np.concatenate([upper, np.full(len(low), 1e30)]),
            np.concatenate([lower, low]), sense, rho_soft=RELAXED,
        )  # fmt: skip
        if flag <= 0:
            return q
        x = np.clip(x, lower, upper)  # daqp keeps bounds to 1e-6 alone, which is beyond the speed of a slow joint
        return self.figure.clamp(np.asarray(pin.integrate(self.model, q, x)))

    def careful_step(self, q: Array, goals: Goals, most: Array | None, midway: Sequence[Midway] = ()) -> Array:
        """The posture (nq,) after a step; where it goes far and errors and overlaps grow, after a shorter one, or q.

        A step into what was too far away to have rows is made again with these: once inside, limbs may be pushed out
        on the other side.
        """
        found = self.step(q, goals, most=most, midway=midway)
        far = float(np.abs(pin.difference(self.model, q, found)).max())
        touching = self.touching(goals)
        if far <= NEAR or (far <= FAR and not touching and self.depth(found) <= DEEP):
            return found
        deepest, bounds = max(self.depth(q), DEEP), (-np.inf, np.inf) if most is None else most
        before = self.merit(q, goals)
        worst = max(before, ASIDE) if touching else np.inf
        if far <= FAR:
            if self.depth(found) <= DEEP and self.merit(found, goals) <= worst:
                return found
            again = self.step(q, goals, most=most, midway=midway, within=FARTHER)
            found = min(found, again, key=lambda each: self.merit(each, goals))
            if self.depth(found) <= deepest and self.merit(found, goals) <= worst:
                return found
        for _ in range(4):
            if self.merit(found, goals) <= before and self.depth(found) <= deepest:
                return found
            far *= SHORTER
            reach = np.clip(np.outer((-far, far), np.ones(self.model.nv)), bounds[0], bounds[1])
            found = self.step(q, goals, most=reach, midway=midway, within=FARTHER)
        return q

    def touching(self, goals: Goals) -> bool:
        """Whether parts are to touch things, or are led to them."""
        return bool(goals.held_weights[self._touching].any())

    def merit(self, q: Array, goals: Goals) -> float:
        """The cost of a posture (nq,) with overlaps, which cost as much as what is held most firmly."""
        over = np.minimum(self._workspace.near(q, CLEARANCE).distance - CLEARANCE, 0.0)
        return self.cost(q, goals) + 0.5 * float(goals.held_weights.max(initial=1.0)) ** 2 * float(over @ over)

    def reached(self, before: Array | None, q: Array, most: Array) -> Array:
        """The posture nearest to q (nq,) that is at most (nv,) from the posture before in time."""
        q = self.figure.clamp(q)
        if before is None:
            return q
        way = np.asarray(pin.difference(self.model, before, q))
        if (np.abs(way) <= most).all():
            return q
        return self.figure.clamp(pin.integrate(self.model, before, np.clip(way, -most, most)))

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

    def _places(self) -> Array:
        """(p + h, 3) where the points are, and those that may be held."""
        at = self._state.joints[self._place_joints]
        return np.asarray(np.einsum("pki,pk->pi", at[:, :3], self._local) + at[:, 3])

    def _errors(self, places: Array, goals: Goals) -> Array:
        """Weighted errors of bones, held points and orientations."""
        points = places[: len(goals.points)] - goals.points
        base, at = self._state.joints[self._bases], self._state.joints[self._turn_joints]
        wanted = np.einsum("hki,hk->hi", base[:, :3], goals.held) + base[:, 3]
        held = goals.held_weights * (places[len(goals.points) :] - wanted)
        turned = np.swapaxes(at[:, :3], 1, 2) @ self._turn_parts[:, :3] @ np.swapaxes(goals.turns, 1, 2)
        angles = self._turn_weights * np.array([pin.log3(turn) for turn in turned]).reshape(-1)
        return np.concatenate([self._bones @ points.ravel(), held.ravel(), angles])

    def _curvature(self, errors: Array, goals: Goals) -> Array:
        """(nv,) bounds of what rows leave out: else wrists, with short levers, turn far for millimetres."""
        first, weights = len(self._bones), goals.held_weights.ravel()[self._bare]
        pull = np.abs(errors[first : first + goals.held.size][self._bare] * weights).max(initial=0.0)
        return np.asarray(LEAST_LEVER * pull * self._turning)

    def _rows(self, places: Array, goals: Goals) -> Array:
        """Derivatives (m, nv) of the weighted errors."""
        (x, y, z), count = places.T, 3 * len(places)
        wrenches = self._wrenches  # rows of a point p along n are [n, p x n]
        wrenches[0:count:3, 4], wrenches[0:count:3, 5] = z, -y
        wrenches[1:count:3, 3], wrenches[1:count:3, 5] = -z, x
        wrenches[2:count:3, 3], wrenches[2:count:3, 4] = y, -x
        rows = self._state.folded((wrenches @ self._state.jacobian) * self._moved)
        points = 3 * len(goals.points)
        return np.concatenate([
            self._bones @ rows[:points],
            goals.held_weights.reshape(-1, 1) * rows[points:count],
            self._turn_weights[:, None] * rows[count:],
        ])  # fmt: skip

    def _cone_angles(self) -> Array:
        """Angles (c,) of the limbs to the edges of their cones, positive inside; writes their wrenches."""
        cone_angles(*self._cones, self._state.joints, self._cone_rows, self._angles)
        return self._angles


def levers(figure: Figure) -> Array:
    """(nv,) by how many metres a degree of freedom moves what it moves farthest, a radian or metre; a root by more."""
    model, data = figure.model, figure.model.createData()
    pin.forwardKinematics(model, data, figure.neutral)
    ends: list[list[Array]] = [[np.array(data.oMi[joint].translation)] for joint in range(model.njoints)]
    for piece in figure.geometry.geometryObjects:
        ends[piece.parentJoint].append(data.oMi[piece.parentJoint].act(piece.placement.translation))
    found = np.full(model.nv, LEAST_LEVER)
    for joint in range(model.njoints - 1, 0, -1):
        ends[model.parents[joint]] += ends[joint]
        reach = max(float(np.linalg.norm(end - data.oMi[joint].translation)) for end in ends[joint])
        first = model.idx_vs[joint]
        found[first : first + model.nvs[joint]] = max(reach, LEAST_LEVER)
    if figure.root == "free":
        found[:3] = 1.0
        found[:6] *= np.repeat(WHOLE, 3)
    return found


def layout_of(points: list[str], turns: list[str], roles: Roles, figure: Figure, held: list[HeldPoint]) -> Layout:
    """The bones between points of roles, the anchor or what else says where they are, and orientations of roles."""
    own, place = roles.places(figure), {role: np.eye(len(points))[k] for k, role in enumerate(points)}
    for part in ("hip", "shoulder"):
        if {f"left_{part}", f"right_{part}"} <= place.keys():
            place[f"{part}s"] = 0.5 * (place[f"left_{part}"] + place[f"right_{part}"])
    trunk = [
        ("left_hip", "right_hip"),
        ("hips", "shoulders"),
        ("left_shoulder", "right_shoulder"),
        ("shoulders", "head"),
    ]
    limbs = [ends for limb in LIMBS for side in ("left", "right") for ends in known_bones(limb, side, points)]
    pairs = [ends for ends in trunk + limbs if set(ends) <= place.keys()]
    rows = [place[end] - place[start] for start, end in pairs]
    weights = [BONES.get(end.split("_")[-1], 1.0) for _, end in pairs]
    if figure.root == "free" and has_trunk(roles.joints) and "hips" in place:
        rows.append(place["hips"])
        weights.append(0.3)  # weight of the place of the hips; 1 is that of a bone
    else:  # what is known says where it is
        rows += [place[role] for role in points]
        weights += [1.0] * len(points)
    return Layout(
        [own[role] for role in points], [roles.turns[role] for role in turns], np.array(rows),
        np.array(weights), np.array([TURNS[role.split("_")[-1]] for role in turns]),
        held,
    )  # fmt: skip
