"""Motions of figures that hold something: steps of geodesics, each projected onto what is held (CBiRRT).

A projection solves ``c(q) = 0`` for what is held and for other constraints that a posture misses, by Newton's method with
the pseudo-inverse of their Jacobian J,

    dq = -J' (J J' + d I)^-1 c(q),   within joint limits,

so that it is the nearest posture to first order (Berenson and others 2009). Things are not in it: steps into them end.
"""

from __future__ import annotations

from itertools import pairwise
from typing import ClassVar

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.methods.control import BUDGET
from wholebody.planning.local_planner import Geodesics, Kept
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.terms.linearisation import PackedLinearisation

STEP = 0.08  # rad, m: of a freedom between two projections; larger = farther from what is held in between, cheaper
DAMPING = 1e-7  # m^2 and rad^2 of a projection; larger = more iterations, smaller = far off where rows are dependent
ITERATIONS = 8  # of a projection, which takes two or three from a step


class ProjectedMotions(Geodesics):
    """Steps towards a posture that are projected onto what is held."""

    searches: ClassVar[int] = 4
    samples: ClassVar[int] = 200
    rounds: ClassVar[int] = 50
    tries: ClassVar[int] = 20
    spacing: ClassVar[float] = 0.04

    def __init__(self, problem: Problem, workspace: Workspace) -> None:
        super().__init__(problem, workspace)
        self.partial = False  # what is held takes all joints along
        self.shares = np.ones(self._model.nv)
        bare = problem.with_start(problem.start)
        bare.goals = bare.measures = ()
        self._lineariser = bare.lineariser(workspace)
        terms, state = problem.constraints, workspace.state.update(problem.start)
        sides = [np.broadcast_arrays(term.lower, term.upper, term.value(state))[:2] for term in terms]
        self._bounds = np.hstack([np.zeros((2, 0)), *sides])
        self._equal = self._bounds[0] == self._bounds[1]
        # what is held is missed between two postures by the square of a step; others have room as of their postures
        self._followed = Kept(
            np.where(self._equal, np.array([[-np.inf], [np.inf]]), self._bounds), self._followed.room
        )

    def projected(self, q: Array) -> Array:
        """The posture (nq,) near q that meets what is held; q itself where none is found."""
        found = self._projected(q)
        return q if found is None else found

    def corrected(self, q: Array) -> Array:
        """See `Geodesics`: the same two iterations for each posture, so that a smooth motion stays so."""
        for _ in range(2):
            at = self._lineariser.packed(q, -1.0)  # no pairs
            q = self._displaced(q, at, self._equal, at.value - self._bounds[0])
        return q

    def _projected(self, q: Array) -> Array | None:
        low, high = self._kept.sides
        for _ in range(ITERATIONS):
            at = self._lineariser.packed(q, -1.0)  # no pairs
            value, box = at.value, at.box
            kept = np.minimum(np.maximum(value, low), high)
            out = value != kept
            if not (out.any() or (box[0] > 0.0).any() or (box[1] < 0.0).any()):
                return q
            q = self._displaced(q, at, self._equal | out, value - np.where(self._equal, self._bounds[0], kept))
        return None

    def _displaced(self, q: Array, at: PackedLinearisation, rows: Mask, missed: Array) -> Array:
        """The posture (nq,) of the least displacement that makes up for what some rows (c,) miss."""
        away = _least(at.jacobian[: len(rows)][rows], missed[rows], at.box)
        return np.asarray(pin.integrate(self._model, q, away))

    def towards(self, q: Array, target: Array) -> tuple[list[Array], bool]:
        """See `Geodesics`; it does not get to a target that misses what is held."""
        return self._stepped(q, target, np.inf)

    def joined(self, q: Array, target: Array, most: float) -> list[Array]:
        """See `Geodesics`."""
        way, met = self._stepped(q, target, most)
        return way if met else []

    def _stepped(self, q: Array, target: Array, most: float) -> tuple[list[Array], bool]:
        way, gone, met = list[Array](), 0.0, self.met(target)
        motion = np.asarray(pin.difference(self._model, q, target))
        left = float(np.linalg.norm(motion))
        while gone + left <= most and not BUDGET.over:
            size = float(np.abs(motion).max(initial=0.0))
            last = met and size <= STEP
            share = min(1.0, STEP / max(size, 1e-15))
            there = target if last else self._projected(np.asarray(pin.integrate(self._model, q, share * motion)))
            if there is None or not self._leads(q, there):
                break
            way.append(there)
            if last or share == 1.0:
                return way, last
            gone += float(np.linalg.norm(pin.difference(self._model, q, there)))
            motion, before, q = np.asarray(pin.difference(self._model, there, target)), left, there
            left = float(np.linalg.norm(motion))
            if left > before - 0.1 * share * before:  # what is held does not let it nearer
                break
        return way, False

    def _leads(self, q: Array, there: Array) -> bool:
        """Whether a step from q to a posture (nq,) is short, as one is that does not jump, and free."""
        motion = np.asarray(pin.difference(self._model, q, there))
        short = bool(np.abs(motion).max(initial=0.0) <= 3.0 * STEP)
        return short and self._joins(q, motion, self._seen(q), self._seen(there), self._followed)

    def through(self, path: Array) -> list[Array]:
        """See `Geodesics`."""
        found, blocked = self.settled(path)
        return [] if blocked.any() else list(found[1:])

    def settled(self, path: Array) -> tuple[Array, Mask]:
        """See `Geodesics`."""
        found, blocked = path.copy(), np.ones(len(path) - 1, dtype=bool)
        found[1:-1] = [self.projected(q) for q in path[1:-1]]
        for k, pair in enumerate(pairwise(found)):
            if BUDGET.over:
                break
            blocked[k] = not self._leads(*pair)
        steps, usual = (
            np.array([np.linalg.norm(pin.difference(self._model, *pair)) for pair in pairwise(each)])
            for each in (found, path)
        )
        return found, blocked | (steps > 1.5 * usual + 1e-3)  # rad, m: projected on two sides of something

    def follows(self, q: Array, there: Array) -> bool:
        """See `Geodesics`."""
        return self._leads(q, there)


def _least(rows: Array, missed: Array, box: Array) -> Array:
    """The least displacement (nv,) within a box (2, nv) that makes up for what rows (r, nv) miss, (r,)."""
    found = np.minimum(np.maximum(0.0, box[0]), box[1])
    free = box[0] < box[1]
    for _ in range(3):  # joints that end at their limits leave the rest to others
        mine = rows[:, free]
        given = missed + rows[:, ~free] @ found[~free]
        found[free] = -mine.T @ np.linalg.solve(mine @ mine.T + DAMPING * np.eye(len(rows)), given)
        out = (found < box[0]) | (found > box[1])
        found = np.minimum(np.maximum(found, box[0]), box[1])
        if not out.any():
            break
        free &= ~out
    return found
