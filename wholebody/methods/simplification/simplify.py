"""Makes a problem without the joints, pairs and things that cannot matter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import assess
from wholebody.base import checks
from wholebody.base.arrays import Array, Indices, brief
from wholebody.figures.description import is_root
from wholebody.figures.figure import Figure
from wholebody.figures.self_pairs import random_postures
from wholebody.figures.state import State
from wholebody.geometry.large_models import geometry_model
from wholebody.methods.simplification.reach import reachable_pairs, still_dofs
from wholebody.problem import Problem
from wholebody.scene.geometry_model import SceneGeometry, SceneObject
from wholebody.scene.scene import Scene
from wholebody.solution import Solution
from wholebody.tasks.answers import is_own
from wholebody.tasks.base import Bound, Constraint, Goal, Measure, Term
from wholebody.tasks.bounds import Freeze

SAME = 1e-7  # largest difference in the values and derivatives of one function, relative to their size


class _Part:
    """The postures of a figure without some joints, among those of the whole one."""

    def __init__(self, whole: pin.Model, small: pin.Model, start: Array) -> None:
        """Match the joints by name; the others stay as in `start`, (nq,)."""
        joints = [whole.joints[whole.getJointId(name)] for name in list(small.names)[1:]]
        self.idx_q = _places([(int(joint.idx_q), int(joint.nq)) for joint in joints])
        self.idx_v = _places([(int(joint.idx_v), int(joint.nv)) for joint in joints])
        self.model, self.start = whole, np.array(start, dtype=float)

    def embed(self, q: Array) -> Array:
        """Whole posture (nq,) of a small one."""
        whole: Array = self.start.copy()
        whole[self.idx_q] = q
        return whole

    def whole(self, state: State) -> State:
        """The state of the whole figure at the posture of the small one; it belongs to the owner of the small state."""
        q, whole = self.embed(state.q), state.companion(self, self.model)
        return whole if np.array_equal(q, whole.q) else whole.update(q)


class EmbeddedMeasure(Measure):
    """A measure of the whole figure; the share of the other joints is part of its value."""

    def __init__(self, term: Measure, part: _Part) -> None:
        self.term, self.part = term, part

    @property
    def weight(self) -> float:
        """As the measure's."""
        return self.term.weight

    def value(self, state: State) -> float:
        """As the measure's."""
        return self.term.value(self.part.whole(state))

    def gradient(self, state: State) -> Array:
        """(small nv,)."""
        return np.asarray(self.term.gradient(self.part.whole(state))[self.part.idx_v])

    def curvature(self, state: State) -> Array:
        """(small nv,)."""
        return np.asarray(self.term.curvature(self.part.whole(state))[self.part.idx_v])

    def squares(self, state: State) -> tuple[Array, Array] | None:
        """(k,) and (k, small nv)."""
        found = self.term.squares(self.part.whole(state))
        return None if found is None else (found[0], np.asarray(found[1][:, self.part.idx_v]))


def _places(spans: Sequence[tuple[int, int]]) -> Indices:
    return np.array([place for first, size in spans for place in range(first, first + size)], dtype=np.intp)


@dataclass(frozen=True)
class LeftOut:
    """The parts that a simplified problem omits.

    Attributes:
        joints: names of the joints that the problem freezes.
        pairs: number of pairs that cannot come nearer than their clearance.
        rigid: number of pairs that do not move relative to each other, because joints are frozen.
        things: names of the things of which no pair is left.
        counts: degrees of freedom, pairs and pieces before and after.
    """

    joints: tuple[str, ...]
    pairs: int
    rigid: int
    things: tuple[str, ...]
    counts: dict[str, tuple[int, int]]

    def __str__(self) -> str:
        """One line for each kind of part left out."""
        lines = [f"{name}: {after} of {before}" for name, (before, after) in self.counts.items()]
        lines.append(f"{self.pairs} pairs cannot come within their clearance, {self.rigid} do not move to each other")
        lines += [f"{len(self.things)} things cannot be reached"] if self.things else []
        lines += [f"{len(self.joints)} joints are frozen"] if self.joints else []
        return "\n".join(lines)


