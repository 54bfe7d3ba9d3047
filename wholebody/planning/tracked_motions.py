"""Motions by steps of the QP tracker."""

from __future__ import annotations

from itertools import pairwise
from typing import ClassVar, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.methods.control import BUDGET
from wholebody.methods.qp.method import QP
from wholebody.planning.local_planner import INSIDE, MARGIN, NOISE, Geodesics
from wholebody.planning.projected_motions import ProjectedMotions
from wholebody.planning.sampling import holds
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.bounds import Freeze
from wholebody.tracking.qp_strategy import Attraction

REACHED = 1e-3  # rad, m: difference from a posture that counts as reached by steps of the tracker
# share of the weight that all but the place of a root has while that is pulled; larger = gets stuck, smaller = ends far
# from the target
LOOSE = 0.1


class Rows(NamedTuple):
    """Displacements x of a posture by which ``gap + derivative @ x`` is not negative keep what is near."""

    derivative: Array  # (r, nv)
    gap: Array  # (r,)
    held: Array  # (e, nv) derivatives of what is held
    missed: Array  # (e,) by how much that is missed


class TrackedMotions:
    """Motions by steps of the QP tracker to minima of a measure, for figures that keep inequalities on the way."""

    searches: ClassVar[int] = 2
    samples: ClassVar[int] = 12
    rounds: ClassVar[int] = 2  # a sample takes about as long as another end
    tries: ClassVar[int] = 12
    spacing: ClassVar[float] = 0.04

    def __init__(self, problem: Problem, workspace: Workspace) -> None:
        self.geodesics = (ProjectedMotions if holds(problem) else Geodesics)(problem, workspace)
        self._problem = problem.with_start(problem.start)
        self._model = problem.scene.model
        self.shares = self.geodesics.shares
        self._attraction = Attraction(problem.start, self.shares**2)
        self._loose = np.full(self._model.nv, LOOSE)
        for root in problem.scene.figure.roots.values():
            place = self._model.joints[root].idx_v
            self._loose[place : place + 3] = 1.0
        self.partial = self.geodesics.partial
        self._problem.goals, self._problem.measures = (), (self._attraction,)
        self._problem.clearances = problem.clearances + MARGIN
        state = workspace.state.update(problem.start)
        own = [bound.bounds(state, 1.0) for bound in problem.bounds if not isinstance(bound, Freeze)]
        # rad, m: a step that gets nearer by less ends a motion; smaller: longer motions along things
        self._slow = min([5e-3, *(0.3 * float(max(np.max(high), -np.min(low))) for low, high in own)])
        self._tracker = QP(restarts=0).tracker(self._problem, 1.0)
        self._resting = self._problem.with_start(problem.start)
        self._resting.goals = self._resting.measures = ()
        self._settling = QP(restarts=0).tracker(self._resting, 1.0)
        seen = self._resting.with_start(problem.start)
        seen.goals, seen.measures, seen.constraints = (), (), self.geodesics.terms
        self._lineariser = seen.lineariser(workspace)

    def admit(self, q: Array) -> None:
        """See `Geodesics`."""
        self.geodesics.admit(q)
        least = np.array(self._problem.clearances)
        near = self._tracker.workspace.near(q, float(least.max(initial=0.0)) + NOISE)
        least[near.number] = np.minimum(least[near.number], np.maximum(near.distance - NOISE, 0.0))
        self._problem.clearances = self._resting.clearances = least

    def joined(self, q: Array, target: Array, most: float) -> list[Array]:
        """See `Geodesics`; a geodesic if it may be, as it costs a tenth of steps."""
        if motion := self.geodesics.joined(q, target, most):
            return motion
        motion, met = self.towards(q, target, most)
        return [*motion[:-1], target] if motion and met else []  # steps end beside it, and ends of motions stay

    def through(self, path: Array) -> list[Array]:
        """See `Geodesics`."""
        return self.geodesics.through(path)

    def towards(self, q: Array, target: Array, most: float = np.inf) -> tuple[list[Array], bool]:
        """See `Geodesics`; ends where the motion is longer than `most`, radians and metres."""
        return self._approached(q, target, np.ones(self._model.nv), most)

    def pulled(self, q: Array, target: Array) -> list[Array]:
        """Postures (nq,) from q, without it, that pull free roots to a target's places; all else gives way."""
        return self._approached(q, target, self._loose, np.inf)[0]

    def _approached(self, q: Array, target: Array, factors: Array, most: float) -> tuple[list[Array], bool]:
        """The motion of `towards` where the shares of freedoms are multiplied by factors (nv,)."""
        motion, left, gone, rest = list[Array](), self._apart(q, target), 0.0, self._rest(q, target, factors)
        self._attraction.weigh(factors**2)
        self._attraction.toward(target)
        while left > REACHED:
            here, before, q = q, rest, self._stepped(q)
            left, gone, rest = self._apart(q, target), gone + self._apart(here, q), self._rest(q, target, factors)
            slow = rest > before - self._slow and left > REACHED
            if slow or gone + left > most or BUDGET.over or not self.geodesics.keeps(q):
                return motion, False
            motion.append(q)
        return motion, True

    def _stepped(self, q: Array) -> Array:
        """The posture (nq,) of one step; of another one, which meets constraints alone, where that misses them."""
        found: Array = self._tracker.step(q).q
        return found if self.geodesics.keeps(found) else self._settling.step(found, measures=False).q

    def rows(self, q: Array) -> Rows:
        """What is near q (nq,), of constraints and limits; what is missed has a gap of 0."""
        self._lineariser.take((), self._resting.clearances)
        at = self._lineariser.at(q, 0.08)  # m: farther = more rows, fewer displacements that are cut
        sides, each = self.geodesics.sides, np.eye(self._model.nv)
        held = sides[1] - sides[0] < INSIDE
        low, high = sides[:, ~held]
        value, derivative = at.value[~held], at.value_jacobian[~held]
        gaps = np.concatenate([
            at.gap - at.clearance - 1e-3,  # m: rows are straight, and distances are not
            value - low, high - value, -at.lower, at.upper,
        ])  # fmt: skip
        rows = np.concatenate([at.gap_jacobian, derivative, -derivative, each, -each])
        counts = gaps < 1.0  # rad, m: farther than any displacement
        missed = at.value[held] - sides[:, held].mean(axis=0)
        return Rows(rows[counts], np.maximum(gaps[counts], 0.0), at.value_jacobian[held], missed)

    def displaced(self, q: Array, away: Array) -> Array:
        """The posture (nq,) that is displaced from q by a tangent (nv,), within limits."""
        return self._problem.scene.figure.clamp(np.asarray(pin.integrate(self._model, q, away)))

    def projected(self, q: Array) -> Array:
        """See `Geodesics`."""
        return self.geodesics.projected(q)

    def corrected(self, q: Array) -> Array:
        """See `Geodesics`."""
        return self.geodesics.corrected(q)

    def _settled(self, q: Array) -> Array:
        for _ in range(2):  # what is held is missed by the square of a step
            q = self._settling.step(q, measures=False).q
            if self.geodesics.met(q):
                break
        return q

    def settled(self, path: Array) -> tuple[Array, Mask]:
        """See `Geodesics`."""
        found, late = path.copy(), np.zeros(len(path), dtype=bool)
        for k, q in enumerate(path[1:-1], start=1):
            if BUDGET.over:
                late[k:] = True
                break
            found[k] = self._settled(q)
        steps, usual = (np.array([self._apart(*pair) for pair in pairwise(each)]) for each in (found, path))
        return found, (steps > 1.5 * usual + REACHED) | late[1:]  # projected on two sides of something

    def _apart(self, q: Array, target: Array) -> float:
        return float(np.linalg.norm(pin.difference(self._model, q, target)))

    def _rest(self, q: Array, target: Array, factors: Array) -> float:
        return float(np.linalg.norm(factors * self.shares * pin.difference(self._model, q, target)))


LocalPlanner: TypeAlias = Geodesics | TrackedMotions  # what makes the edges of trees
