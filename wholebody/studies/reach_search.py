"""Searches of the places of a reach map, each from a posture."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.methods.base import Method
from wholebody.methods.contradictions import contradictions
from wholebody.problem import Problem
from wholebody.tasks import Point

SURE = 0.95  # share of the distance to a missed place within which no place is searched: 1 trusts descents wholly


class Search(NamedTuple):
    """A place to search."""

    place: int  # its number
    begin: int  # the reached place whose posture is the start; -1 for the problem's own start, and a whole solve
    at: Array  # (3,) metres
    start: Array  # (nq,)


class Try(NamedTuple):
    """A place that was searched."""

    place: int  # its number
    begin: int  # see `Search`
    reached: bool  # whether a posture was found
    inside: bool  # whether the place contradicts the constraints, so that it was not searched
    left: float  # distance to the nearest posture that was found, metres
    # whether the search says that there is nothing nearer, so that places within that distance are left out
    sure: bool
    measure: float  # weighted sum of the measures at the posture
    q: Array  # (nq,) the posture


@dataclass(frozen=True)
class Asked:
    """The problem of every place."""

    problem: Problem  # its goals are met at every place too
    frame: str  # the frame that reaches
    offset: Array  # (3,) the point of the frame, in its axes
    whole: Method  # method of whole solves
    quick: Method  # method of those that begin at a neighbour

    def searched(self, search: Search) -> Try:
        """Search a place."""
        problem = self.problem.with_start(search.start)
        goal = Point(self.frame, search.at, offset=self.offset).resolve(problem.scene, problem.start)
        problem.goals = (*self.problem.goals, goal)
        with problem.borrow() as workspace:
            if contradictions(problem, workspace):
                return Try(search.place, search.begin, False, True, 0.0, False, 0.0, problem.start)
        solution = (self.whole if search.begin < 0 else self.quick).solve(problem)
        judged = solution.assessment
        # only where the place is the only goal its residual is its distance from the reach
        sure = not self.problem.goals and solution.status == "unreachable"
        return Try(
            search.place, search.begin, solution.solved, False, judged.goal_errors[-1], sure, judged.measure,
            np.asarray(solution.q),
        )  # fmt: skip


_known: dict[str, Asked] = {}


def search_places(sent: tuple[str, bytes, list[Search]]) -> list[Try]:
    """Search places, in any process; the problem is unpacked once a process."""
    key, packed_asked, searches = sent
    if key not in _known:
        _known.clear()
        _known[key] = pickle.loads(packed_asked)
    return [_known[key].searched(each) for each in searches]


def covered(places: Array, center: Array, radius: Array) -> Mask:
    """Which places (n, 3) are within a ball around a place that is out of reach by more."""
    inside = np.zeros(len(places), dtype=bool)
    for middle, size in zip(center, radius, strict=True):
        inside |= np.linalg.norm(places - middle, axis=1) < SURE * size
    return inside
