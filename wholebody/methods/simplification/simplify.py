"""Makes a problem without the pairs and things that cannot matter."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import assess
from wholebody.base import checks
from wholebody.base.arrays import Indices, brief
from wholebody.geometry.large_models import geometry_model
from wholebody.methods.simplification.reach import reachable_pairs, still_dofs
from wholebody.problem import Problem
from wholebody.scene.geometry_model import SceneGeometry, SceneObject
from wholebody.scene.scene import Scene
from wholebody.solution import Solution


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
    joints are frozen and a twelfth less elsewhere, so it repays after some 5 solves.

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
    freedoms = [range(first, first + count) for first, count in zip(model.idx_vs, model.nvs, strict=True)]
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
