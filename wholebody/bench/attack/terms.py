"""Terms: contacts against the place that they find, and terms of one's own that are not finite or answer something odd.

A contact term leaves the place open, so its answer costs no more than that of a point or a frame at the place found. No
answer may lie where a term of one's own is not finite, and an odd answer is refused by one sentence.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import process_time
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.attack.judging import Verdict, chosen
from wholebody.bench.suite.problem_sets.things import turned
from wholebody.figures.state import State, Wrench
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.solution import Solution
from wholebody.tasks.base import Term, filled

Contact = tuple[dict[str, tuple[wb.Shape, Any]], Any, list[str]]
"""Things with their places, a term, and the frames that make it."""


def contact(rng: np.random.Generator, folder: Path) -> Verdict:
    """Solve for a contact."""
    kind = str(rng.choice(["Touch", "Touch", "Grasp", "Lean", "Sit", "Stand"]))
    things, term, frames = _asked(kind, rng)
    scene = wb.Scene(wb.load("human", sex=str(rng.choice(["male", "female"]))))
    for name, (shape, at) in things.items():
        scene.add(shape, name=name, at=at)
    role: Any = {"constraints" if kind == "Stand" else "goals": [term]}
    problem = wb.Problem(scene, **role)
    began = process_time()
    solution = wb.solve(problem)
    return contact_verdict(problem, solution, frames, process_time() - began)


def _in_reach(rng: np.random.Generator) -> Array:
    """A placement before a standing person, turned at random."""
    turn = turned(rng)
    return np.concatenate([rng.uniform((0.25, -0.6, 0.6), (0.8, 0.3, 1.5)), turn])


def _rod(rng: np.random.Generator) -> tuple[wb.Shape, Any]:
    return wb.Capsule(rng.uniform(0.01, 0.05), rng.uniform(0.3, 1.0)), _in_reach(rng)


def _hit(rng: np.random.Generator) -> tuple[wb.Shape, Any]:
    which = int(rng.integers(3))
    if which == 0:
        x, y, z = rng.uniform(0.05, 0.5, 3)
        return wb.Box((x, y, z)), _in_reach(rng)
    if which == 1:
        return wb.Box((rng.uniform(0.4, 1.0), rng.uniform(0.6, 1.4), 0.03)), rng.uniform(
            (0.5, -0.3, 0.6), (0.9, 0.3, 1.1)
        )
    return _rod(rng)


def _asked(kind: str, rng: np.random.Generator) -> Contact:
    """Things before, behind or below a standing person, and a contact with them."""
    if kind == "Touch":
        part = str(rng.choice(["right_index_tip", "left_index_tip", "right_hand", "left_forearm", "right_hand:2"]))
        return {"thing": _hit(rng)}, wb.Touch(part, "thing"), [part]
    if kind == "Grasp":
        kinds: tuple[Literal["palm"], Literal["power"]] = ("palm", "power")
        grip = kinds[int(rng.integers(2))]
        return {"thing": _rod(rng) if grip == "power" else _hit(rng)}, wb.Grasp("right", "thing", grip), ["right_palm"]
    if kind == "Lean":
        turn = 0.5 * rng.uniform(-0.5, 0.5)
        at = (rng.uniform(-0.6, -0.25), rng.uniform(-0.3, 0.3), 1.0, 0.0, 0.0, np.sin(turn), np.cos(turn))
        return {"thing": (wb.Box((0.05, 2.0, 2.0)), at)}, wb.tasks.Lean("thing"), ["thorax"]
    if kind == "Stand":
        place = rng.uniform((-0.1, -0.2, -0.15), (0.3, 0.2, 0.1))
        return {"thing": (wb.Box((0.6, 0.8, 0.3)), place)}, wb.Stand("thing"), ["left_foot", "right_foot"]
    x, y, top = rng.uniform((-0.5, -0.2, 0.3), (-0.2, 0.2, 0.55))
    seat: tuple[wb.Shape, Any] = wb.Box((0.44, 0.48, 0.04)), (x, y, top - 0.02)
    if rng.random() < 0.5:
        return {"thing": seat}, wb.Sit("thing"), ["pelvis"]
    back: tuple[wb.Shape, Any] = wb.Box((0.03, 0.48, 0.36)), (x - 0.22, y, top + 0.42)
    return {"thing": seat, "back": back}, wb.Sit("thing", "back"), ["pelvis"]


def at_the_place(problem: Problem, solution: Solution, frames: Sequence[str]) -> Problem:
    """The problem that asks for the place of an answer: the frames where they are, or the point that touches."""
    terms: list[Any] = [term for term in (*problem.goals, *problem.constraints) if hasattr(term, "touches")]
    state = problem.scene.state(solution.q)
    goals: list[wb.Goal] = []
    for name in frames:
        touch = next((term for term in terms if isinstance(term, wb.Touch)), None)
        known = name.split(":")[0]
        place = state.frame(problem.scene.figure.frame_id(known))
        if touch is None:
            goals.append(wb.Frame(name, np.r_[place.translation, pin.Quaternion(place.rotation).coeffs()]))
        elif touch.parts[0].first.fixed is not None:  # type: ignore[attr-defined]
            goals.append(wb.Point(name, touch.nearest_points(state)))
        else:
            point = touch.nearest_points(state)
            goals.append(wb.Point(known, point, offset=place.actInv(point)))
    touching = [pair for term in terms for pair in term.touches]
    return wb.Problem(problem.scene, problem.start, goals=goals, touching=touching)


def contact_verdict(problem: Problem, solution: Solution, frames: Sequence[str], seconds: float) -> Verdict:
    """Judge whether a contact costs 2 % more than its place; the frames are those that make it."""
    if solution.status != "solved":
        return Verdict("right", f"{solution.status}", seconds, solution.status)
    other = wb.solve(at_the_place(problem, solution, frames))
    mine, known = solution.assessment.measure, other.assessment.measure
    words = (
        f"effort {mine:.4g}, optimality {solution.assessment.optimality:.2g}; at the place {other.status}, {known:.4g}"
    )
    dearer = other.status == "solved" and mine > 1.02 * known + 1e-3
    return Verdict("wrong" if dearer else "right", words, seconds, solution.status)


USERS = "users"  # module of the terms below: answers are checked of classes from outside of the package alone


class Asked(NamedTuple):
    """`frame` is to move by `way` (3,) [m]; beyond `reach` [m] along it the term's `part` is `bad`."""

    frame: str
    way: Array
    reach: float
    part: str
    bad: Any

    def beyond(self, moved: Array) -> float:
        """How far a motion (3,) goes beyond the reach, metres; negative before it."""
        return float(moved @ self.way / np.linalg.norm(self.way)) - self.reach


