"""Makes a smaller problem from a problem, and takes its answers back to the whole figure."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import assess
from wholebody.base import checks
from wholebody.base.arrays import Array, Indices, brief
from wholebody.figures.description import is_root
from wholebody.figures.figure import Figure
from wholebody.geometry.large_models import geometry_model
from wholebody.methods.simplification.active_joints import ActiveJoints, active_joints
from wholebody.methods.simplification.embedding import Embedding, SmallerScene, restated
from wholebody.methods.simplification.reach import Balls, Reach, reachable_pairs
from wholebody.problem import Problem
from wholebody.scene.geometry_model import SceneGeometry, SceneObject
from wholebody.scene.scene import Scene
from wholebody.solution import Solution
from wholebody.tasks.bounds import Freeze


@dataclass(frozen=True)
class Parts:
    """The kinds of parts to leave out, separately, so that their effects can be measured."""

    joints: bool = True  # leave out joints that the problem freezes
    lock: bool = True  # also lock joints that are not active
    pairs: bool = True  # drop pairs that cannot come near, and things without a remaining pair


@dataclass(frozen=True)
class LeftOut:
    """The parts that a simplified problem omits, with bounds on the effect.

    Attributes:
        locked: joints that stay as at the start although no bound freezes them.
        frozen: joints that a bound keeps in place; leaving them out changes nothing.
        helpers: inequalities for which a locked joint could have helped. An answer in which none of them is at its
            bound loses at most `excess` by the locking.
        excess: the measures of the locked joints alone minus their least value. An answer's measure is at most this
            much higher if no helper and no pair of a locked joint is at its bound.
        pairs: number of pairs left out. None can come nearer than its clearance in any posture within the limits (and
            with the frames held that the problem holds); exact.
        rigid: number of pairs left out because no joint between the two is active.
        things: names of things without a remaining pair; they are not in the smaller scene.
        counts: kind of part -> (number in the whole problem, number in the simplified one), for the report.
    """

    locked: tuple[str, ...]
    frozen: tuple[str, ...]
    helpers: tuple[str, ...]
    excess: float
    pairs: int
    rigid: int
    things: tuple[str, ...]
    counts: dict[str, tuple[int, int]]

    @property
    def exact(self) -> bool:
        """Whether the answers are unchanged: no joint is locked but those that the problem freezes."""
        return not self.locked

    def __str__(self) -> str:
        """One line for each kind of part left out, with its bound."""
        lines = [f"{name}: {after} of {before}" for name, (before, after) in self.counts.items()]
        lines.append(
            f"{self.pairs} pairs cannot come nearer than their clearance, {self.rigid} do not move to each other: exact"
        )
        if self.things:
            lines.append(f"{len(self.things)} things cannot be reached: exact")
        if self.frozen:
            lines.append(f"{len(self.frozen)} joints are frozen by the problem: exact")
        if self.locked:
            helped = f"; could have helped {', '.join(self.helpers)}" if self.helpers else ""
            lines.append(
                f"{len(self.locked)} joints stay as they start, and move no goal: measure at most {self.excess:.3g} "
                f"higher by their own share{helped}"
            )
        return "\n".join(lines)


@dataclass(frozen=True)
class Simplified:
    """A smaller problem whose answers are answers of the whole one.

    Attributes:
        problem: the smaller problem. It has the placements that things had when it was made: simplify anew when they
            move.
        whole: the original problem.
        left_out: the parts that were left out, with bounds.
    """

    problem: Problem
    whole: Problem
    left_out: LeftOut
    _embedding: Embedding = field(repr=False)

    __repr__ = brief

    def posture(self, q: Array) -> Array:
        """Posture of the whole figure, (nq,), of one of the smaller figure (small nq,)."""
        return self._embedding.embed(checks.posture(q, self.problem.scene.model.nq))

    def restored(self, solution: Solution) -> Solution:
        """A method's answer to `problem` for the whole problem: its posture, with that one's assessment."""
        checks.instance(solution, Solution, "restored: solution", "give what wb.solve(part.problem) returns")
        q = self.posture(solution.q)
        judged = assess(self.whole, q)
        status, message = solution.status, solution.message
        if status == "solved" and not judged.holds(1e-4):  # m, rad
            status, message = "infeasible", "what was left out does matter here; solve the whole problem from this one"
        return replace(solution, q=q, status=status, assessment=judged, message=message)


def simplify(problem: Problem, *, lock: bool = True) -> Simplified:
    """A smaller problem whose answers are answers of this one, with fewer joints and pairs.

    Args:
        problem: any problem; it is not changed.
        lock: whether joints that are not active stay as they start; False keeps all that are not frozen.

    Returns:
        The smaller problem, the conversion to the whole figure, and the parts that were left out with bounds.

    Raises:
        InputError: it is no problem, or objects were added to or removed from its scene after it was made.

    Examples:
        >>> part = wb.simplify(problem)
        >>> part.restored(wb.solve(part.problem)).status
        'solved'
    """
    checks.instance(problem, Problem, "simplify: problem", "state one with wb.Problem(scene, goals=[...])")
    return leave_out(problem, Parts(lock=checks.flag(lock, "lock")))


def leave_out(problem: Problem, parts: Parts) -> Simplified:
    """Leave some kinds of parts out of a problem."""
    problem.check_fresh()
    whole = problem.scene
    part = active_joints(problem, parts.lock) if parts.joints else None
    figure, geometry = _smaller_figure(problem, part)
    embedding = Embedding(whole.model, figure.model, problem.start)
    start = problem.start[embedding.idx_q]
    table = whole.pair_table
    joint = np.array([piece.parentJoint for piece in geometry.geometryObjects], dtype=np.intp)
    moves = joint[table.pairs[:, 0]] != joint[table.pairs[:, 1]]
    numbers = np.flatnonzero(moves)
    small = SmallerScene(figure, geometry, whole.piece_owner, start)
    constraints = restated(problem.constraints, small, embedding, holds=True)
    bounds = [bound for bound in problem.bounds if embedding.trivial or not isinstance(bound, Freeze)]  # those lock
    kept = list(range(geometry.ngeoms))
    if parts.pairs:
        center = np.array([piece.placement.translation for piece in geometry.geometryObjects]).reshape(-1, 3)
        frozen = np.flatnonzero(part.frozen).tolist() if part is not None else []
        still = [dof for j in frozen for dof in _dofs(figure, whole.model.names[j])]
        reach = Reach(figure.model, start, Balls(center, table.reach, np.arange(len(kept))), joint, still)
        near = reachable_pairs(figure, reach, geometry, table, numbers, problem.clearances[numbers], constraints)
        numbers = numbers[near]
        used = {whole.piece_owner[index] for index in np.unique(table.pairs[numbers]).tolist()}
        kept = [k for k, owner in enumerate(whole.piece_owner) if owner in used or owner not in whole.objects]
    made = Problem(
        _scene(whole, figure, geometry, kept, numbers), start, goals=restated(problem.goals, small, embedding),
        constraints=[*constraints, *restated(bounds, small, embedding)],
        measures=restated(problem.measures, small, embedding),
        clearance=problem.clearance, range_of_motion=False, balance=False,
    )  # fmt: skip
    made.clearances = problem.clearances[numbers]
    made.measures_given = problem.measures_given
    return Simplified(made, problem, _left_out(problem, made, part, int((~moves).sum())), embedding)


def _smaller_figure(problem: Problem, part: ActiveJoints | None) -> tuple[Figure, pin.GeometryModel]:
    """The figure without the joints that are not active, and the scene's geometry on its joints."""
    scene = problem.scene
    if part is None or part.moving[1:].all():
        return scene.figure, scene.geometry
    names = scene.model.names
    keep = [
        names[j].removesuffix("_joint") if is_root(names[j]) else names[j] for j in np.flatnonzero(part.moving).tolist()
    ]
    figure = scene.figure.reduced(keep, problem.start)
    locked = [j for j in range(1, scene.model.njoints) if not part.moving[j]]
    _, geometries = pin.buildReducedModel(scene.model, [scene.geometry], locked, problem.start)
    return figure, geometries[0]


