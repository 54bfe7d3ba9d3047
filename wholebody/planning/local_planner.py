"""Local planners: motions from one posture towards another that are free of collision throughout.

Without constraints a motion is a geodesic. It advances by as much as no pair can lose its distance (conservative
advancement, Mirtich 1996). With constraints a motion consists of steps of the QP tracker towards the posture. Each step
keeps the constraints, the limits and the distances, so the motion slides along what is in the way, and stays on what is
held (as projections do, Berenson and others 2011).
"""

from __future__ import annotations

from itertools import pairwise
from typing import ClassVar, Protocol

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import largest_violation
from wholebody.base.arrays import Array, Mask
from wholebody.base.errors import InputError
from wholebody.geometry.continuous.motion_bounds import largest_approach
from wholebody.methods.control import BUDGET
from wholebody.methods.qp.method import QP
from wholebody.planning.sampling import holds
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks import Posture
from wholebody.tasks.base import filled
from wholebody.tracking.qp_strategy import Attraction

WITHIN = 0.02  # m: distance within which pairs are looked at; larger = fewer and dearer queries
MARGIN = 2e-3  # m: distance that motions keep beyond the clearance, where their ends do; larger = fewer queries
NOISE = 1e-5  # m: by which distances of one posture differ from query to query
REACHED = 1e-3  # rad, m: difference from a posture that counts as reached by steps of the tracker
JUMP = 1.5  # of the distance of two postures: above it their projections are on two sides of something
ALLOWED = 1e-5  # m, rad: by which postures of a geodesic may miss constraints
GAIN = 5e-3  # rad, m: by which a step comes nearer at least; smaller = longer motions along things


class LocalPlanner(Protocol):
    """Makes the edges of trees."""

    searches: ClassVar[int]  # how many paths are looked for, of which the shortest counts; more = shorter, later
    samples: ClassVar[int]  # of trees that look for a shorter path after the first; more = shorter paths, later
    rounds: ClassVar[int]  # samples of trees until they get another end
    tries: ClassVar[int]  # shortcuts in a row that fail; more = shorter paths, later
    partial: bool  # whether one joint may move in another way than before, and all others as they did

    def admit(self, q: Array) -> None:
        """Let motions be as near to things as the posture q (nq,) is, which is an end of the whole motion."""

    def towards(self, q: Array, target: Array) -> tuple[list[Array], bool]:
        """Postures (nq,) of the motion from q towards a target (nq,), without q, and whether it gets there."""

    def joined(self, q: Array, target: Array, most: float) -> list[Array]:
        """Postures (nq,) of a motion from q to a target (nq,), without q, of at most so many radians and metres.

        Empty where there is none.
        """

    def through(self, path: Array) -> list[Array]:
        """Postures of a path (n, nq) without the first, where all motions between are free and allowed; else none."""

    def settled(self, path: Array) -> tuple[Array, Mask]:
        """Postures (n, nq) near those of a path that keep constraints, and which of the motions between are blocked."""


