"""Contacts: the term leaves the place open, so its answer costs no more than a point or frame at the place found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import process_time
from typing import Any, Literal

import numpy as np
import pinocchio as pin

import wholebody as wb
from tests.audits.attack.judging import Verdict
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.things import turned
from wholebody.problem import Problem
from wholebody.solution import Solution

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