class _Own(Term):
    """A term that answers as it is asked."""

    index: int
    joint: int
    place: Array

    def __init__(self, asked: Asked) -> None:
        self.asked = asked

    def resolve(self, scene: Scene, start: Array) -> Any:
        index = scene.figure.frame_id(self.asked.frame)
        place = scene.figure.placement(start, self.asked.frame).translation.copy()
        return filled(self, index=index, joint=scene.model.frames[index].parentJoint, place=place)

    def moved(self, state: State) -> Array:
        return np.asarray(state.frame(self.index).translation - self.place)

    def answer(self, part: str, state: State, usual: Any) -> Any:
        if part != self.asked.part or self.asked.beyond(self.moved(state)) <= 0.0:
            return usual
        return np.full(np.shape(usual), self.asked.bad)[()] if isinstance(self.asked.bad, float) else self.asked.bad


class _Reach(_Own, wb.Goal):
    """The end of the way."""

    __module__ = USERS

    def error(self, state: State) -> Any:
        return self.answer("error", state, self.moved(state) - self.asked.way)

    def jacobian(self, state: State) -> Wrench:
        x, y, z = state.frame(self.index).translation
        rows = np.array([[1.0, 0, 0, 0, z, -y], [0, 1.0, 0, -z, 0, x], [0, 0, 1.0, y, -x, 0]])
        return Wrench(self.answer("jacobian", state, rows), self.joint)


