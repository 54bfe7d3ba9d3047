"""Solves: figures inside things by micrometres to half a metre, goals that can be met, cannot be, or contradict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from time import process_time
from typing import Any, Literal, get_args

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.attack.judging import Judged, Pairs, Verdict, chosen, judge
from wholebody.bench.attack.scenes import Body, Thing, body, clear, inside, xyzquat
from wholebody.bench.suite.problem_sets.things import Occupied
from wholebody.methods import installed_methods
from wholebody.methods.solve import method_named
from wholebody.problem import Problem
from wholebody.solution import Solution, Status

FARTHEST = 99.0  # m: goals farther than 100 m are refused


@dataclass
class Terms:
    """Goals and constraints, while they are being made up, and whether the witness fits them."""

    goals: list[wb.Goal] = field(default_factory=list)
    constraints: list[Any] = field(default_factory=list)
    feasible: bool = True


def case(rng: np.random.Generator, folder: Path) -> Verdict:
    """Solve a problem."""
    figure = body(rng, folder)
    clearance = float(chosen(rng, (0.0, 0.0, 0.001, 0.005, 0.005, 0.05, 0.3))) * min(1.0, figure.size)
    start = figure.figure.clamp(figure.figure.posture(chosen(rng, figure.figure.postures)))
    start = start if rng.random() < 0.5 else figure.near(start, float(rng.choice([0.05, 0.3, 1.0])), rng)
    witness = figure.clear(start, float(rng.choice([0.1, 0.4, 1.0])), rng, clearance + 1e-4 * figure.size)
    things = _around(figure, start, witness, clearance, rng)
    terms = _random_terms(figure, start, witness, rng)
    known = witness is not None and terms.feasible and bool(terms.goals) and _clear(figure, witness, things, clearance)
    method, measures = chosen(rng, _methods()), chosen(rng, _measures())
    problem = wb.Problem(
        scene_of(figure, things), start, goals=terms.goals, constraints=terms.constraints, measures=measures,
        clearance=clearance,
    )  # fmt: skip
    began = process_time()
    solution = wb.solve(problem, method=method)
    seconds = process_time() - began
    found = judge(problem, terms.goals, terms.constraints, solution.q)
    return verdict(problem, found, solution, tolerance=float(method.tolerance), witness=known, seconds=seconds)


@cache
def _methods() -> tuple[Any, ...]:
    """Mostly qp as it comes, and every other method now and then."""
    others = (method_named(name) for name in installed_methods() if name != "qp")
    return (
        *(wb.methods.QP(),) * 12,
        wb.methods.QP(tolerance=1e-8),
        wb.methods.QP(measures=False),
        wb.methods.QP(solver="daqp"),
        *others,
    )


def _measures() -> tuple[Any, ...]:
    effort, little = [wb.Effort(), wb.tasks.Discomfort(weight=0.1)], [wb.tasks.PotentialEnergy(weight=0.01)]
    return None, None, None, [], effort, [wb.tasks.Displacement()], little, [wb.tasks.Discomfort()]


def scene_of(figure: Body, things: Sequence[Thing]) -> wb.Scene:
    """Return a scene of a figure and things, which are named by their numbers."""
    scene = wb.Scene(figure.figure)
    for number, thing in enumerate(things):
        scene.add(thing.shape, name=f"thing {number}", at=thing.at)
    return scene


def _around(
    figure: Body, start: Array, witness: Array | None, clearance: float, rng: np.random.Generator
) -> list[Thing]:
    """Things: clear of the witness, some of them in the figure where it starts."""
    placed = Occupied(figure.figure, [start] if witness is None else [start, witness])
    count = 20 if rng.random() < 0.05 else int(rng.integers(0, 9))
    room = clearance + 1e-3 * figure.size
    found: list[Thing | None] = []
    free = rng.random() < 0.4  # nothing is in the figure where it starts
    for _ in range(count):
        if not free and rng.random() < 0.3:
            depth = float(np.exp(rng.uniform(np.log(1e-6), np.log(0.5 * min(1.0, figure.size)))))
            found.append(inside(rng, placed, figure.size, depth))
        else:
            postures = [0] if witness is None else [0, 1] if free else [1]
            found.append(clear(rng, placed, figure.size, room, postures))
    return [thing for thing in found if thing is not None and np.abs(thing.at[:3]).max() < FARTHEST]


def _clear(figure: Body, witness: Array, things: list[Thing], clearance: float) -> bool:
    placed = Occupied(figure.figure, [witness])
    return all(placed.distance(thing.shape, thing.placement, 0) > clearance for thing in things)


def _random_terms(figure: Body, start: Array, witness: Array | None, rng: np.random.Generator) -> Terms:
    """Goals and constraints: what the witness fits, what is out of reach, what contradicts."""
    terms, model = Terms(), figure.figure.model
    data, before = model.createData(), model.createData()
    pin.framesForwardKinematics(model, before, start)
    shown = start if witness is None else witness
    pin.framesForwardKinematics(model, data, shown)
    pin.centerOfMass(model, data, shown)
    aim = rng.choice(["fits", "far", "contradicts", "nothing"], p=[0.68, 0.15, 0.13, 0.04])
    frames = list(rng.permutation(figure.frames))
    for name in map(str, frames[: int(rng.integers(1, 4))] if aim != "nothing" else []):
        terms.goals.append(_goal(name, data.oMf[model.getFrameId(name)], data.com[0], shown, rng))
    if aim == "far":
        way = rng.normal(size=3)
        way *= figure.size * float(rng.choice([0.02, 0.3, 1.0, 5.0, 40.0])) / np.linalg.norm(way)
        place = np.clip(data.oMf[model.getFrameId(str(frames[0]))].translation + way, -FARTHEST, FARTHEST)
        terms.goals.append(wb.Point(str(frames[0]), place))
        terms.feasible = False
    if aim == "contradicts":
        terms.feasible = False
        place = data.oMf[model.getFrameId(str(frames[0]))].translation
        for sign in (-1.0, 1.0):
            terms.goals.append(wb.Point(str(frames[0]), place + sign * 0.1 * figure.size))
        if rng.random() < 0.5:
            terms.constraints.append(wb.Hold(str(frames[0]), place + 0.3 * figure.size))
    _hold(figure, start, witness, before, data, terms, rng)
    return terms


def _goal(name: str, at: pin.SE3, mass: Array, q: Array, rng: np.random.Generator) -> wb.Goal:
    """One that a frame meets where it is, or that a posture meets as it is."""
    kind = rng.choice(["Point", "Point", "Point", "Frame", "Orientation", "Axis", "CenterOfMass", "Posture"])
    weight = float(np.exp(rng.uniform(-4.0, 4.0))) if rng.random() < 0.2 else 1.0
    if kind == "Frame":
        return wb.Frame(name, xyzquat(at), weight=weight)
    if kind == "Orientation":
        return wb.Orientation(name, xyzquat(at)[3:], weight=weight)
    if kind == "Axis":
        axis = rng.normal(size=3)
        return wb.Axis(name, axis, direction=at.rotation @ axis, weight=weight)
    if kind == "CenterOfMass":
        return wb.CenterOfMass(mass.copy(), axes=("xy", "xyz")[int(rng.integers(2))], weight=weight)
    if kind == "Posture" and rng.random() < 0.3:
        return wb.Posture(q, weight=weight)
    return wb.Point(name, at.translation.copy(), weight=weight)


def _hold(
    figure: Body, start: Array, witness: Array | None, before: pin.Data, data: pin.Data, terms: Terms,
    rng: np.random.Generator,
) -> None:  # fmt: skip
    """Add constraints: mostly those that the witness fits, for it does not move what they keep."""
    model = figure.figure.model
    for name in map(str, rng.permutation(figure.frames)[: int(rng.integers(0, 4))]):
        number = model.getFrameId(name)
        still = witness is not None and np.allclose(before.oMf[number].homogeneous, data.oMf[number].homogeneous)
        if still or rng.random() < 0.1:
            terms.constraints.append(wb.Hold(name, orientation=bool(rng.random() >= 0.3)))
            terms.feasible &= bool(still)
    if rng.random() < 0.15:
        name = str(rng.permutation(figure.frames)[0])
        normal = rng.normal(size=3)
        place = data.oMf[model.getFrameId(name)].translation
        sides: tuple[Literal["on"], Literal["above"]] = ("on", "above")
        side = sides[int(rng.integers(2))]
        terms.constraints.append(wb.Plane(name, normal, point=place.copy(), side=side))
    joints = figure.figure.joints
    if rng.random() < 0.15 and len(joints) > 1:
        some = [str(name) for name in rng.permutation(joints)[: int(rng.integers(1, len(joints)))]]
        way = pin.difference(model, start, start if witness is None else witness)
        terms.feasible &= not way[figure.figure.dofs(some)].any()
        terms.constraints.append(wb.Freeze(*some))
    if figure.people and rng.random() < 0.1:
        terms.feasible = False  # whether the witness balances is not looked at
        terms.constraints.append(wb.Balance() if rng.random() < 0.7 else wb.tasks.ReachCones())


def verdict(
    problem: Problem, found: Judged, solution: Solution, *, tolerance: float, witness: bool, seconds: float
) -> Verdict:
    """Judge an answer; `witness` says whether the problem was made from a posture that solves it."""
    words, said = _words(found), f"{solution.method} says {solution.status!r}"
    wrongs = _wrongs(problem, solution, found, tolerance)
    if wrongs:
        return Verdict("wrong", f"{said}: {', '.join(wrongs)}; {words}", seconds, solution.status)
    gave_up = witness and solution.status != "solved"
    return Verdict("gave up" if gave_up else "right", f"{said}; {words}", seconds, solution.status)


def _wrongs(problem: Problem, solution: Solution, found: Judged, tolerance: float) -> list[str]:
    """What is false about an answer."""
    if not found.finite:
        return ["the posture or a distance at it is not made of numbers"]
    if solution.status not in get_args(Status):
        return [f"{solution.status!r} is no status"]
    # Two measurements may differ by this; coal's distances of ellipsoids are relative to their size.
    rounding = 2e-6 + 1e-5 * Pairs(problem.scene).size
    allowed = 1.1 * tolerance + rounding
    wrongs = []
    if found.unit > 1e-6:
        wrongs.append(f"a quaternion is {found.unit:.3g} off unit length")
    if solution.status == "solved" and found.goal > allowed:
        wrongs.append(f"goals are missed by {found.goal:.3g} m or rad")
    if solution.status in ("solved", "unreachable") and found.violation > allowed:
        wrongs.append(f"constraints are violated by {found.violation:.3g} m or rad")
    if solution.status == "infeasible" and found.violation < 0.5 * tolerance:
        wrongs.append(f"everything holds to {found.violation:.3g} m or rad")
    said = solution.assessment
    pairs = (
        ("least distance", said.least_distance, found.least),
        ("goal error", max(said.goal_error, said.goal_angle), found.goal),
        ("clearance violation", said.clearance_violation, found.shortfall),
    )
    for name, value, measured in pairs:
        if not np.isfinite(value) and value != measured:
            wrongs.append(f"its {name} is {value}")
        elif np.isfinite(value) and abs(value - measured) > rounding + 1e-6 * abs(measured):
            wrongs.append(f"its {name} is {value:.9g}, and {measured:.9g} was measured")
    return wrongs


def _words(found: Judged) -> str:
    if not found.finite:
        return "not measured"
    return (
        f"goals {found.goal:.3g}, least distance {found.least:.3g}, "
        f"clearance violation {found.shortfall:.3g} ({found.closest}), limits {found.limits:.3g}, "
        f"constraints {found.constraints:.3g}"
    )
