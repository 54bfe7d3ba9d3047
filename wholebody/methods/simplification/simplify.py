"""Makes a problem without the pairs and things that cannot matter."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import assess
from wholebody.base import checks
from wholebody.base.arrays import Indices
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
        lines.append(
            f"{self.pairs} pairs cannot come nearer than their clearance, {self.rigid} do not move to each other"
        )
        if self.things:
            lines.append(f"{len(self.things)} things cannot be reached")
        return "\n".join(lines)


@dataclass(frozen=True)
class Simplified:
    """A smaller problem, of the same figure, whose answers are answers of the whole one.

    Attributes:
        problem: the smaller problem.
        whole: the problem that it was made from.
        left_out: the omitted parts.
    """

    problem: Problem
    whole: Problem
    left_out: LeftOut

    def restored(self, solution: Solution) -> Solution:
        """A method's answer to `problem`, assessed in the whole one: "infeasible" where a thing was moved since."""
        checks.instance(solution, Solution, "restored: solution", "give what wb.solve(part.problem) returns")
        judged = assess(self.whole, solution.q)
        status, message = solution.status, solution.message
        if status == "solved" and not judged.holds(1e-4):  # m, rad
            status, message = "infeasible", "what was left out does matter here; solve the whole problem from this one"
        return replace(solution, status=status, assessment=judged, message=message)


def simplify(problem: Problem) -> Simplified:
    """A problem without the pairs that cannot touch in any allowed posture, and without the things that have no other.

    The statement holds for the present placements of things. What contact terms bring together stays.

    Raises:
        InputError: it is no problem, or objects came to or left its scene after it was stated.
    """
    checks.instance(problem, Problem, "simplify: problem", "state one with wb.Problem(scene, goals=[...])")
    problem.check_fresh()
    whole = problem.scene
    still, table = still_dofs(problem), whole.pair_table
    body = _bodies(whole.model, set(still))[table.joint]
    moves = body[table.pairs[:, 0]] != body[table.pairs[:, 1]]
    numbers = np.flatnonzero(moves)
    numbers = numbers[reachable_pairs(problem, still, numbers)]
    terms = (*problem.goals, *problem.constraints, *problem.measures)
    used = {whole.piece_owner[index] for index in np.unique(table.pairs[numbers]).tolist()}
    used |= {name for term in terms for pair in term.touching for name in pair}
    made = Problem(
        _scene(whole, used, numbers), problem.start, goals=problem.goals,
        constraints=[*problem.constraints, *problem.bounds], measures=problem.measures,
        clearance=problem.clearance, range_of_motion=False, balance=False,
    )  # fmt: skip
    made.clearances = problem.clearances[numbers]
    made.measures_given = problem.measures_given
    counts = {
        "pairs": (len(table.pairs), len(numbers)),
        "pieces": (whole.geometry.ngeoms, made.scene.geometry.ngeoms),
    }
    things = tuple(name for name in whole.objects if name not in made.scene.objects)
    return Simplified(made, problem, LeftOut(int(moves.sum()) - len(numbers), int((~moves).sum()), things, counts))


def _bodies(model: pin.Model, still: set[int]) -> Indices:
    """(njoints,) number of the rigid body that each joint carries while some degrees of freedom are still."""
    body = np.arange(model.njoints)
    for joint in range(1, model.njoints):
        if still.issuperset(range(model.idx_vs[joint], model.idx_vs[joint] + model.nvs[joint])):
            body[joint] = body[model.parents[joint]]
    return body


def _scene(whole: Scene, used: set[str], numbers: Indices) -> Scene:
    """A scene of the figure, the things that are used, and these pairs, in their original order."""
    kept = [k for k, owner in enumerate(whole.piece_owner) if owner in used or owner not in whole.objects]
    place = np.full(whole.geometry.ngeoms, -1, dtype=np.intp)
    place[kept] = np.arange(len(kept))
    pairs: Indices = place[whole.pair_table.pairs[numbers]]
    made = geometry_model([pin.GeometryObject(whole.geometry.geometryObjects[old]) for old in kept], pairs)
    owners = tuple(whole.piece_owner[old] for old in kept)
    objects: list[SceneObject] = [thing for name, thing in whole.objects.items() if name in set(owners)]
    known = whole.built.pieces_of
    places = {thing.name: [(int(place[old]), local) for old, local in known[thing.name]] for thing in objects}
    return Scene.of_parts(whole.figure, objects, SceneGeometry(whole.model, made, owners, places, pairs))
