"""Motions of figures that hold something: steps of geodesics, each projected onto what is held (CBiRRT).

A projection solves ``c(q) = 0`` for what is held and for other constraints that a posture misses, by Newton's method
with the pseudo-inverse of their Jacobian J,

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
from wholebody.planning.local_planner import MARGIN, MISSED, Geodesics, Kept
from wholebody.planning.projection_kernel import displace
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.point import Point
from wholebody.terms.linearisation import ConstraintValues, Lineariser, PackedLinearisation

STEP = 0.05  # rad, m: of a freedom between two projections; larger = farther from what is held in between, cheaper
WITHIN = 1e-4  # m, rad: by which an iteration brings values within sides that it finds them beyond
ITERATIONS = 8  # of a projection, which takes two or three from a step


class ProjectedMotions(Geodesics):
    """Steps towards a posture that are projected onto what is held."""

    searches: ClassVar[int] = 8
    samples: ClassVar[int] = 200
    rounds: ClassVar[int] = 50
    tries: ClassVar[int] = 25
    spacing: ClassVar[float] = 0.04
    bent: ClassVar[float] = MARGIN  # feet that are held get into the floor by the square of a step

    def __init__(self, problem: Problem, workspace: Workspace) -> None:
        super().__init__(problem, workspace)
        self.partial = False  # what is held takes all joints along
        self.shares = np.ones(self._model.nv)
        bare = problem.with_start(problem.start)
        bare.goals, bare.measures, bare.constraints = (), (), self.terms
        self._lineariser = bare.lineariser(workspace)
        self._aimed = bare.with_start(problem.start)
        self._aimed.constraints = self.terms
        self._reach = dict[str, Lineariser]()  # of each tip
        terms, state = self.terms, workspace.state.update(problem.start)
        sides = [np.broadcast_arrays(term.lower, term.upper, term.value(state))[:2] for term in terms]
        self._bounds = np.hstack([np.zeros((2, 0)), *sides])
        self._equal = self._bounds[0] == self._bounds[1]
        self._aims = self._aimed_at()
        self._away = np.zeros(self._model.nv)
        self._on = set[bytes]()  # postures that were seen to be on what is held
        self._last = b"", self._packed(problem.start, -1.0)  # the posture that was linearised last, and what is there
        # of steps: what has equalities alone is left out; contact terms, which are one, mostly have ranges too
        loose = [not (term.lower == term.upper).all() for term in terms]
        self._loose = ConstraintValues([term for term, asked in zip(terms, loose, strict=True) if asked], state)
        self._rows = np.repeat(loose, [np.size(each[0]) for each in sides])
        # what is held is missed between two postures by the square of a step; others have room as of their postures
        self._followed = Kept(np.where(self._equal, np.array([[-np.inf], [np.inf]]), self._bounds), self._followed.room)

    def projected(self, q: Array) -> Array:
        """The posture (nq,) near q that meets what is held; q itself where none is found."""
        found = self._projected(q)
        return q if found is None else found

    def corrected(self, q: Array) -> Array:
        """See `Geodesics`: one iteration for each posture, so that a smooth motion stays so.

        Pairs that two postures of a path keep apart may overlap by the square of a step in between.
        """
        at = self._packed(q, 1e-3)  # m: farther than frames are displaced
        aims = np.hstack([self._bounds, np.vstack([at.clearance - MISSED, np.full(len(at.gap), np.inf)])])
        never = np.array([[np.inf], [-np.inf]]) + np.zeros_like(aims)
        displace(at.jacobian, np.hstack([at.value, at.gap]), never, aims, at.box, self._away)
        return np.asarray(pin.integrate(self._model, q, self._away))

    def admit(self, q: Array) -> None:
        """See `Geodesics`."""
        super().admit(q)
        self._aims = self._aimed_at()
        least = np.maximum(self._least + MISSED + self._bends, 0.0)
        self._lineariser.take((), np.minimum(self._lineariser.clearances, least))

    def _aimed_at(self) -> Array:
        """(2, c) where an iteration brings values: to the sides alone, rounding leaves them beyond."""
        low, high = self._kept.sides  # those of ends too: what is within them is not displaced
        room = np.minimum(WITHIN, 0.5 * (high - low))
        return np.where(self._equal, self._bounds, [low + room, high - room])

    def _projected(self, q: Array) -> Array | None:
        for _ in range(ITERATIONS):
            q, missed = self._displaced(q, self._kept.sides, self._aims)
            if not missed:
                return q
        return None

    def _within(self, q: Array, kept: Kept) -> bool:
        state = self._workspace.state.update(q)
        key = q.tobytes()
        if kept is self._followed or key in self._on:
            values, sides = self._loose.at(state), kept.sides[:, self._rows]
        else:
            known, at = self._last
            values, sides = at.value if known == key else self._values.at(state), kept.sides
            on = values[self._equal], sides[:, self._equal]
            if (on[0] >= on[1][0]).all() and (on[0] <= on[1][1]).all():
                self._on.add(key)
        return bool((values >= sides[0]).all() and (values <= sides[1]).all())

    def reaching(self, q: Array, tip: str, place: Array) -> Array:
        """The posture (nq,) near q with a frame at a place (3,), on what is held, as nearly as a few iterations get."""
        goal = Point(tip, place).resolve(self._aimed.scene, q)
        if tip not in self._reach:
            self._aimed.goals = (goal,)
            self._reach[tip] = self._aimed.lineariser(self._workspace)
        reach = self._reach[tip]
        reach.take((goal,), reach.clearances)
        aims = np.hstack([np.zeros((2, 3)), self._aims])
        for _ in range(6):  # more = nearer to places out of reach, dearer
            at = reach.packed(q, -1.0)
            if not displace(at.jacobian, at.value, aims, aims, at.box, self._away):
                break
            size = float(np.abs(self._away).max())
            q = np.asarray(pin.integrate(self._model, q, min(1.0, 0.5 / max(size, 1e-15)) * self._away))  # rad, m
            if size < 1e-3:
                break
        return q

    def _packed(self, q: Array, within: float) -> PackedLinearisation:
        """What is at q (nq,), until the next question."""
        at = self._lineariser.packed(q, within)
        self._last = q.tobytes(), at
        return at

    def _displaced(self, q: Array, sides: Array, aims: Array) -> tuple[Array, bool]:
        """A posture (nq,) after one iteration, and whether it was needed, as constraints were not within sides."""
        at, away = self._packed(q, -1.0), self._away  # no pairs
        needed = displace(at.jacobian, at.value, sides, aims, at.box, away)
        return (np.asarray(pin.integrate(self._model, q, away)), True) if needed else (q, False)

    def towards(self, q: Array, target: Array) -> tuple[list[Array], bool]:
        """See `Geodesics`; it does not get to a target that misses what is held."""
        return self._stepped(q, target, np.inf)

    def joined(self, q: Array, target: Array, most: float) -> list[Array]:
        """See `Geodesics`."""
        postures, met = self._stepped(q, target, most)
        return postures if met else []

    def _stepped(self, q: Array, target: Array, most: float) -> tuple[list[Array], bool]:
        postures, gone = list[Array](), 0.0
        motion = np.asarray(pin.difference(self._model, q, target))
        left = float(np.linalg.norm(motion))
        while gone + left <= most and not BUDGET.over:
            size = float(np.abs(motion).max(initial=0.0))
            last = size <= STEP and self.met(target)
            share = min(1.0, STEP / max(size, 1e-15))
            there = target if last else self._projected(self._along(q, share * motion))
            if there is None or not self._leads(q, there):
                break
            postures.append(there)
            if last or share == 1.0:
                return postures, last
            gone += float(np.linalg.norm(pin.difference(self._model, q, there)))
            motion, before, q = np.asarray(pin.difference(self._model, there, target)), left, there
            left = float(np.linalg.norm(motion))
            if left > before - 0.1 * share * before:  # what is held does not let it nearer
                break
        return postures, False

    def _along(self, q: Array, motion: Array) -> Array:
        """The posture (nq,) after the part of a motion (nv,) that keeps what is held to first order, where it is known.

        It is known at the posture that was projected last, and spares an iteration.
        """
        known, at = self._last
        if known == q.tobytes():
            rows = at.jacobian[: len(at.value)]
            value, box = at.value + rows @ motion, at.box - motion
            if displace(rows, value, self._kept.sides, self._aims, box, self._away):
                motion = motion + self._away
        return np.asarray(pin.integrate(self._model, q, motion))

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
        for k, q in enumerate(path[1:], start=1):
            if BUDGET.over:
                break
            found[k] = self.projected(q) if k < len(path) - 1 else q
            blocked[k - 1] = not self._leads(found[k - 1], found[k])
        steps, usual = (
            np.array([np.linalg.norm(pin.difference(self._model, *pair)) for pair in pairwise(each)])
            for each in (found, path)
        )
        return found, blocked | (steps > 1.5 * usual + 1e-3)  # rad, m: projected on two sides of something

    def follows(self, q: Array, there: Array) -> bool:
        """See `Geodesics`."""
        return self._leads(q, there)