class Geodesics:
    """Geodesics of Pinocchio, for figures that hold nothing."""

    searches: ClassVar[int] = 8
    samples: ClassVar[int] = 600
    rounds: ClassVar[int] = 50
    tries: ClassVar[int] = 30

    def __init__(self, problem: Problem, workspace: Workspace) -> None:
        self._workspace, self._model = workspace, workspace.model
        self._clearance = problem.clearance
        self.partial = not problem.scene.figure.roots  # motions of free bodies became no shorter, but later
        self._required = problem.clearance + np.full(len(workspace.table.pairs), MARGIN)
        pieces = workspace.geometry.geometryObjects
        centres = np.array([np.linalg.norm(piece.placement.translation) for piece in pieces])
        # of every pair by every freedom
        self._approach = np.asarray(largest_approach(workspace.table, centres, np.eye(self._model.nv)))
        unbounded = np.flatnonzero(~np.isfinite(self._approach).all(axis=1))
        if len(unbounded):
            names = [workspace.owners[piece] for piece in workspace.table.pairs[unbounded[0]]]
            raise InputError(
                f"plan: how much a motion brings {names[0]} and {names[1]} together has no bound; attach a box in "
                "place of a half-space, and give limits to what slides"
            )

    def admit(self, q: Array) -> None:
        """See `LocalPlanner`."""
        near = self._workspace.near(q, self._clearance + MARGIN + NOISE)
        self._required[near.number] = np.minimum(self._required[near.number], near.distance - NOISE)

    def free(self, q: Array) -> bool:
        """Whether a posture (nq,) keeps the distances."""
        return self._room(q) is not None

    def towards(self, q: Array, target: Array) -> tuple[list[Array], bool]:
        """See `LocalPlanner`."""
        motion, way = np.asarray(pin.difference(self._model, q, target)), list[Array]()
        parts, room, here = self._parts(motion), None, q
        for part in range(1, parts + 1):
            there = target if part == parts else np.asarray(pin.integrate(self._model, q, part / parts * motion))
            ahead = self._room(there)  # most motions end here, so the room at q is asked for afterwards
            room = self._room(q) if ahead is not None and room is None else room
            if not self._joins(here, motion / parts, room, ahead):
                return way, False
            way.append(there)
            here, room = there, ahead
        return way, True

    def joined(self, q: Array, target: Array, most: float) -> list[Array]:
        """See `LocalPlanner`."""
        motion = np.asarray(pin.difference(self._model, q, target))
        if np.linalg.norm(motion) > most or not self._joins(q, motion, self._room(q), self._room(target)):
            return []
        parts = self._parts(motion)
        return [*(np.asarray(pin.integrate(self._model, q, k / parts * motion)) for k in range(1, parts)), target]

    def through(self, path: Array) -> list[Array]:
        """See `LocalPlanner`."""
        room = self._room(path[0])
        for q, there in pairwise(path):
            ahead = self._room(there)
            if not self._joins(q, np.asarray(pin.difference(self._model, q, there)), room, ahead):
                return []
            room = ahead
        return list(path[1:])

    def settled(self, path: Array) -> tuple[Array, Mask]:
        """See `LocalPlanner`."""
        rooms, blocked = [self._room(q) for q in path], []
        for k, pair in enumerate(pairwise(path)):
            blocked.append(not self._joins(path[k], np.asarray(pin.difference(self._model, *pair)), *rooms[k : k + 2]))
        return path, np.array(blocked)

    def _parts(self, motion: Array) -> int:
        # rad, m: length of a part of a motion
        return max(1, int(np.ceil(np.abs(motion).max(initial=0.0) / 0.2)))

    def _room(self, q: Array) -> Array | None:
        """(pairs,) by how much distances exceed what is required at least, metres; None where one does not."""
        room = self._workspace.proximity.least(self._workspace.state.update(q).data, WITHIN) - self._required
        return room if room.min(initial=0.0) >= 0.0 else None

    def _joins(self, q: Array, motion: Array, room: Array | None, ahead: Array | None) -> bool:
        return (
            room is not None
            and ahead is not None
            and self._clear(q, motion, (room, ahead, self._approach @ np.abs(motion)))
        )

    def _clear(self, q: Array, motion: Array, known: tuple[Array, Array, Array]) -> bool:
        """Whether the motion by a tangent (nv,) from q (nq,) is free, by halves, the longest ones first.

        `known` (pairs,) is the room at both ends, and by how much it can change in between. The least room on the way
        is half of what the ends have together less that change.
        """
        asked = [(q, motion, *known)]
        for here, whole, first, last, change in asked:  # grows while it is read
            if (first + last + 2.0 * MARGIN >= change).all():
                continue
            half = 0.5 * whole
            middle = np.asarray(pin.integrate(self._model, here, half))
            room = self._room(middle)
            if room is None:
                return False
            asked += [(here, half, first, room, 0.5 * change), (middle, half, room, last, 0.5 * change)]
        return True


