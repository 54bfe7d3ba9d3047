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

from wholebody.base.arrays import Array, Mask
from wholebody.geometry.continuous.motion_bounds import largest_approach
from wholebody.methods.qp.method import QP
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks import Posture
from wholebody.tasks.base import filled
from wholebody.tracking.qp_strategy import Attraction

WITHIN = 0.08  # m: distance within which pairs are looked at; larger = fewer and dearer queries
MARGIN = 2e-3  # m: distance that motions keep beyond the clearance, where their ends do; larger = fewer queries
NOISE = 1e-5  # m: by which distances of one posture differ from query to query
REACHED = 1e-3  # rad, m: difference from a posture that counts as reached by steps of the tracker
JUMP = 1.5  # of the distance of two postures: above it their projections are on two sides of something
GAIN = 5e-3  # rad, m: by which a step comes nearer at least; smaller = longer motions along things


class LocalPlanner(Protocol):
    """Makes the edges of trees."""

    searches: ClassVar[int]  # how many paths are looked for, of which the shortest counts; more = shorter, later

    def admit(self, q: Array) -> None:
        """Let motions be as near to things as the posture q (nq,) is, which is an end of the whole motion."""

    def towards(self, q: Array, target: Array, most: float = np.inf) -> tuple[list[Array], bool]:
        """Postures (nq,) from q to a target, without q, no longer than `most` rad and m, and whether it comes there."""

    def settled(self, path: Array) -> tuple[Array, Mask]:
        """Postures (n, nq) near those of a path that keep constraints, and which of the motions between are blocked."""


class Geodesics:
    """Geodesics of Pinocchio, for figures that hold nothing."""

    searches: ClassVar[int] = 8

    def __init__(self, problem: Problem, workspace: Workspace, resolution: float = 0.2) -> None:
        """Take a problem without constraints, and the length of a part of a motion, radians."""
        self._workspace, self._model, self._resolution = workspace, workspace.model, resolution
        self._clearance = problem.clearance
        self._required = problem.clearance + np.full(len(workspace.table.pairs), MARGIN)
        pieces = workspace.geometry.geometryObjects
        centres = np.array([np.linalg.norm(piece.placement.translation) for piece in pieces])
        ways = [largest_approach(workspace.table, centres, unit) for unit in np.eye(self._model.nv)]
        self._approach = np.array(ways).reshape(self._model.nv, -1).T.copy()  # of every pair by every freedom

    def admit(self, q: Array) -> None:
        """See `LocalPlanner`."""
        near = self._workspace.near(q, self._clearance + MARGIN + NOISE)
        self._required[near.number] = np.minimum(self._required[near.number], near.distance - NOISE)

    def free(self, q: Array) -> bool:
        """Whether a posture (nq,) keeps the distances."""
        near = self._workspace.near_views(q, WITHIN)
        return not (near.distance < self._required[near.number]).any()

    def towards(self, q: Array, target: Array, most: float = np.inf) -> tuple[list[Array], bool]:
        """See `LocalPlanner`."""
        motion = np.asarray(pin.difference(self._model, q, target))
        if np.linalg.norm(motion) > most:
            return [], False
        share = self._free_share(q, motion)
        parts = max(1, int(np.ceil(share * np.abs(motion).max(initial=0.0) / self._resolution)))
        shares = (share * part / parts for part in range(1, parts + 1) if share > 0.0)
        way = [np.asarray(pin.integrate(self._model, q, part * motion)) for part in shares]
        return ([*way[:-1], target], True) if share >= 1.0 else (way, False)

    def settled(self, path: Array) -> tuple[Array, Mask]:
        """See `LocalPlanner`."""
        motions = [np.asarray(pin.difference(self._model, *pair)) for pair in pairwise(path)]
        return path, np.array([self._free_share(*way) < 1.0 for way in zip(path[:-1], motions, strict=True)])

    def _free_share(self, q: Array, motion: Array) -> float:
        """How much of the motion by a tangent (nv,) from q (nq,) keeps the required distances."""
        speed = self._approach @ np.abs(motion) + 1e-12
        most, free, now = WITHIN / float(speed.max(initial=1e-12)), 0.0, 0.0
        while True:
            near = self._workspace.near_views(np.asarray(pin.integrate(self._model, q, now * motion)), WITHIN)
            room = near.distance - self._required[near.number]
            if (room < 0.0).any():
                return free
            free = now
            if now >= 1.0:
                return 1.0
            safe = (room + MARGIN) / speed[near.number]
            now = min(now + min(most, float(safe.min(initial=np.inf))), 1.0)


def holds(problem: Problem) -> bool:
    """Whether a constraint is an equality, such as a `Hold`, so that most postures near by are not allowed."""
    return any(bool(np.any(term.lower == term.upper)) for term in problem.constraints)


class TrackedMotions:
    """Motions by steps of the QP tracker, for figures that keep constraints on the way.

    Where nothing is held, a posture is the minimum of a measure, and steps are as long as distances allow. Else it is a
    goal, and steps are short, as what is held is missed by the square of a step.
    """

    searches: ClassVar[int] = 2

    def __init__(self, problem: Problem) -> None:
        """Take a problem whose constraints and bounds hold on the way."""
        self._problem = problem.with_start(problem.start)
        self._model = problem.scene.model
        self._goal = Posture(problem.start).resolve(problem.scene, problem.start)
        self._attraction = Attraction(problem.start, np.ones(self._model.nv))
        self._held = holds(problem)
        self._problem.goals = (self._goal,) if self._held else ()
        self._problem.measures = () if self._held else (self._attraction,)
        self._problem.clearances = problem.clearances + MARGIN
        self._tracker = QP(restarts=0).tracker(self._problem, 1.0)
        self._resting = self._problem.with_start(problem.start)
        self._resting.goals = self._resting.measures = ()
        self._settling = QP(restarts=0).tracker(self._resting, 1.0)

    def admit(self, q: Array) -> None:
        """See `LocalPlanner`."""
        least = np.array(self._problem.clearances)
        near = self._tracker.workspace.near(q, float(least.max(initial=0.0)) + NOISE)
        least[near.number] = np.minimum(least[near.number], np.maximum(near.distance - NOISE, 0.0))
        self._problem.clearances = self._resting.clearances = least

    def towards(self, q: Array, target: Array, most: float = np.inf) -> tuple[list[Array], bool]:
        """See `LocalPlanner`."""
        way, left, gone = list[Array](), self._apart(q, target), 0.0
        self._attraction.toward(target)
        if self._held:
            self._problem.goals = (filled(self._goal, target=target, resolved_target=target),)
        while left > REACHED:
            here, before, q = q, left, self._tracker.step(q).q
            left, gone = self._apart(q, target), gone + self._apart(here, q)
            if left > max(before - GAIN, REACHED) or gone + left > most:
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
        ways = [self._apart(*pair) for pair in pairwise([*found, path[-1]])]
        usual = [self._apart(*pair) for pair in pairwise(path)]
        return np.array([*found, path[-1]]), np.array(ways) > JUMP * np.array(usual) + REACHED

    def _apart(self, q: Array, target: Array) -> float:
        return float(np.linalg.norm(pin.difference(self._model, q, target)))
