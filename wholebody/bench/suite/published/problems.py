"""A case of a set as the content of a file, all of it in numbers, and the seeds from which a solver begins."""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import FileFormatError, InputError, UnknownNameError
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.compare.results import DEFAULT
from wholebody.bench.suite.compare.solving import Ready, kernel_seconds, ready, solve
from wholebody.bench.suite.problem_sets.bodies import fitted, held
from wholebody.bench.suite.problem_sets.case import Case
from wholebody.bench.suite.problem_sets.registry import problem_set
from wholebody.bench.suite.published.answers import SEEDS
from wholebody.bench.suite.published.bodies import BodyFiles, Meshes, body_files, described, pose_of
from wholebody.bench.suite.published.rebuilt import VERSION, Rebuilt, dumped, read_index
from wholebody.bench.tables import machine
from wholebody.bench.tables import sentence as machine_sentence
from wholebody.figures.figure import Figure
from wholebody.tasks.base import Goal


def problem_name(family: str, number: int) -> str:
    """Name of a problem in files and answers, such as "clutter/0007"."""
    return f"{family}/{number:04d}"


def problem_content(case: Case, body: BodyFiles, far: Array, meshes: Meshes) -> dict[str, Any]:
    """A case as the content of its file, with the far seed (nq,); hulls of things go to the meshes."""
    problem, name = case.problem, problem_name(case.set, case.number)
    if problem.bounds or problem.measures_given:
        raise InputError(f"{name}: only problems without bounds and measures of their own are published")
    things, untested = _things(case, body, meshes)
    content: dict[str, Any] = {
        "format": "wholebody problem",
        "version": VERSION,
        "name": name,
        "set": case.set,
        "body": f"bodies/{body.name}.json",
        "seeds": {"near": body.posture(problem.start), "far": body.posture(far)},
        "goals": [] if case.frames else [_goal(goal) for goal in problem.goals],
        "holds": [_hold(term) for term in problem.constraints if isinstance(term, wb.Hold)],
        "balance": [_balance(term, body.links) for term in problem.constraints if isinstance(term, wb.Balance)],
        "effort_from": body.posture(problem.start),
        "things": things,
        "untested": untested,
        "clearance": {"every_pair": problem.clearance, "except": _exceptions(problem)},
    }
    others = [term for term in problem.constraints if not isinstance(term, (wb.Hold, wb.Balance))]
    if others:
        raise InputError(f"{name}: the files have no word for {type(others[0]).__name__}")
    if case.frames:
        content |= {"dt": case.dt, "frames": [[_goal(goal) for goal in goals] for goals in case.frames]}
    return content


def _goal(goal: Goal) -> dict[str, Any]:
    if isinstance(goal, wb.Point):
        if np.any(goal.resolved_offset):
            raise InputError(f"Point({goal.frame!r}) has an offset, which the files have no word for; add a frame")
        return _placed(goal.frame, None, goal.resolved_target, None)
    if isinstance(goal, wb.Frame):
        return _placed(goal.frame, None, goal.resolved_target.translation, goal.resolved_target.rotation)
    if isinstance(goal, wb.Relative):
        target = goal.residual.placement
        return _placed(goal.frame, goal.to, target.translation, target.rotation if goal.orientation else None)
    if isinstance(goal, wb.Axis) and goal.toward is not None:
        axis, target = goal.basis[2], goal.resolved_target
        return {"type": "axis", "frame": goal.frame, "axis": _listed(axis), "toward": _listed(target)}
    raise InputError(f"the files have no word for the goal {type(goal).__name__}")


def _hold(hold: wb.Hold) -> dict[str, Any]:
    at = hold.kept_at
    return _placed(hold.frame, hold.relative_to, at.translation, at.rotation if hold.orientation else None)


def _placed(frame: str, base: str | None, position: Array, rotation: Array | None) -> dict[str, Any]:
    turn = None if rotation is None else _listed(pin.Quaternion(rotation).coeffs())
    return {"type": "placement", "frame": frame, "in": base, "position": _listed(position), "quaternion": turn}


