"""Makes a smaller problem from a problem."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import coal
import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, Indices
from wholebody.figures.description import ROOT_JOINT
from wholebody.figures.figure import Figure
from wholebody.geometry.hull import hull_piece, simplified_hull
from wholebody.geometry.large_models import geometry_model
from wholebody.geometry.pieces import COAL_ACCURACY, Piece
from wholebody.methods.simplification.active_joints import ActiveJoints, active_joints
from wholebody.methods.simplification.embedding import Embedding, restated_term
from wholebody.methods.simplification.pairs import PROBE, reachable_pairs
from wholebody.methods.simplification.simplified import LeftOut, Simplified
from wholebody.problem import Problem
from wholebody.scene.geometry_model import SceneGeometry, SceneObject
from wholebody.scene.scene import Scene
from wholebody.tasks.base import Bound, Constraint, Goal, Measure, Term
from wholebody.tasks.bounds import Freeze

GROWTH = 2e-3  # m: how far a piece with fewer corners may protrude from the original one


@dataclass(frozen=True)
class Parts:
    """The kinds of parts to leave out, separately, so that their effects can be measured.

    Attributes:
        joints: leave out joints that the problem freezes.
        lock: also lock joints that are not active.
        pairs: drop pairs that cannot come near, and things without a remaining pair.
        growth: how far a piece with fewer corners may protrude from the original one, metres; 0 keeps all pieces.
    """

    joints: bool = True
    lock: bool = True
    pairs: bool = True
    growth: float = GROWTH


@dataclass(frozen=True)
class _Smaller:
    """The part of the smaller scene that terms need, before the scene is made."""

    figure: Figure
    geometry: pin.GeometryModel
    piece_owner: tuple[str, ...]

    @property
    def model(self) -> pin.Model:
        """The smaller figure's."""
        return self.figure.model


def simplify(problem: Problem, *, lock: bool = True) -> Simplified:
    """A smaller problem whose answers are answers of this one, with fewer joints, pairs and corners.

    Args:
        problem: any problem; it is not changed.
        lock: whether joints that are not active stay as they start; False keeps all that are not frozen.

    Returns:
        The smaller problem, the conversion to the whole figure, and the parts that were left out with bounds.

    Raises:
        InputError: it is no problem, or objects were added to or removed from its scene after it was made.
    """
    checks.instance(problem, Problem, "simplify: problem", "state one with wb.Problem(scene, goals=[...])")
    lock = checks.flag(lock, "lock")
    return leave_out(problem, Parts(lock=lock))


def leave_out(problem: Problem, parts: Parts) -> Simplified:
    """Leave some kinds of parts out of a problem.

    Raises:
        InputError: objects were added to or removed from the scene after the problem was made.
    """
    problem.check_fresh()
    whole = problem.scene
    part = active_joints(problem, parts.lock) if parts.joints else None
    figure, geometry = _smaller_figure(problem, part)
    embedding = Embedding(whole.model, figure.model, problem.start)
    start = problem.start[embedding.idx_q]
    numbers, rigid = _moving_pairs(problem, geometry)
    terms = _terms(problem, _Smaller(figure, geometry, whole.piece_owner), start, embedding)
    if parts.pairs:
        frozen = np.flatnonzero(part.frozen).tolist() if part is not None else []
        still = [dof for j in frozen for dof in _dofs(figure, whole.model.names[j])]
        near = reachable_pairs(
            figure, list(geometry.geometryObjects), whole.pair_table.reach, whole.pair_table.pairs[numbers], start,
            problem.clearances[numbers], terms[1], still,
        )  # fmt: skip
        numbers = numbers[near]
    pieces, grown = _pieces(problem, geometry, numbers, parts.growth)
    kept = _kept_pieces(whole, numbers) if parts.pairs else list(range(geometry.ngeoms))
    small = _scene(whole, figure, geometry, kept, numbers, pieces)
    made = Problem(
        small, start, goals=terms[0], constraints=[*terms[1], *terms[2]], measures=terms[3],
        clearance=problem.clearance, range_of_motion=False, balance=False,
    )  # fmt: skip
    made.clearances = problem.clearances[numbers]
    made.measures_given = problem.measures_given
    return Simplified(made, problem, _left_out(problem, made, part, len(numbers), rigid, grown), embedding)


