"""Balls that contain a piece in every posture within the limits, and the pairs of pieces that can come near by them.

A ball with centre p and radius r on a revolute joint of angle a - h ... a + h stays within one ball: the arc of p, at
distance d from the axis, has the enclosing ball of radius d sin h about the point at distance d cos h from the axis (of
radius d about the axis itself from h = 90 degrees on), and r is added. A prismatic joint adds half its travel. Towards
the leaves the same holds with the inverse motion. So any joint, or a frame that a `Hold` keeps in the world, can be the
reference. Balls grow from joint to joint and cover every posture: the bound is safe, not tight.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask, with_values
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.geometry.pieces import COAL_ACCURACY
from wholebody.geometry.proximity import PairTable
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace, borrowed
from wholebody.tasks.base import Constraint
from wholebody.tasks.frame import Hold


class Range(NamedTuple):
    """Rotation, or translation, of a joint along a unit axis (3,) between two values [rad or m], maybe infinite."""

    axis: Array
    turns: bool
    low: float
    high: float


class Balls(NamedTuple):
    """Balls that contain pieces, in the frame of one joint; there is none for a piece without a bound."""

    center: Array  # (k, 3) metres
    radius: Array  # (k,) metres
    piece: Indices  # (k,) indices of the pieces


class Reach:
    """Bounds on the positions of the pieces of a model within its joint limits."""

    def __init__(self, model: pin.Model, start: Array, resting: Balls, joint: Indices, frozen: Iterable[int]) -> None:
        """Read the joints; `start` (nq,) counts as possible, `resting` are balls around pieces in their joints (n,)."""
        self._model, self._start, self._frozen = model, start, set(frozen)
        data = model.createData()
        pin.forwardKinematics(model, data, start)
        self._still: dict[int, pin.SE3] = {}
        self._ranges: dict[int, Range | None] = {}
        self._near: list[list[int]] = [[] for _ in range(model.njoints)]
        for j in range(1, model.njoints):
            if self._frozen.issuperset(range(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])):
                self._still[j] = model.jointPlacements[j].actInv(data.liMi[j])
            else:
                self._ranges[j] = self._range(j)
            self._near[j].append(model.parents[j])
            self._near[model.parents[j]].append(j)
        self._own = [_chosen(resting, np.flatnonzero(joint == j)) for j in range(model.njoints)]
        self._beyond: dict[tuple[int, int], Balls] = {}  # joint and neighbour: what is on its side, as that sees it

    def seen_from(self, joint: int) -> Balls:
        """Balls of all pieces with a bound in the frame of a joint; 0 is the world."""
        order, toward = [joint], {joint: -1}
        for node in order:
            for other in self._near[node]:
                if other not in toward:
                    toward[other] = node
                    order.append(other)
        for node in reversed(order[1:]):
            edge = node, toward[node]
            if edge not in self._beyond:
                self._beyond[edge] = self._across(self._gathered(*edge), *edge)
        return self._gathered(joint, -1)

    def _gathered(self, node: int, to: int) -> Balls:
        """The balls of a joint and of all its neighbours but one, in its frame."""
        parts = [self._own[node], *(self._beyond[other, node] for other in self._near[node] if other != to)]
        parts = [part for part in parts if len(part.piece)] or parts[:1]
        return parts[0] if len(parts) == 1 else Balls(*map(np.concatenate, zip(*parts, strict=True)))

    def _across(self, balls: Balls, node: int, to: int) -> Balls:
        """Transform balls from the frame of one joint to that of a neighbour in the tree."""
        if not len(balls.piece):
            return balls
        if self._model.parents[node] == to:
            return placed(self._moved(balls, node, 1.0), self._model.jointPlacements[node])
        return self._moved(placed(balls, self._model.jointPlacements[to].inverse()), to, -1.0)

    def _moved(self, balls: Balls, joint: int, sign: float) -> Balls:
        """Balls after motion of the joint, or with sign -1 of its base relative to it."""
        if joint in self._still:
            still = self._still[joint]
            return placed(balls, still if sign > 0 else still.inverse())
        bound = self._ranges[joint]
        if bound is None:
            if self._model.joints[joint].shortname().startswith("JointModelSpherical"):
                return about_point(balls, np.zeros(3))
            return _chosen(balls, np.zeros(0, dtype=np.intp))
        half = 0.5 * (bound.high - bound.low)
        middle = 0.5 * sign * (bound.high + bound.low) if np.isfinite(half) else 0.0
        if not bound.turns:
            moved = with_values(balls, center=balls.center + middle * bound.axis, radius=balls.radius + half)
            return moved if np.isfinite(half) else _chosen(moved, np.zeros(0, dtype=np.intp))
        along = np.outer(balls.center @ bound.axis, bound.axis)
        across = balls.center - along
        lever = np.sqrt((across * across).sum(axis=1))
        if half >= 0.5 * np.pi:
            return with_values(balls, center=along, radius=balls.radius + lever)
        turned = np.cos(middle) * across + np.sin(middle) * across @ pin.skew(bound.axis).T
        return with_values(balls, center=along + np.cos(half) * turned, radius=balls.radius + np.sin(half) * lever)

    def _range(self, index: int) -> Range | None:
        """Range of a revolute or prismatic joint; None for any other."""
        joint = self._model.joints[index]
        if joint.nv != 1 or joint.nq > 2 or "Mimic" in joint.shortname() or "Composite" in joint.shortname():
            return None
        twist = np.asarray(joint.createData().S).reshape(6)
        slide, turn = twist[:3], twist[3:]
        if slide.any() and turn.any():
            return None
        if joint.nq == 2:
            return Range(turn, True, -np.inf, np.inf)
        value = float(self._start[joint.idx_q])
        low, high = self._model.lowerPositionLimit[joint.idx_q], self._model.upperPositionLimit[joint.idx_q]
        low, high = min(float(low), value), max(float(high), value)
        return Range(turn if turn.any() else slide, bool(turn.any()), low, high)


def still_dofs(problem: Problem) -> list[int]:
    """Degrees of freedom (tangent indices) that the bounds of a problem keep as at the start."""
    if not problem.bounds:
        return []
    state = State(problem.scene.model).update(problem.start)
    still = np.zeros(problem.scene.model.nv, dtype=bool)
    for bound in problem.bounds:
        low, high = bound.bounds(state, None)
        still |= (low == 0.0) & (high == 0.0)
    return [int(dof) for dof in np.flatnonzero(still)]


def reachable_pairs(problem: Problem, kept: set[int], rests: Mask, numbers: Indices) -> Mask:
    """Which pairs (k,), by number, are not proven to stay apart, with the degrees `kept` and held frames fixed.

    Of two pieces that both move nothing is said; `rests` are the joints that do not move in the world.
    """
    scene, model = problem.scene, problem.scene.model
    table, clearances, own = scene.pair_table, problem.clearances[numbers], scene.figure.geometry.ngeoms
    joint, pairs, start = table.joint, table.pairs[numbers], problem.start
    within = (start >= model.lowerPositionLimit).all() and (start <= model.upperPositionLimit).all()
    if within and not kept and not joint[own:].any():
        reach = _of_figure(scene.figure)
    else:
        reach = Reach(model, start, _resting(scene.geometry, table.reach), joint, kept)
    # m: largest displacement of a piece by errors of holds; an accepted answer has less
    views = [(reach.seen_from(0), 0.0), *((b, 1e-3) for b in held_balls(scene.figure, reach, problem.constraints))]
    with borrowed(scene.built, Workspace.refresh) as workspace:
        at = workspace.proximity.placements(workspace.state.update(start).data)
    open_, fixed = np.ones(len(pairs), dtype=bool), rests[joint[pairs]]
    row = np.flatnonzero(fixed[:, 0] != fixed[:, 1])
    side = fixed[row, 1].astype(np.intp)  # of the piece that is fixed
    own, other = pairs[row, side], pairs[row, 1 - side]
    turn, origin = at[own, :3], at[own, 3]  # columns of rotations, translations
    for balls, slack in views:
        place, radius = np.zeros((len(joint), 3)), np.full(len(joint), np.inf)
        place[balls.piece], radius[balls.piece] = balls.center, balls.radius
        away = np.einsum("kij,kj->ki", turn, place[other] - origin)  # in the axes of the piece
        room = radius[other] + clearances[row] + slack + COAL_ACCURACY
        apart = np.sqrt((away * away).sum(axis=1)) - table.reach[own] > room
        apart |= np.sqrt((np.maximum(np.abs(away) - table.half[own], 0.0) ** 2).sum(axis=1)) > room
        for k in np.flatnonzero(np.isinf(table.reach)):
            plane, mine = table.swept[k].faces[0], own == k
            apart[mine] |= away[mine] @ plane[:3] - plane[3] > room[mine]
        open_[row] &= ~apart
    return open_


@lru_cache(maxsize=8)
def _of_figure(figure: Figure) -> Reach:
    """The bounds of a figure of which nothing is frozen or carries things, which are known once they were asked for."""
    table = PairTable(figure.model, figure.geometry)
    return Reach(figure.model, figure.neutral, _resting(figure.geometry, table.reach), table.joint, ())


def _resting(geometry: pin.GeometryModel, radius: Array) -> Balls:
    center = np.array([piece.placement.translation for piece in geometry.geometryObjects]).reshape(-1, 3)
    return Balls(center, radius, np.arange(len(center)))


def held_balls(figure: Figure, reach: Reach, constraints: Iterable[Constraint]) -> list[Balls]:
    """Balls of all pieces in the world, from each frame that is held there."""
    found = []
    for hold in constraints:
        if not isinstance(hold, Hold) or hold.relative_to is not None:
            continue
        frame = figure.model.frames[figure.frame_id(hold.frame)]
        kept = hold.kept_at
        balls = placed(reach.seen_from(frame.parentJoint), kept * frame.placement.inverse())
        found.append(balls if hold.orientation else about_point(balls, kept.translation))
    return found


def beyond_reach(problem: Problem, frame: str, offset: Array, places: Array) -> Array:
    """By how much places (n, 3) are at least out of reach of a point (3,) of a frame, metres (n,).

    The point stays in balls in every posture within limits, bounds and holds.
    """
    figure, model = problem.scene.figure, problem.scene.model
    held = model.frames[figure.frame_id(frame)]
    resting = Balls(held.placement.act(offset)[None], np.zeros(1), np.zeros(1, dtype=np.intp))
    joint = np.array([held.parentJoint], dtype=np.intp)
    reach = Reach(model, problem.start, resting, joint, still_dofs(problem))
    least = np.zeros(len(places))
    for balls in (reach.seen_from(0), *held_balls(figure, reach, problem.constraints)):
        for middle, size in zip(balls.center, balls.radius, strict=True):
            if np.isfinite(size):
                least = np.maximum(least, np.linalg.norm(places - middle, axis=1) - size)
    return least


def about_point(balls: Balls, point: Array) -> Balls:
    """Balls after any rotation about a point."""
    radius = balls.radius + np.linalg.norm(balls.center - point, axis=1)
    return Balls(np.tile(point, (len(radius), 1)), radius, balls.piece)


def placed(balls: Balls, place: pin.SE3) -> Balls:
    """Balls in another frame, given the placement of the old frame in it."""
    return with_values(balls, center=balls.center @ place.rotation.T + place.translation)


def _chosen(balls: Balls, places: Indices) -> Balls:
    return Balls(balls.center[places], balls.radius[places], balls.piece[places])