class TrackedMotions:
    """Motions by steps of the QP tracker, for figures that keep constraints on the way.

    Where nothing is held, a posture is the minimum of a measure, and steps are as long as distances allow. Else it is a
    goal, and steps are short, as what is held is missed by the square of a step.
    """

    searches: ClassVar[int] = 2
    samples: ClassVar[int] = 12
    rounds: ClassVar[int] = 2  # a sample takes about as long as another end
    tries: ClassVar[int] = 12

    def __init__(self, problem: Problem, workspace: Workspace) -> None:
        self.geodesics = Geodesics(problem, workspace)
        self._problem = problem.with_start(problem.start)
        self._model = problem.scene.model
        self._goal = Posture(problem.start).resolve(problem.scene, problem.start)
        self._attraction = Attraction(problem.start, np.ones(self._model.nv))
        self._held = holds(problem)
        self.partial = not self._held  # what is held takes all joints along
        self._problem.goals = (self._goal,) if self._held else ()
        self._problem.measures = () if self._held else (self._attraction,)
        self._problem.clearances = problem.clearances + MARGIN
        self._tracker = QP(restarts=0).tracker(self._problem, 1.0)
        self._resting = self._problem.with_start(problem.start)
        self._resting.goals = self._resting.measures = ()
        self._settling = QP(restarts=0).tracker(self._resting, 1.0)

    def admit(self, q: Array) -> None:
        """See `LocalPlanner`."""
        self.geodesics.admit(q)
        least = np.array(self._problem.clearances)
        near = self._tracker.workspace.near(q, float(least.max(initial=0.0)) + NOISE)
        least[near.number] = np.minimum(least[near.number], np.maximum(near.distance - NOISE, 0.0))
        self._problem.clearances = self._resting.clearances = least

    def joined(self, q: Array, target: Array, most: float) -> list[Array]:
        """See `LocalPlanner`; a geodesic if it may be, as it costs a tenth of steps."""
        if not self._held and (way := self._allowed(self.geodesics.joined(q, target, most))):
            return way
        way, met = self.towards(q, target, most)
        return way if met else []

    def through(self, path: Array) -> list[Array]:
        """See `LocalPlanner`; by geodesics."""
        return self._allowed(self.geodesics.through(path))

    def _allowed(self, way: list[Array]) -> list[Array]:
        """Postures (nq,) of a motion that keep the constraints; none where one does not."""
        states = (self._problem.scene.state(at) for at in way)
        return way if all(largest_violation(self._problem, at) <= ALLOWED for at in states) else []

    def towards(self, q: Array, target: Array, most: float = np.inf) -> tuple[list[Array], bool]:
        """See `LocalPlanner`; ends where the motion is longer than `most`, radians and metres."""
        way, left, gone = list[Array](), self._apart(q, target), 0.0
        self._attraction.toward(target)
        if self._held:
            self._problem.goals = (filled(self._goal, target=target, resolved_target=target),)
        while left > REACHED:
            here, before, q = q, left, self._tracker.step(q).q
            left, gone = self._apart(q, target), gone + self._apart(here, q)
            if left > max(before - GAIN, REACHED) or gone + left > most or BUDGET.over:
                return way, False
            way.append(q)
        return way, True

    def settled(self, path: Array) -> tuple[Array, Mask]:
        """See `LocalPlanner`."""
        found = [path[0]]
        for q in path[1:-1]:
            for _ in range(2):  # what is held is missed by the square of a step
                q = self._settling.step(q, measures=False).q
            found.append(q)
        steps = [self._apart(*pair) for pair in pairwise([*found, path[-1]])]
        usual = [self._apart(*pair) for pair in pairwise(path)]
        return np.array([*found, path[-1]]), np.array(steps) > JUMP * np.array(usual) + REACHED

    def _apart(self, q: Array, target: Array) -> float:
        return float(np.linalg.norm(pin.difference(self._model, q, target)))
