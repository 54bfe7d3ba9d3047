"""Contacts: what a person touches, leans on, sits on, takes or stands on, against the same place asked for by itself.

A contact term leaves the place open, so its answer costs no more than that of a point or a frame at the place found.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.attack.case import Verdict, Written
from wholebody.bench.attack.solves import HEAD, number_text
from wholebody.problem import Problem
from wholebody.solution import Solution

DEARER = 0.05  # share of the effort: thrice what the tolerance of a fingertip that stands on a face is worth
LEAST = 1e-3  # effort below which shares say nothing

TAIL = """
scene = wb.Scene(wb.load("human", sex={sex!r}))
{things}
contact = {term}
problem = wb.Problem(scene, {role}=[contact])
began = process_time()
solution = wb.solve(problem)
seconds = process_time() - began
verdict = contacts.verdict(problem, solution, {frames!r}, seconds)
print(verdict)
"""


def written(rng: np.random.Generator) -> Written:
    """Write a contact."""
    kind = str(rng.choice(["Touch", "Touch", "Grasp", "Lean", "Sit", "Stand"]))
    things, term, frames = {"Touch": _touch, "Grasp": _grasp, "Lean": _lean, "Sit": _sit, "Stand": _stand}[kind](rng)
    head = HEAD.format(title=f"the effort of {term}", imports="from wholebody.bench.attack import contacts\n")
    sex, role = str(rng.choice(["male", "female"])), "constraints" if kind == "Stand" else "goals"
    return Written(head + TAIL.format(sex=sex, things="\n".join(things), term=term, role=role, frames=frames))


def _thing(shape: str, name: str, at: Sequence[float] | Array) -> str:
    return f"scene.add({shape}, name={name!r}, at={tuple(float(x) for x in at)!r})"


def _box(*sizes: float) -> str:
    return f"wb.Box({number_text(np.array(sizes))})"


def _in_reach(rng: np.random.Generator) -> Array:
    """A placement before a standing person, turned at random."""
    turn = rng.normal(size=4)
    low, high = (0.25, -0.6, 0.6), (0.8, 0.3, 1.5)
    return np.concatenate([rng.uniform(low, high), turn / np.linalg.norm(turn)])


def _rod(rng: np.random.Generator) -> str:
    return _thing(f"wb.Capsule({rng.uniform(0.01, 0.05)!r}, {rng.uniform(0.3, 1.0)!r})", "thing", _in_reach(rng))


def _hit(rng: np.random.Generator) -> str:
    """A box, a table or a rod."""
    which = int(rng.integers(3))
    if which == 0:
        return _thing(_box(*rng.uniform(0.05, 0.5, 3)), "thing", _in_reach(rng))
    if which == 1:
        top = _box(rng.uniform(0.4, 1.0), rng.uniform(0.6, 1.4), 0.03)
        return _thing(top, "thing", rng.uniform((0.5, -0.3, 0.6), (0.9, 0.3, 1.1)))
    return _rod(rng)


def _touch(rng: np.random.Generator) -> tuple[list[str], str, list[str]]:
    part = str(rng.choice(["right_index_tip", "left_index_tip", "right_hand", "left_forearm", "right_hand:2"]))
    return [_hit(rng)], f"wb.Touch({part!r}, 'thing')", [part]


def _grasp(rng: np.random.Generator) -> tuple[list[str], str, list[str]]:
    kind = ("palm", "power")[int(rng.integers(2))]
    return [_rod(rng) if kind == "power" else _hit(rng)], f"wb.Grasp('right', 'thing', {kind!r})", ["right_palm"]


def _lean(rng: np.random.Generator) -> tuple[list[str], str, list[str]]:
    turn = 0.5 * rng.uniform(-0.5, 0.5)
    at = (rng.uniform(-0.6, -0.25), rng.uniform(-0.3, 0.3), 1.0, 0.0, 0.0, np.sin(turn), np.cos(turn))
    return [_thing(_box(0.05, 2.0, 2.0), "thing", at)], "wb.Lean('thing')", ["thorax"]


def _sit(rng: np.random.Generator) -> tuple[list[str], str, list[str]]:
    x, y, top = rng.uniform((-0.5, -0.2, 0.3), (-0.2, 0.2, 0.55))
    things = [_thing(_box(0.44, 0.48, 0.04), "thing", (x, y, top - 0.02))]
    if rng.random() < 0.5:
        return things, "wb.Sit('thing')", ["pelvis"]
    things.append(_thing(_box(0.03, 0.48, 0.36), "back", (x - 0.22, y, top + 0.42)))
    return things, "wb.Sit('thing', 'back')", ["pelvis"]


def _stand(rng: np.random.Generator) -> tuple[list[str], str, list[str]]:
    at = rng.uniform((-0.1, -0.2, -0.15), (0.3, 0.2, 0.1))
    return [_thing(_box(0.6, 0.8, 0.3), "thing", at)], "wb.Stand('thing')", ["left_foot", "right_foot"]


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
            goals.append(wb.Point(name, place.translation))
        else:
            point = touch.nearest_points(state)
            goals.append(wb.Point(known, point, offset=place.actInv(point)))
    touching = [pair for term in terms for pair in term.touches]
    return wb.Problem(problem.scene, problem.start, goals=goals, touching=touching)


def verdict(problem: Problem, solution: Solution, frames: Sequence[str], seconds: float) -> Verdict:
    """Judge what a contact costs beside its place; the frames are those that make it."""
    if solution.status != "solved":
        return Verdict("right", f"{solution.status}", seconds, solution.status)
    other = wb.solve(at_the_place(problem, solution, frames))
    mine, known = solution.assessment.measure, other.assessment.measure
    words = (
        f"effort {mine:.4g}, optimality {solution.assessment.optimality:.2g}; at the place {other.status}, {known:.4g}"
    )
    dearer = other.status == "solved" and mine > (1.0 + DEARER) * known + LEAST
    return Verdict("wrong" if dearer else "right", words, seconds, solution.status)