def _balance(term: wb.Balance, links: Sequence[str]) -> dict[str, Any]:
    """The centre of mass x of the body, or of those links `of` it, fulfils `normals @ x[:2] - offsets >= margin`."""
    said = {"normals": [_listed(row) for row in term.normals], "offsets": _listed(term.offsets), "margin": term.margin}
    return said if term.joints is None else {**said, "of": [links[joint] for joint in term.joints]}


def _things(case: Case, body: BodyFiles, meshes: Meshes) -> tuple[list[dict[str, Any]], list[list[str]]]:
    """Pieces of all things, and the pairs not tested although the rule would: thing and body, carried and world."""
    geometry = case.problem.scene.geometry
    own = case.problem.scene.figure.geometry.ngeoms
    pieces = list(geometry.geometryObjects)
    things = [
        {
            "name": piece.name,
            "link": body.links[piece.parentJoint] if piece.parentJoint else None,
            "pose": pose_of(piece.placement),
            "shape": described(piece.geometry, meshes, f"{case.set}-{case.number:04d}-{piece.name}"),
        }
        for piece in pieces[own:]
    ]
    tested = {(pair.first, pair.second) for pair in geometry.collisionPairs if pair.second >= own}
    ruled = {
        (first, second)
        for second in range(own, len(pieces))
        for first in range(second)
        if first < own or (pieces[first].parentJoint > 0) != (pieces[second].parentJoint > 0)
    }
    if tested - ruled:
        first, second = min(tested - ruled)
        raise InputError(f"{pieces[first].name} and {pieces[second].name} are both carried; the files cannot say that")
    return things, [[pieces[first].name, pieces[second].name] for first, second in sorted(ruled - tested)]


def _exceptions(problem: wb.Problem) -> list[list[Any]]:
    """Pairs whose least distance is another: what rests on something at the start."""
    geometry = problem.scene.geometry
    names = [piece.name for piece in geometry.geometryObjects]
    return [
        [names[pair.first], names[pair.second], float(least)]
        for pair, least in zip(geometry.collisionPairs, problem.clearances, strict=True)
        if abs(least - problem.clearance) > 1e-12  # m: clearances that differ by less are the same
    ]


def witness_content(case: Case, body: BodyFiles) -> dict[str, Any]:
    """What proves the case possible: one posture, or one a frame."""
    if case.frames:
        return {"postures": [body.posture(q) for q in case.path]}
    return {"posture": body.posture(case.witness)}


def _listed(values: Sequence[float] | Array) -> list[float]:
    return [float(value) + 0.0 for value in values]


def far_seed(case: Case, rng: np.random.Generator) -> Array:
    """A random, difficult start posture (nq,): the first of some draws without overlap, or that of least overlap."""
    # Joints that carry frames held in the world stay; Newton's method joins frames that hold each other.
    problem = case.problem
    free, closing = _free(problem), [term for term in held(problem) if term.hold.relative_to is not None]
    best, least = np.array(problem.start), np.inf
    for _ in range(60):
        q = _drawn(problem, free, rng)
        if closing:
            closed = fitted(problem.scene.figure, q, closing, free)
            if closed is None:
                continue
            q = closed
        depth = wb.assess(problem, q).penetration
        if depth < least:
            best, least = q, depth
        if depth <= 0.0:
            break
    return best


def _free(problem: wb.Problem) -> Indices:
    """Places in the tangent of the joints with limits that carry nothing that is held in the world."""
    model = problem.scene.model
    carrying: set[int] = set()
    for term in problem.constraints:
        if isinstance(term, wb.Hold) and term.relative_to is None:
            carrying |= set(_supports(model, model.frames[problem.scene.figure.frame_id(term.frame)].parentJoint))
    legs = carrying - {0, *problem.scene.figure.roots.values()}
    beyond = {joint for joint in range(1, model.njoints) if legs & set(_supports(model, joint))}
    limits = problem.scene.figure.limits
    kept = {model.joints[joint].idx_v for joint in carrying | beyond if joint > 0}
    return np.array([place for place in limits.idx_v.tolist() if place not in kept], dtype=np.intp)


def _supports(model: pin.Model, joint: int) -> Sequence[int]:
    return [int(above) for above in model.supports[joint]]


def _drawn(problem: wb.Problem, free: Indices, rng: np.random.Generator) -> Array:
    limits = problem.scene.figure.limits
    chosen = np.isin(limits.idx_v, free)
    q = np.array(problem.start)
    q[limits.idx_q[chosen]] = rng.uniform(limits.lower[chosen], limits.upper[chosen])
    return q