class _Keep(_Own, wb.Constraint):
    """What always holds."""

    __module__ = USERS

    def value(self, state: State) -> Any:
        return self.answer("value", state, np.ones(1))

    def jacobian(self, state: State) -> Any:
        return self.answer("slope", state, np.full((1, state.model.nv), 1e-9))


class _Low(_Own, wb.Measure):
    """The sum of squares of joint values, of a figure with a free root."""

    __module__ = USERS

    def value(self, state: State) -> Any:
        return self.answer("measure", state, 0.5 * float(state.q[7:] @ state.q[7:]))

    def gradient(self, state: State) -> Any:
        return self.answer("gradient", state, np.concatenate([np.full(6, 1e-9), state.q[7:]]))

    def curvature(self, state: State) -> Any:
        return self.answer("curvature", state, np.ones(state.model.nv))


def own_term(rng: np.random.Generator, folder: Path) -> Verdict:
    """Solve with terms of one's own, or follow them by steps."""
    name, detail, frame = chosen(
        rng,
        (("human", "capsules", "right_index_tip"), ("human", "spheres", "left_palm"), ("avatar", None, "right_palm")),
    )
    figure = wb.load(name, **({"detail": detail} if detail else {}))
    way = rng.normal(size=3) * (1.0, 1.0, 0.5)
    way *= rng.uniform(0.1, 0.5) / np.linalg.norm(way)
    reach = float(rng.uniform(0.2, 0.98) * np.linalg.norm(way))
    method = chosen(rng, ("qp", "qp", "newton", "dls", "tracker"))
    constrained = method != "dls"  # which takes no constraints
    parts = ["error", "jacobian", *(("value", "slope") if constrained else ()), "measure", "gradient", "curvature"]
    bad = (np.nan, np.inf, -np.inf, "far", None, 1j, np.zeros((2, 2)))
    asked = Asked(frame, way, reach, chosen(rng, parts), chosen(rng, bad))
    constraints = [_Keep(asked)] if constrained else []
    problem = wb.Problem(wb.Scene(figure), goals=[_Reach(asked)], constraints=constraints, measures=[_Low(asked)])
    if method == "tracker":
        tracker, q = wb.methods.QP().tracker(problem, 0.05), problem.start
        for _ in range(30):
            q = tracker.step(q).q
        return own_verdict(problem, asked, q)
    began = process_time()
    solution = wb.solve(problem, method=method)
    return own_verdict(problem, asked, solution.q, solution, process_time() - began)


def own_verdict(
    problem: wb.Problem, asked: Asked, q: Array, solution: Solution | None = None, seconds: float = 0.0
) -> Verdict:
    """Judge a posture (nq,): it may not lie where a term is not defined, and a solution names the term."""
    status = "" if solution is None else solution.status
    said = "a tracker ends" if solution is None else f"{solution.method} says {status!r}"
    if not np.isfinite(q).all():
        return Verdict("wrong", f"{said}, at a posture that is not made of numbers", seconds, status)
    start, end = (problem.scene.figure.placement(each, asked.frame).translation.copy() for each in (problem.start, q))
    words = f"{said} {1e3 * np.linalg.norm(end - start - asked.way):.3g} mm from the goal"
    if asked.beyond(end - start) > 1e-6:
        return Verdict("wrong", f"{words}, where a term is not defined", seconds, status)
    if solution is not None and (status != "stalled" or "of iteration" not in solution.message):
        return Verdict("wrong", f"{words}, and does not name the term: {solution.message}", seconds, status)
    return Verdict("right", words, seconds, status)