def _smaller_figure(problem: Problem, part: ActiveJoints | None) -> tuple[Figure, pin.GeometryModel]:
    """The figure without the joints that are not active, and the scene's geometry on its joints."""
    scene = problem.scene
    if part is None or part.moving[1:].all():
        return scene.figure, scene.geometry
    names = scene.model.names
    keep = ["root" if names[j] == ROOT_JOINT else names[j] for j in np.flatnonzero(part.moving).tolist()]
    figure = scene.figure.reduced(keep, problem.start)
    locked = [j for j in range(1, scene.model.njoints) if not part.moving[j]]
    _, geometries = pin.buildReducedModel(scene.model, [scene.geometry], locked, problem.start)
    return figure, geometries[0]


def _moving_pairs(problem: Problem, geometry: pin.GeometryModel) -> tuple[Indices, int]:
    """Numbers of the pairs whose pieces still move relative to each other, and how many do not."""
    joint = np.array([piece.parentJoint for piece in geometry.geometryObjects], dtype=np.intp)
    pairs = problem.scene.pair_table.pairs
    moves = joint[pairs[:, 0]] != joint[pairs[:, 1]]
    return np.flatnonzero(moves), int((~moves).sum())


def _terms(
    problem: Problem, small: _Smaller, start: Array, embedding: Embedding
) -> tuple[list[Goal], list[Constraint], list[Bound], list[Measure]]:
    """Goals, constraints, bounds and measures on the smaller figure."""
    same = small.figure is problem.scene.figure

    def restated(terms: tuple[Term, ...], *, holds: bool = False) -> list[Term]:
        found = [
            term if same and not term.touching else restated_term(term, small, start, embedding, holds=holds)
            for term in terms
        ]
        return [term for term in found if term is not None]

    if same:
        goals, constraints = restated(problem.goals), restated(problem.constraints, holds=True)
        return goals, constraints, list(problem.bounds), list(problem.measures)  # type: ignore[return-value]
    bounds = tuple(bound for bound in problem.bounds if not isinstance(bound, Freeze))  # frozen joints are locked
    return (
        restated(problem.goals), restated(problem.constraints, holds=True),
        restated(bounds), restated(problem.measures),
    )  # type: ignore[return-value]  # fmt: skip


def _pieces(
    problem: Problem, geometry: pin.GeometryModel, numbers: Indices, growth: float
) -> tuple[dict[int, pin.GeometryObject], dict[str, float]]:
    """Pieces with fewer corners, by index; not if one would be nearer at the start than its clearance."""
    if growth <= 0.0:
        return {}, {}
    scene = problem.scene
    pairs = scene.pair_table.pairs
    near = scene.contacts(problem.start, problem.clearance + 2.0 * growth)
    tight = near.distance < problem.clearances[near.number] + 2.0 * growth
    crowded = set(near.pair[tight].ravel().tolist())
    found, grown = {}, {}
    for index in np.unique(pairs[numbers]).tolist():
        piece = geometry.geometryObjects[index]
        made = None if index in crowded else simplified_piece(piece, growth)
        if made is not None:
            found[index], grown[piece.name] = made
    return found, grown


def _kept_pieces(scene: Scene, numbers: Indices) -> list[int]:
    """All pieces of the figure, and those of things with a remaining pair."""
    used = {scene.piece_owner[index] for index in np.unique(scene.pair_table.pairs[numbers]).tolist()}
    return [k for k, owner in enumerate(scene.piece_owner) if owner in used or owner not in scene.objects]


def _scene(
    whole: Scene,
    figure: Figure,
    geometry: pin.GeometryModel,
    kept: range | list[int],
    numbers: Indices,
    coarse: dict[int, pin.GeometryObject] | None = None,
) -> Scene:
    """A scene of these pieces and pairs, in their original order."""
    place = {old: new for new, old in enumerate(kept)}
    chosen = [(coarse or {}).get(old, geometry.geometryObjects[old]) for old in kept]
    both = [(place[first], place[second]) for first, second in whole.pair_table.pairs[numbers].tolist()]
    pairs = np.array(both, dtype=np.intp).reshape(-1, 2)
    made = geometry_model([pin.GeometryObject(piece) for piece in chosen], pairs)
    owners = tuple(whole.piece_owner[old] for old in kept)
    objects = [thing for name, thing in whole.objects.items() if name in set(owners)]
    places = _places_in_things(objects, owners, geometry, kept, chosen)
    built = SceneGeometry(figure.model, made, owners, places, pairs)
    return Scene.of_parts(figure, objects, built)


