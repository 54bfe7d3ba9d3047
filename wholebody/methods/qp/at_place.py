"""A problem whose contacts are at the place that an answer found.

A contact leaves its place open, and its rows, which follow surfaces, bend and have kinks. A frame or a point at the
place has neither. Where a descent to it ends lower, the answer was a kink or another local minimum.
"""

from __future__ import annotations

import copy
from typing import Any

import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.problem import Problem
from wholebody.tasks.base import Goal, filled
from wholebody.tasks.contact_parts import Gap, Near
from wholebody.tasks.frame import Frame
from wholebody.tasks.grips import Opposing
from wholebody.tasks.inputs import Place
from wholebody.tasks.point import Point
from wholebody.tasks.residuals import PlacementResidual
from wholebody.tasks.surfaces import nearest


def at_its_place(problem: Problem, state: State) -> Problem | None:
    """The problem that asks for the places of its contacts at a state; None where fingers close around a thing."""
    # A contact that turns a frame becomes its goal, another one a point's; other constraints stay.
    terms: list[Any] = [term for term in (*problem.goals, *problem.constraints) if _slides(term)]
    if not terms or any(isinstance(part, Opposing) for term in terms for part in term.parts):
        return None
    result = copy.copy(problem)
    others = [goal for goal in problem.goals if not _slides(goal)]
    result.goals = (*others, *(goal for term in terms for goal in _places(problem, term, state)))
    kept = [(each, _beside(each)) for each in problem.constraints]
    result.constraints = tuple(filled(each, parts=rest) if rest else each for each, rest in kept if rest != ())
    return result


def _slides(term: Any) -> bool:
    """Whether a term is a contact whose place is open."""
    return hasattr(term, "touches") and any(isinstance(part, (Gap, Near)) for part in term.parts)


def _beside(term: Any) -> tuple[Any, ...] | None:
    """The parts of a contact that are not about its place; None for another term."""
    if not _slides(term):
        return None
    return tuple(part for part in term.parts if not hasattr(part, "place") and not isinstance(part, (Gap, Near)))


def _places(problem: Problem, term: Any, state: State) -> list[Goal]:
    """Resolved goals for where a contact's frames are, or its point on all that moves."""
    names, frames = problem.scene.model.names, problem.scene.model.frames
    turned: dict[int, Any] = {part.place.frame: part.place for part in term.parts if hasattr(part, "place")}
    found: list[Goal] = []
    for place in turned.values():
        at = pin.SE3(state.frame(place.frame))
        found.append(filled(Frame(names[place.joint], at), residual=PlacementResidual.build(place, at)))
    gap = next(part for part in term.parts if isinstance(part, (Gap, Near)))
    near = nearest(gap.first, gap.second, state)
    for joint in (near.joint,) if turned else (near.joint, near.against):
        if joint:
            number = next(k for k, frame in enumerate(frames) if frame.parentJoint == joint)  # a body may have its name
            offset: Array = state.frame(number).actInv(near.point)
            found.append(filled(Point(frames[number].name, near.point, offset=offset), place=Place(number, joint)))
    return found