def _scene(whole: Scene, figure: Figure, geometry: pin.GeometryModel, kept: list[int], numbers: Indices) -> Scene:
    """A scene of these pieces and pairs, in their original order."""
    place = np.full(geometry.ngeoms, -1, dtype=np.intp)
    place[kept] = np.arange(len(kept))
    pairs: Indices = place[whole.pair_table.pairs[numbers]]
    made = geometry_model([pin.GeometryObject(geometry.geometryObjects[old]) for old in kept], pairs)
    owners = tuple(whole.piece_owner[old] for old in kept)
    objects: list[SceneObject] = [thing for name, thing in whole.objects.items() if name in set(owners)]
    known = whole.built.pieces_of
    places = {thing.name: [(int(place[old]), local) for old, local in known[thing.name]] for thing in objects}
    return Scene.of_parts(figure, objects, SceneGeometry(figure.model, made, owners, places, pairs))


def _dofs(figure: Figure, joint: str) -> list[int]:
    """Degrees of freedom of a joint, none if it is not in this figure."""
    names = list(figure.model.names)
    if joint not in names[1:]:
        return []
    made = figure.model.joints[names.index(joint)]
    return list(range(made.idx_v, made.idx_v + made.nv))


def _left_out(whole: Problem, small: Problem, part: ActiveJoints | None, rigid: int) -> LeftOut:
    names = list(whole.scene.model.names)
    before, after = (len(problem.scene.pair_table.pairs) for problem in (whole, small))
    return LeftOut(
        locked=tuple(names[j] for j in range(1, len(names)) if not (part.moving[j] or part.frozen[j])) if part else (),
        frozen=tuple(names[j] for j in np.flatnonzero(part.frozen & ~part.moving)) if part else (),
        helpers=part.helpers if part else (),
        excess=part.excess if part else 0.0,
        pairs=before - rigid - after,
        rigid=rigid,
        things=tuple(name for name in whole.scene.objects if name not in small.scene.objects),
        counts={
            "degrees of freedom": (whole.scene.model.nv, small.scene.model.nv),
            "pairs": (before, after),
            "pieces": (whole.scene.geometry.ngeoms, small.scene.geometry.ngeoms),
        },
    )
