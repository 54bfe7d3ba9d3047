"""One step of tracking: goals that move from call to call are followed by one quadratic program a step."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.checks import time_step
from wholebody.linearisation import Linearisation
from wholebody.methods.inputs import check_problem
from wholebody.methods.qp.quadratic_program import Array, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.subproblem import PULL, Rows, Subproblem
from wholebody.methods.qp.working_set import WorkingSet
from wholebody.problem import Problem

LEAST_WITHIN = 0.06  # m beyond the clearance: pairs nearer than this get rows
LARGEST_WITHIN = 0.5
HEADROOM = 2.5  # pairs within this many times the last step's motion get rows, so that the next may be longer
RADIUS = 0.1  # rad, m: what a goal that jumps may ask of one step, before velocity bounds
UNSEEN = 1e-4  # m: by which turning may bring things nearer than the linearisation says without being looked after
CORRECTIONS = 3  # programs that ask again for what turning brought nearer, before the step is cut
CUTS = 6  # times that a step is halved before it is given up
DAMPING = (
    0.3  # of the pull of goals out of reach: larger = slower to close in, smaller = limbs rattle at what is in the way
)


class Step(NamedTuple):
    """Answer of one step.

    Attributes:
        q: (nq,) the next posture.
        displacement: (nv,) tangent displacement to it, radians and metres.
        velocity: (nv,) displacement / dt.
        contacts: how many pairs had rows.
        rows: how many contact rows.
        exact: whether the program was solved to rounding.
        iterations: iterations of the QP solver.
        by: what closed the program, see `QPSolution`.
        share: how much of the program's displacement was gone: less than 1 where it was longer than what was looked at.
    """

    q: Array
    displacement: Array
    velocity: Array
    contacts: int
    rows: int
    exact: bool
    iterations: int
    by: str
    share: float


class Tracker:
    """Follows the goals of one problem, step by step.

    No step moves any piece farther than half the distance within which pairs were looked at, so nothing is jumped over,
    however thin, at any dt.
    """

    def __init__(self, problem: Problem, solver: QPSolver, dt: float) -> None:
        """Set up for steps of `dt` seconds.

        Raises:
            InputError: dt is not a positive finite number.
        """
        self.problem = check_problem(problem, "problem")
        self.dt = time_step(dt, "dt")
        self._subproblem = Subproblem(problem)
        self._lineariser = problem.lineariser(dt)
        self._working_set = WorkingSet(solver)
        self._within = LEAST_WITHIN
        proximity = problem.scene.proximity
        self._moving = np.flatnonzero(proximity.joint > 0)
        self._support = self._lineariser.state.support[proximity.joint[self._moving]]
        self._reach = proximity.reach[self._moving]

    def step(self, q: Array, measures: bool = True) -> Step:
        """One step from q, shape (nq,); a posture out of limits is brought back first.

        Without `measures` it is the least step that meets the goals, which puts right what a step with them left: it
        ends as near to the goals as its own curvature lets it, and does not go on to improve the measures.
        """
        self.problem.check_fresh()
        if self.problem.goals is not self._lineariser.goals:
            self._retarget()
        at, rows, program, answer = self._solved(q, measures)
        motion, turn = self._motion(answer.x)
        if motion > 0.5 * self._within and rows.lack.max(initial=0.0) > UNSEEN:
            # something came in fast: to get out of its way, one must look as far as one has to go
            self._within = min(HEADROOM * motion, LARGEST_WITHIN)
            at, rows, program, answer = self._solved(q, measures)
            motion, turn = self._motion(answer.x)
        share = min(1.0, 0.5 * self._within / max(motion, 1e-12))
        displacement = answer.x if share == 1.0 else share * answer.x
        if 0.5 * share**2 * motion * turn > UNSEEN:
            displacement, share = self._looked_after(at, rows, program, displacement, share)
        self._within = min(max(LEAST_WITHIN, HEADROOM * motion), LARGEST_WITHIN)
        following = pin.integrate(self.problem.scene.model, at.q, displacement)
        return Step(
            following, displacement, displacement / self.dt, len(at.contacts.distance), len(at.gap), answer.exact,
            answer.iterations, answer.by, share,
        )  # fmt: skip

    def _solved(self, q: Array, measures: bool) -> tuple[Linearisation, Rows, QuadraticProgram, QPSolution]:
        """Linearisation, rows, program and its answer at a posture (nq,)."""
        at = self._lineariser.at(q, self._within)
        rows = self._subproblem.rows(at)
        program = self._subproblem.program(
            at, rows, RADIUS, PULL * RADIUS, DAMPING, np.zeros(len(rows.soft_error)), measures
        )
        return at, rows, program, self._working_set.solve(program, rows.key)

    def _looked_after(
        self, at: Linearisation, rows: Rows, program: QuadraticProgram, displacement: Array, share: float
    ) -> tuple[Array, float]:
        """A step that turns far is looked at where it ends: what turning brought nearer is asked for, or the step cut.

        Args:
            at: where the step begins.
            rows: its rows.
            program: its program.
            displacement: (nv,) of the step.
            share: of the program's own displacement.

        Returns:
            The displacement (nv,) and its share.
        """
        began = np.minimum(at.contacts.distance, at.clearance[: len(at.contacts.distance)])
        groups = np.zeros(rows.groups)
        for _ in range(CORRECTIONS):
            short = self._shortfall(at, displacement, np.maximum(began, self._foreseen(at, rows, displacement)))
            if short.max(initial=0.0) <= UNSEEN:
                return displacement, share
            groups[rows.groups - len(short) :] += short
            again = self._working_set.solve(replace(program, least=program.least + groups[rows.group]), rows.key)
            self.problem.scene.proximity.place(self._lineariser.state.update(at.q).data)  # where motion begins
            motion, _ = self._motion(again.x)
            share = min(1.0, 0.5 * self._within / max(motion, 1e-12))
            displacement = share * again.x
        for _ in range(CUTS):
            if self._shortfall(at, displacement, began).max(initial=0.0) <= UNSEEN:
                return displacement, share
            displacement, share = 0.5 * displacement, 0.5 * share
        return 0.0 * displacement, 0.0

    def _foreseen(self, at: Linearisation, rows: Rows, displacement: Array) -> Array:
        """Distance (k,) that each contact has after a displacement (nv,) as its rows have it, at most what is asked."""
        lack = np.zeros(rows.groups)
        np.maximum.at(lack, rows.group, rows.lack - rows.elastic @ displacement)
        count = len(at.contacts.distance)
        foreseen: Array = at.clearance[:count] - lack[rows.groups - count :]
        return foreseen

    def _shortfall(self, at: Linearisation, displacement: Array, kept: Array) -> Array:
        """By how much each contact (k,) is nearer after a displacement (nv,) than the distances (k,) it should keep."""
        scene = self.problem.scene
        state = self._lineariser.state.update(pin.integrate(scene.model, at.q, displacement))
        near = scene.proximity.near(state.data, float(at.clearance.max(initial=0.0)) + UNSEEN)
        after = np.full(len(scene.proximity.pairs), np.inf)
        after[near.number] = near.distance
        short: Array = np.maximum(kept - after[at.contacts.number], 0.0)
        return short

    def _retarget(self) -> None:
        """Take the problem's new goals; what was set up stays where they have the same kinds and weights."""
        before, now = self._lineariser.goals, self.problem.goals
        self._lineariser.goals = now
        if [(type(goal), goal.weight) for goal in before] != [(type(goal), goal.weight) for goal in now]:
            self._subproblem = Subproblem(self.problem)
            self._working_set.forget()

    def _motion(self, displacement: Array) -> tuple[float, float]:
        """Longest way of any point of any piece, metres, and largest turn, to first order in the displacement (nv,)."""
        twist = (self._support * displacement) @ self._lineariser.state.jacobian.T
        center = self.problem.scene.proximity.placements[self._moving, 3]
        turn = twist[:, 3:]
        shift = twist[:, :3].copy()
        shift[:, 0] += turn[:, 1] * center[:, 2] - turn[:, 2] * center[:, 1]
        shift[:, 1] += turn[:, 2] * center[:, 0] - turn[:, 0] * center[:, 2]
        shift[:, 2] += turn[:, 0] * center[:, 1] - turn[:, 1] * center[:, 0]
        angle = np.sqrt(np.einsum("ij,ij->i", turn, turn))
        way = np.sqrt(np.einsum("ij,ij->i", shift, shift)) + angle * self._reach
        return float(way.max(initial=0.0)), float(angle.max(initial=0.0))
