"""The search of one brick of a reach map, each place from a neighbour that is reached; places provably out of reach."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.methods.base import Method
from wholebody.methods.contradictions import contradictions
from wholebody.methods.simplification.reach import Balls, Reach, held_balls, still_dofs
from wholebody.problem import Problem
from wholebody.tasks import Point

SURE = 0.95  # share of the distance to a missed place within which no place is searched: 1 trusts descents wholly


class Try(NamedTuple):
    """A place that was searched."""

    place: int  # its number
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

    def at(self, place: Array, start: Array) -> Problem:
        """The problem of a place (3,), from a start (nq,)."""
        made = self.problem.with_start(start)
        made.goals = (*self.problem.goals, Point(self.frame, place, offset=self.offset).resolve(made.scene, made.start))
        return made


@dataclass
class Brick:
    """Places that are searched together, in one process."""

    places: dict[int, Array]  # number -> (3,) metres
    # number -> numbers of the neighbours of a place, those of other bricks included
    neighbours: dict[int, tuple[int, ...]]
    open: list[int]  # places that are searched
    again: list[tuple[int, int]]  # (place, neighbour) to be tried once more from there
    reached: dict[int, Array]  # number -> posture (nq,) of what is reached already, here and around
    whole: bool = False  # whether places are solved by whole solves from the problem's start
    tried: set[tuple[int, int]] = field(default_factory=set)  # (place, neighbour) of tries of earlier rounds
    tries: list[tuple[Try, int]] = field(default_factory=list)  # the answer

    def search(self, asked: Asked) -> list[tuple[Try, int]]:
        """Search the places: each try, with the neighbour that it began from, -1 for none."""
        pending = dict.fromkeys(self.open)
        if self.whole:
            for place in pending:
                self._try(asked, place, -1)
            return self.tries
        while pending or self.again:
            if pending:
                place, begin = self._next(pending)
                del pending[place]
                found = self._try(asked, place, begin)
                if found.sure and not found.reached:
                    near = SURE * found.left
                    for other in [k for k in pending if np.linalg.norm(self.places[k] - self.places[place]) < near]:
                        del pending[other]
                if found.reached:
                    self._once_more()
            while self.again:
                other, begin = self.again.pop(0)
                if other not in self.reached and self._try(asked, other, begin).reached:
                    self._once_more()
        return self.tries

    def _next(self, pending: dict[int, None]) -> tuple[int, int]:
        """The next place and the reached place to begin from: a neighbour, else the place farthest from all."""
        for place in pending:
            for other in self.neighbours[place]:
                if other in self.reached:
                    return place, other
        if not self.reached:
            return next(iter(pending)), -1
        numbers = list(self.reached)
        there = np.array([self.places[k] for k in numbers])
        apart = {k: np.linalg.norm(there - self.places[k], axis=1) for k in pending}
        place = max(pending, key=lambda k: (float(apart[k].min()), -k))
        return place, numbers[int(np.argmin(apart[place]))]

    def _try(self, asked: Asked, place: int, begin: int) -> Try:
        self.tried.add((place, begin))
        start = self.reached.get(begin, asked.problem.start)
        problem = asked.at(self.places[place], start)
        with problem.borrow() as workspace:
            inside = bool(contradictions(problem, workspace))
        if inside:
            found = Try(place, False, True, 0.0, False, 0.0, problem.start)
        else:
            solution = (asked.whole if self.whole or begin < 0 else asked.quick).solve(problem)
            judged, q = solution.assessment, np.asarray(solution.q)
            # only where the place is the only goal its residual is its distance from the reach
            sure = not asked.problem.goals and solution.status == "unreachable"
            found = Try(place, solution.solved, False, judged.goal_errors[-1], sure, judged.measure, q)
        self.tries.append((found, begin))
        if found.reached:
            self.reached[place] = found.q
        return found

    def _once_more(self) -> None:
        """Ask for another try of places that were not reached and of which many neighbours are."""
        failed = {found.place for found, _ in self.tries if not (found.reached or found.inside)} - self.reached.keys()
        for place in sorted(failed):
            near = [other for other in self.neighbours[place] if other in self.reached]
            tries = sum(pair[0] == place for pair in self.tried)
            fresh = [other for other in near if (place, other) not in self.tried]
            # starts of one place: more finds more places behind things, and takes longer at the border of
            # the reach
            # reached neighbours from which a place that was not reached is tried once more
            if len(near) >= 3 and fresh and tries < 4 and (place, fresh[0]) not in self.again:
                self.again.append((place, fresh[0]))


_known: dict[str, Asked] = {}


def search_brick(sent: tuple[str, bytes, Brick]) -> list[tuple[Try, int]]:
    """Search a brick, in any process; the problem is unpacked once a process."""
    key, packed_asked, brick = sent
    if key not in _known:
        _known.clear()
        _known[key] = pickle.loads(packed_asked)
    return brick.search(_known[key])


def covered(places: Array, center: Array, radius: Array) -> Mask:
    """Which places (n, 3) are within a ball around a place that is out of reach by more."""
    inside = np.zeros(len(places), dtype=bool)
    for middle, size in zip(center, radius, strict=True):
        inside |= np.linalg.norm(places - middle, axis=1) < SURE * size
    return inside


SLACK = 1e-6  # m: for rounding: a place that is out of reach by no more may be reached


def reach_balls(problem: Problem, frame: str, offset: Array) -> tuple[Array, Array]:
    """Centres (k, 3) and radii (k,) of balls that hold a point of a frame in every posture within limits and holds."""
    figure, model = problem.scene.figure, problem.scene.model
    held = model.frames[figure.frame_id(frame)]
    point = (held.placement.act(offset))[None]
    joint = np.array([held.parentJoint], dtype=np.intp)
    resting = Balls(point, np.zeros(1), np.zeros(1, dtype=np.intp))
    reach = Reach(model, problem.start, resting, joint, still_dofs(problem))
    found = [reach.seen_from(0), *held_balls(figure, reach, problem.constraints)]
    center = np.concatenate([balls.center for balls in found])
    radius = np.concatenate([balls.radius for balls in found])
    bounded = np.isfinite(radius)
    return center[bounded], radius[bounded]


def distance_beyond(places: Array, center: Array, radius: Array) -> Array:
    """By how much (n,) places are at least out of reach, metres."""
    least = np.zeros(len(places))
    for middle, size in zip(center, radius, strict=True):
        least = np.maximum(least, np.linalg.norm(places - middle, axis=1) - size)
    return least