def _places_in_things(
    objects: list[SceneObject],
    owners: tuple[str, ...],
    geometry: pin.GeometryModel,
    kept: range | list[int],
    chosen: list[pin.GeometryObject],
) -> dict[str, list[tuple[int, pin.SE3]]]:
    """Index of each piece of a thing, and its placement in the thing."""
    pieces: dict[str, list[int]] = {thing.name: [] for thing in objects}
    for index, owner in enumerate(owners):
        if owner in pieces:
            pieces[owner].append(index)
    places = {}
    for thing in objects:
        places[thing.name] = [
            (index, part.placement * geometry.geometryObjects[kept[index]].placement.actInv(chosen[index].placement))
            for index, part in zip(pieces[thing.name], thing.shape.pieces(), strict=True)
        ]
    return places


def _dofs(figure: Figure, joint: str) -> list[int]:
    """Degrees of freedom of a joint, none if it is not in this figure."""
    index = list(figure.model.names).index(joint) if joint in list(figure.model.names) else 0
    first = figure.model.joints[index].idx_v if index else 0
    return list(range(first, first + figure.model.joints[index].nv)) if index else []


def _left_out(
    whole: Problem, small: Problem, part: ActiveJoints | None, pairs: int, rigid: int, grown: dict[str, float]
) -> LeftOut:
    names = list(whole.scene.model.names)
    frozen = tuple(names[j] for j in np.flatnonzero(part.frozen & ~part.moving)) if part is not None else ()
    locked = tuple(names[j] for j in range(1, len(names)) if not (part.moving[j] or part.frozen[j])) if part else ()
    before = len(whole.scene.pair_table.pairs)
    return LeftOut(
        locked=locked,
        frozen=frozen,
        helpers=part.helpers if part is not None else (),
        excess=part.excess if part is not None else 0.0,
        pairs=before - rigid - pairs,
        rigid=rigid,
        things=tuple(name for name in whole.scene.objects if name not in small.scene.objects),
        pieces=grown,
        counts={
            "degrees of freedom": (whole.scene.model.nv, small.scene.model.nv),
            "pairs": (before, pairs),
            "pieces": (whole.scene.geometry.ngeoms, small.scene.geometry.ngeoms),
        },
    )


def simplified_piece(piece: pin.GeometryObject, growth: float) -> tuple[pin.GeometryObject, float] | None:
    """A piece with fewer corners around a hull.

    Args:
        piece: any piece.
        growth: how far the new piece may protrude from the hull, metres.

    Returns:
        The piece and how far it protrudes at most; None if the piece has few corners, or cannot be simplified.
    """
    if not isinstance(piece.geometry, coal.Convex):
        return None
    points = np.array(piece.geometry.points())
    if len(points) <= 64:  # simplifying fewer corners saves no measurable time
        return None
    found = _around(points.tobytes(), growth)
    if found is None:
        return None
    made, out = found
    coarse = pin.GeometryObject(
        piece.name, piece.parentJoint, piece.parentFrame, piece.placement * made.placement, made.geometry
    )
    coarse.meshColor[:] = piece.meshColor
    return coarse, out


@lru_cache(maxsize=256)
def _around(corners: bytes, growth: float) -> tuple[Piece, float] | None:
    """The simplest hull around these corners that protrudes no farther, and how far it does."""
    points = np.frombuffer(corners).reshape(-1, 3)
    whole = hull_piece(points)
    for most in (8, 16, 32, 48):
        outer = simplified_hull(points, most)
        out = farthest(outer - whole.placement.translation, whole.geometry)
        if out <= growth:
            return hull_piece(outer), out
    return None


def farthest(points: Array, hull: coal.Convex) -> float:
    """How far a polytope with these corners, (n, 3), protrudes from a hull: the distance is convex, so a corner's."""
    probe, here, request = coal.Sphere(PROBE), coal.Transform3s.Identity(), coal.DistanceRequest()
    out = 0.0
    for point in points:
        there = coal.Transform3s(np.eye(3), point)
        # a new result for each query: coal keeps the least distance of all queries of one result
        out = max(out, float(coal.distance(hull, here, probe, there, request, coal.DistanceResult())) + PROBE)
    return out + COAL_ACCURACY
