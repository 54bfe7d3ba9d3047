"""A presolve (Nocedal and Wright 2006): pairs that balls prove apart go; docs/theory/simplification.md."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import assess
from wholebody.base import checks
from wholebody.base.arrays import Array, Indices, Mask, brief, with_values
from wholebody.figures.figure import Figure
from wholebody.geometry.large_models import geometry_model
from wholebody.geometry.pieces import COAL_ACCURACY
from wholebody.geometry.proximity import PairTable
from wholebody.problem import Problem
from wholebody.scene.geometry_model import SceneGeometry, SceneObject
from wholebody.scene.scene import Scene
from wholebody.solution import Solution
from wholebody.tasks.base import Constraint
from wholebody.tasks.frame import Hold


@dataclass(frozen=True)
class LeftOut:
    """The parts that a simplified problem omits.

    Attributes:
        pairs: number of pairs that cannot come nearer than their clearance.
        rigid: number of pairs that do not move relative to each other, because joints are frozen.
        things: names of the things of which no pair is left.
        counts: pairs and pieces before and after.
    """

    pairs: int
    rigid: int
    things: tuple[str, ...]
    counts: dict[str, tuple[int, int]]

    def __str__(self) -> str:
        """One line for each kind of part left out."""
        lines = [f"{name}: {after} of {before}" for name, (before, after) in self.counts.items()]
        lines.append(f"{self.pairs} pairs cannot come within their clearance, {self.rigid} do not move to each other")
        lines += [f"{len(self.things)} things cannot be reached"] if self.things else []
        return "\n".join(lines)


@dataclass(frozen=True)
class Simplified:
    """A smaller problem whose answers are answers of the whole one.

    Attributes:
        problem: the smaller problem, of the same figure.
        whole: the problem that it was made from.
        left_out: the omitted parts.
    """

    problem: Problem
    whole: Problem
    left_out: LeftOut

    __repr__ = brief

    def restored(self, solution: Solution) -> Solution:
        """A method's answer to `problem`, assessed in the whole one: "infeasible" where a thing was moved since."""
        checks.instance(solution, Solution, "restored: solution", "give what wb.solve(part.problem) returns")
        judged = assess(self.whole, checks.posture(solution.q, self.whole.scene.model.nq))
        status, message = solution.status, solution.message
        if status == "solved" and not judged.holds(1e-4):  # m, rad
            status, message = "infeasible", "what was left out does matter here; solve the whole problem from this one"
        return replace(solution, status=status, assessment=judged, message=message)


def simplify(problem: Problem) -> Simplified:
    """A problem without pairs that cannot touch in any allowed posture, and the same answers.

    Frozen joints narrow what is allowed. Things without a remaining pair are left out too, but for those of contact
    terms. The statement holds for the present placements of things. A solve takes a sixth less time in the median where
    joints are frozen, which repays after some 5 solves, and a twelfth less elsewhere: after 10 to 20, for a solve
    itself passes over pairs that are far. It is meant for many solves of a problem, and for exports.

    Raises:
        InputError: it is no problem, or objects came to or left its scene after it was stated.

    Examples:
        >>> part = wb.simplify(problem)
        >>> part.restored(wb.solve(part.problem)).status
        'solved'
    """
    checks.instance(problem, Problem, "simplify: problem", "state one with wb.Problem(scene, goals=[...])")
    problem.check_fresh()
    whole, still = problem.scene, set(still_dofs(problem))
    model, table = whole.model, whole.pair_table
    freedoms = [range(first, first + count) for first, count in zip(model.idx_vs, model.nvExtendeds, strict=True)]
    body = np.arange(model.njoints)
    for joint in range(1, model.njoints):
        if still.issuperset(freedoms[joint]):
            body[joint] = body[model.parents[joint]]
    moves = body[table.joint[table.pairs[:, 0]]] != body[table.joint[table.pairs[:, 1]]]
    numbers = np.flatnonzero(moves)
    numbers = numbers[reachable_pairs(problem, still, body == 0, numbers)]
    small, scene = problem.with_start(problem.start), _scene(problem, numbers)
    for name in ("goals", "constraints", "measures"):  # what brings surfaces together reads the scene's pieces
        terms = (term.resolve(scene, small.start) if term.touching else term for term in getattr(problem, name))
        setattr(small, name, tuple(terms))
    vars(small).update(scene=scene, clearances=problem.clearances[numbers])  # users state another problem instead
    counts = {
        "pairs": (len(table.pairs), len(numbers)),
        "pieces": (whole.geometry.ngeoms, small.scene.geometry.ngeoms),
    }
    things = tuple(name for name in whole.objects if name not in small.scene.objects)
    rigid = int((~moves).sum())
    return Simplified(small, problem, LeftOut(len(moves) - rigid - len(numbers), rigid, things, counts))


def _scene(problem: Problem, numbers: Indices) -> Scene:
    """A scene of the figure, the things of these pairs and of contact terms, and these pairs, in their order."""
    whole, owned, things = problem.scene, problem.scene.piece_owner, problem.scene.objects
    geometry, figure = whole.geometry, whole.figure
    terms = (*problem.goals, *problem.constraints, *problem.measures)
    used = {owned[index] for index in np.unique(whole.pair_table.pairs[numbers]).tolist()}
    used |= {name for term in terms for pair in term.touching for name in pair}
    kept = [k for k, owner in enumerate(owned) if owner in used or owner not in things]
    place = np.full(geometry.ngeoms, -1, dtype=np.intp)
    place[kept] = np.arange(len(kept))
    pairs: Indices = place[whole.pair_table.pairs[numbers]]
    made = geometry_model([pin.GeometryObject(geometry.geometryObjects[old]) for old in kept], pairs, most=0)
    owners = tuple(owned[old] for old in kept)
    objects: list[SceneObject] = [things[name] for name in things if name in used]
    known = whole.built.pieces_of
    places = {thing.name: [(int(place[old]), local) for old, local in known[thing.name]] for thing in objects}
    swept = [whole.pair_table.swept[old] for old in kept]
    built = SceneGeometry(figure.model, made, owners, places, pairs, swept)
    return Scene.of_parts(figure, objects, built, whole.revision)


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
        self._still: dict[int, pin.SE3] = {}
        if self._frozen:
            data = model.createData()  # takes as long as all the rest
            pin.forwardKinematics(model, data, start)
        self._ranges: dict[int, Range | None] = {}
        self._near: list[list[int]] = [[] for _ in range(model.njoints)]
        for j in range(1, model.njoints):
            if self._frozen.issuperset(range(model.idx_vs[j], model.idx_vs[j] + model.nvExtendeds[j])):
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
    still = np.zeros(problem.scene.model.nv, dtype=bool)
    with problem.scene.figure.posed(problem.start) as state:
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
    with scene.figure.posed(start) as state:
        joints = state.data.oMi
        at = np.array(
            [_columns(joints[piece.parentJoint] * piece.placement) for piece in scene.geometry.geometryObjects]
        )
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


def _columns(at: pin.SE3) -> list[Array]:
    """Columns of a placement's rotation, and its translation; a workspace has them too, and takes longer to make."""
    return [*at.rotation.T, at.translation]


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