@dataclass(frozen=True)
class Simplified:
    """A smaller problem whose answers are answers of the whole one.

    Attributes:
        problem: the smaller problem.
        whole: the problem that it was made from.
        left_out: the omitted parts.
    """

    problem: Problem
    whole: Problem
    left_out: LeftOut
    _part: _Part = field(repr=False)

    __repr__ = brief

    def posture(self, q: Array) -> Array:
        """Posture of the whole figure, (nq,), of one of the smaller figure (small nq,)."""
        return self._part.embed(checks.posture(q, self.problem.scene.model.nq))

    def restored(self, solution: Solution) -> Solution:
        """A method's answer to `problem`, assessed in the whole one: "infeasible" where a thing was moved since."""
        checks.instance(solution, Solution, "restored: solution", "give what wb.solve(part.problem) returns")
        q = self.posture(solution.q)
        judged = assess(self.whole, q)
        status, message = solution.status, solution.message
        if status == "solved" and not judged.holds(1e-4):  # m, rad
            status, message = "infeasible", "what was left out does matter here; solve the whole problem from this one"
        return replace(solution, q=q, status=status, assessment=judged, message=message)


def simplify(problem: Problem) -> Simplified:
    """A problem without frozen joints, without pairs that cannot touch in any allowed posture, and the same answers.

    Things without a remaining pair are left out too, but for those of contact terms. The statement holds for the
    present placements of things. Frozen joints stay where a term cannot be stated on the smaller figure. A solve takes
    a twelfth less time in the median, so it repays after some 10 solves.

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
    frozen = [j for j in range(1, model.njoints) if still.issuperset(freedoms[j])]
    body = np.arange(model.njoints)
    for joint in frozen:
        body[joint] = body[model.parents[joint]]
    moves = body[table.joint[table.pairs[:, 0]]] != body[table.joint[table.pairs[:, 1]]]
    numbers = np.flatnonzero(moves)
    numbers = numbers[reachable_pairs(problem, still, body == 0, numbers)]
    made = _without(problem, frozen, numbers) if frozen else None
    if made is None:
        frozen, figure = [], whole.figure
        part = _Part(model, model, problem.start)
        made = _stated(problem, problem.constraints, part, _scene(problem, figure, whole.geometry, numbers)), part
    small, part = made
    counts = {
        "degrees of freedom": (model.nv, small.scene.model.nv),
        "pairs": (len(table.pairs), len(numbers)),
        "pieces": (whole.geometry.ngeoms, small.scene.geometry.ngeoms),
    }
    things = tuple(name for name in whole.objects if name not in small.scene.objects)
    left_out = LeftOut(
        tuple(model.names[j] for j in frozen), int(moves.sum()) - len(numbers), int((~moves).sum()), things, counts
    )
    return Simplified(small, problem, left_out, part)


def _without(problem: Problem, frozen: list[int], numbers: Indices) -> tuple[Problem, _Part] | None:
    """The problem without some joints, with these pairs; None where a term is another one on the smaller figure."""
    scene, model = problem.scene, problem.scene.model
    names = [model.names[j] for j in range(1, model.njoints) if j not in frozen]
    figure = scene.figure.reduced(
        [name.removesuffix("_joint") if is_root(name) else name for name in names], problem.start
    )
    _, geometries = pin.buildReducedModel(model, [scene.geometry], frozen, problem.start)
    part = _Part(model, figure.model, problem.start)
    judge = _Comparison(problem, part, figure.model)
    constraints = [term for term in problem.constraints if is_own(term) or judge.matters(term)]
    try:
        small = _stated(problem, constraints, part, _scene(problem, figure, geometries[0], numbers))
    except Exception:  # a term of one's own may raise any error on another figure
        return None
    bounds = [bound for bound in problem.bounds if not isinstance(bound, Freeze)]
    before, after = (*problem.goals, *constraints, *bounds), (*small.goals, *small.constraints, *small.bounds)
    small.measures = tuple(
        anew if judge.alike(term, anew) else EmbeddedMeasure(term, part)
        for term, anew in zip(problem.measures, small.measures, strict=True)
    )
    return (small, part) if all(map(judge.alike, before, after)) else None


def _stated(problem: Problem, constraints: Sequence[Constraint], part: _Part, scene: tuple[Scene, Indices]) -> Problem:
    """The problem on a scene that has some of its pairs."""
    bounds = [bound for bound in problem.bounds if not isinstance(bound, Freeze) or len(part.idx_q) == len(part.start)]
    made = Problem(
        scene[0], part.start[part.idx_q], goals=problem.goals, constraints=[*constraints, *bounds],
        measures=problem.measures, clearance=problem.clearance, range_of_motion=False, balance=False,
    )  # fmt: skip
    made.clearances = problem.clearances[scene[1]]
    made.measures_given = problem.measures_given
    return made


class _Comparison:
    """Compares terms of a figure with those of a smaller one, at the start and at another posture."""

    def __init__(self, problem: Problem, part: _Part, small: pin.Model) -> None:
        self._part, self._whole, self._small = part, State(problem.scene.model), State(small)
        self._postures = [part.start[part.idx_q], *random_postures(small, 1, seed=1)]
        self._found: dict[int, list[Array]] = {}

    def matters(self, term: Constraint) -> bool:
        """Whether a constraint of the whole figure has a row that does not hold, or that a joint moves."""
        return bool(len(_moving_rows(self._values(term, self._whole))[0]))

    def alike(self, term: Term, other: Term) -> bool:
        """Whether a term of the whole figure and one of the smaller figure are the same function."""
        try:
            values, others = self._values(term, self._whole), self._values(other, self._small)
        except Exception:  # of one's own, at a posture that was tried
            return False
        if isinstance(term, Constraint):
            values, others = _moving_rows(values), _moving_rows(others)
        return all(
            a.shape == b.shape and np.abs(a - b).max(initial=0.0) <= SAME * (1.0 + np.abs(b).max(initial=0.0))
            for a, b in zip(values, others, strict=True)
        )

    def _values(self, term: Any, state: State) -> list[Array]:
        """Values of a term at the postures: all that a method reads, except the constant part of a measure."""
        if id(term) in self._found:
            return self._found[id(term)]
        values: list[Array] = []
        columns = self._part.idx_v if state is self._whole else np.arange(state.model.nv)
        for q in self._postures:
            state.update(self._part.embed(q) if state is self._whole else q)
            read = map(partial(np.array, dtype=float), _read(term, state, columns))
            values += [np.nan_to_num(one, posinf=1e300, neginf=-1e300) for one in read]
        if state is self._whole:  # whose terms outlive this; constraints are asked for twice
            self._found[id(term)] = values
        return values


def _read(term: Any, state: State, columns: Indices) -> list[Any]:
    """What a method reads of a term at a state, of these columns."""
    if isinstance(term, Goal):
        return [term.error(state), state.dense_jacobian(term.jacobian(state))[:, columns]]
    if isinstance(term, Measure):
        return [term.gradient(state)[columns], term.curvature(state)[columns]]
    if isinstance(term, Bound):
        return [np.array(term.bounds(state, None))[:, columns]]
    value, jacobian = np.atleast_1d(term.value(state)), state.dense_jacobian(term.jacobian(state))[:, columns]
    return [value, jacobian, *(np.broadcast_to(end, value.shape) for end in (term.lower, term.upper))]


def _moving_rows(values: list[Array]) -> list[Array]:
    """Values of a constraint without the rows that hold and that no joint moves."""
    value, lower, upper = values[0], values[2], values[3]
    moves = np.any([np.abs(jacobian).max(axis=1, initial=0.0) > SAME for jacobian in values[1::4]], axis=0)
    keep = moves | (value < lower - SAME) | (value > upper + SAME)
    return [part[keep] for part in values]


def _scene(problem: Problem, figure: Figure, geometry: pin.GeometryModel, numbers: Indices) -> tuple[Scene, Indices]:
    """A scene of a figure, the things of these pairs and of contact terms, and these pairs, in their original order."""
    whole, owned, things = problem.scene, problem.scene.piece_owner, problem.scene.objects
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
    return Scene.of_parts(figure, objects, SceneGeometry(figure.model, made, owners, places, pairs, swept)), numbers
