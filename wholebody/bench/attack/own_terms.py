"""Terms of one's own that are not finite, or answer something odd, in a part of the space that a solve goes through.

The goal leads into that part. No answer may lie in it, and an odd answer is refused by one sentence.
"""

from __future__ import annotations

from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.attack.case import Verdict, chosen
from wholebody.figures.state import State, Wrench
from wholebody.solution import Solution
from wholebody.tasks.base import Surroundings, Term, filled

USERS = "users"  # module of the terms below: answers are checked of classes from outside of the package alone


class Asked(NamedTuple):
    """What is asked, and which answer of a term is bad.

    Attributes:
        frame: that moves.
        way: (3,) from where it starts to its goal, metres.
        reach: along the way, metres; beyond it the answer is bad.
        part: "error" or "jacobian" of the goal, "value" or "slope" of the constraint, "measure", its "gradient" or
            "curvature".
        bad: number of which the part consists there, or what it answers.
    """

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

    def resolve(self, scene: Surroundings, start: Array) -> Any:
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


def case(rng: np.random.Generator, folder: Path) -> Verdict:
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
        tracker, q = wb.QP().tracker(problem, 0.05), problem.start
        for _ in range(30):
            q = tracker.step(q).q
        return verdict(problem, asked, q)
    began = process_time()
    solution = wb.solve(problem, method=method)
    return verdict(problem, asked, solution.q, solution, process_time() - began)


def verdict(
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