def away(case: Case) -> Array:
    """Way (n,) of all joints but free roots from the start to the end of its path [rad, m], or to the witness."""
    figure = case.problem.scene.figure
    end = case.path[-1] if len(case.path) else case.witness
    found = pin.difference(figure.model, case.problem.start, end)
    roots = [figure.model.joints[joint].idx_v for joint in figure.roots.values()]
    return np.delete(found, [first + k for first in roots for k in range(6)])


def descended(case: Case, seed: Array) -> Array | None:
    """The posture (nq,) in which the descent from a seed (nq,) ends; None where goals and holds are not closed."""
    problem = case.problem
    figure = problem.scene.figure
    goals = problem.goals
    if case.frames:
        goals = tuple(goal.resolve(problem.scene, problem.start) for goal in case.frames[0])
    return fitted(figure, figure.clamp(seed), [*goals, *held(problem)], np.arange(figure.model.nv))


def chosen_problems(folder: Path, sets: Sequence[str] | None = None) -> list[tuple[str, int]]:
    """Sets and numbers of the problems of an export; UnknownNameError for a set that it does not have."""
    known = read_index(folder)["sets"]
    for name in sets or ():
        if name not in known:
            raise UnknownNameError("problem set", name, known, str(folder))
    return [(name, number) for name in sets or known for number in range(len(known[name]["problems"]))]


class Answering:
    """A method that answers the problems of an export one after the other from both seeds."""

    def __init__(self, folder: Path, adapter: Adapter) -> None:
        """Take the folder of an export; InputError or FileFormatError where it is none."""
        self._folder, self._adapter, self._index = folder, adapter, read_index(folder)
        self._bodies: dict[int, tuple[Figure, BodyFiles]] = {}
        self._answers: list[dict[str, Any]] = []
        self._warm: set[bool] = set()

    def answer(self, family: str, number: int) -> None:
        """Solve a problem, posed anew, from both seeds; FileFormatError says where the files have another."""
        case = ready(problem_set(family), number, int(self._index["seed"])).case
        rebuilt = Rebuilt(self._folder, self._index["sets"][family]["problems"][number])
        body = self._body(case, rebuilt)
        seeds = {seed: rebuilt.seed(seed)[np.argsort(body.order)] for seed in SEEDS}
        if json.loads(dumped(problem_content(case, body, seeds["far"], {}))) != rebuilt.content:
            raise FileFormatError(
                f"{self._folder}: {rebuilt.content['name']} is another problem in the files; export them with this "
                "version of wholebody"
            )
        if rebuilt.moving not in self._warm:  # the first solve compiles, which nobody's time is to count
            self._warm.add(rebuilt.moving)
            self._answered(case, body, case.problem.start)
        for seed, start in seeds.items():
            found = self._answered(case, body, start)
            self._answers.append({"problem": rebuilt.content["name"], "seed": seed, **found})

    def content(self) -> dict[str, Any]:
        """The content of the file of answers."""
        heading = {"format": "wholebody answers", "version": VERSION, "method": self._adapter.name}
        about = {"about": self._adapter.setup, "machine": machine_sentence(machine())}
        return {**heading, **about, "kernel_seconds": kernel_seconds(), "answers": self._answers}

    def _body(self, case: Case, rebuilt: Rebuilt) -> BodyFiles:
        figure = case.problem.scene.figure
        if id(figure) not in self._bodies:
            self._bodies.clear()
            self._bodies[id(figure)] = figure, body_files(figure, Path(rebuilt.content["body"]).stem, {})
        return self._bodies[id(figure)][1]

    def _answered(self, case: Case, body: BodyFiles, start: Array) -> dict[str, Any]:
        """Postures and seconds, or why the method refuses the problem or fails."""
        asked = replace(case, problem=copy.copy(case.problem).with_start(start))
        record, found = solve(self._adapter, DEFAULT, Ready(asked, inf))
        if not found:
            return {"refused": record.said}
        postures = [body.posture(q) for q in found]
        return ({"postures": postures} if case.frames else {"posture": postures[0]}) | {"seconds": record.seconds}
