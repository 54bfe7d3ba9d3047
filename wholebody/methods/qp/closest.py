"""The nearest that limbs come to goals out of reach, by Newton steps that know how bodies turn.

A goal out of reach leaves a large residual, and Gauss-Newton steps, which neglect the residual's curvature, creep along
a stretched limb for hundreds of iterations. Here the curvature is part of the program: with F the force that the
weighted residual puts on a point p of a body, and w_j, v_j the angular and linear velocity that joint j gives it,

    d2/dq_j dq_k (F . p) = F . (w_j x (v_k + w_k x p)),    j between the root and k,

for goals and, by their multipliers, for holds (the Hessian of the Lagrangian; Nocedal and Wright 2006, section 18.1).
Its positive part joins the program as soft rows. A dozen programs lead to a stationary point.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import UndefinedTermError
from wholebody.base.records import with_values
from wholebody.figures.state import State, Wrench
from wholebody.geometry.continuous.moved_pairs import QueryResult
from wholebody.geometry.continuous.passing_through import passes_through
from wholebody.methods.control import Control
from wholebody.methods.qp.iterates import Iterate, LocalSolution
from wholebody.methods.qp.rows import Rows, StepSize
from wholebody.methods.qp.settings import NEAREST
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.subproblem import Subproblem, compiled_kernel
from wholebody.methods.qp.working_set import WorkingSet
from wholebody.problem import Problem
from wholebody.terms.linearisation import Lineariser

ENDLESS = 1e3  # m: of relaxation, with which no pair is looked at
LEAST_RADIUS = 1e-4
WORTH, POOR, GOOD = 0.05, 0.25, 0.6  # shares of the predicted reduction: a step is taken, was too long, may be longer
SHRINK = 0.3


class Closest:
    """Comes as near to a problem's goals as goes, with the curvature of what is pulled and held in every program."""

    def __init__(self, problem: Problem, lineariser: Lineariser, solver: QPSolver, control: Control) -> None:
        """Take a lineariser of the problem and what may end a descent."""
        self._problem, self._lineariser, self._control = problem, lineariser, control
        self._alone = lineariser.relaxed(ENDLESS)
        self._subproblem = Subproblem(problem, lineariser.state)
        self._solver = solver
        model = lineariser.state.model
        free = [joint.idx_v for joint in model.joints if joint.shortname() == "JointModelFreeFlyer"]
        self._walk = np.array([first + k for first in free for k in range(3)], dtype=np.intp)

    def without_contacts(self, start: Array, enough: float, most: int) -> LocalSolution:
        """Descend from a posture (nq,) within limits and constraints, as if nothing were there.

        Args:
            start: (nq,) where to begin.
            enough: violation at which to end, metres and radians.
            most: programs.

        Returns:
            A posture that may be inside of things; converged where nothing nearer is near.
        """
        return self._descend(self._alone, start, enough, most, 0.0, NEAREST.nearly_flat)

    def with_contacts(self, start: Array, enough: float, most: int) -> LocalSolution:
        """Descend from a posture (nq,) and pass through nothing; arguments as of `without_contacts`."""
        return self._descend(self._lineariser, start, enough, most, NEAREST.within, NEAREST.flat)

    def _descend(
        self, lineariser: Lineariser, q: Array, enough: float, most: int, within: float, flat: float
    ) -> LocalSolution:
        working_set = WorkingSet(self._solver)
        here = self._iterate_at(lineariser, q, within)
        push = np.zeros(len(here.rows.soft_error))
        radius, used, converged = NEAREST.radius, 0, False
        bent: tuple[Array, Array] | None = None  # at this posture; it stays where a step is rejected
        while used < most and here.violation.worst > enough and radius > LEAST_RADIUS and not self._control.over:
            used += 1
            rows = here.rows
            program = self._subproblem.program(here.at, rows, StepSize(0.5 * radius, 0.0, 0.0, False))
            if bent is None:
                lineariser.state.update(here.at.q)
                bent = self._curvature(rows, push if here.violation.hold <= NEAREST.held else np.zeros_like(push))
            bend, weight = bent
            lower, upper = program.lower.copy(), program.upper.copy()
            if not within:  # where nothing is in the way, and a translation bends nothing
                lower[self._walk], upper[self._walk] = here.at.lower[self._walk], here.at.upper[self._walk]
            program = with_values(
                program,
                lower=lower,
                upper=upper,
                diagonal=np.maximum(program.diagonal, NEAREST.damping * float(weight.max(initial=0.0))),
                rows=np.vstack([program.rows, bend]),
                target=np.concatenate([program.target, np.zeros(len(bend))]),
                weight=np.concatenate([program.weight, weight]),
            )
            x = working_set.solve(program, rows.key).x
            predicted = self._subproblem.violation(rows, x)
            pull = float(rows.soft_weight[: rows.goals].max(initial=1.0))
            goal = np.sqrt(predicted.goal**2 + float(weight @ (bend @ x) ** 2) / pull)
            gain = here.violation.total - with_values(predicted, goal=float(goal)).total
            held = not within or max(here.violation.hold, here.violation.elastic) <= enough
            if gain <= (flat * here.violation.total if held else enough):
                converged = True
                break
            step = float(np.abs(x).max(initial=0.0))
            try:
                there = self._iterate_at(
                    lineariser, np.asarray(pin.integrate(lineariser.state.model, here.at.q, x)), within
                )
            except UndefinedTermError as error:
                self._control.step_back(error)
                radius = SHRINK * min(radius, step)
                continue
            ratio = (here.violation.total - there.violation.total) / gain
            blocked = ratio > WORTH and within > 0.0 and self._jumps(here, there)
            if ratio < POOR or blocked:
                radius = SHRINK * min(radius, step)
            elif ratio > GOOD and step > 0.7 * radius:
                radius = min(2.0 * radius, NEAREST.largest_radius)
            if ratio > WORTH and not blocked:
                push = rows.soft_weight * (rows.soft @ x + rows.soft_error)
                here, bent = there, None
        return LocalSolution(here.at.q, here.violation, here.at.measure, converged, used)

    def _iterate_at(self, lineariser: Lineariser, q: Array, within: float) -> Iterate:
        at = lineariser.at(q, within)
        rows = self._subproblem.rows(at)
        return Iterate(at, rows, self._subproblem.violation(rows), QueryResult(at.contacts, within))

    def _jumps(self, here: Iterate, there: Iterate) -> bool:
        return passes_through(self._lineariser.workspace, here.placed, there.placed, here.at.q, there.at.q)

    def _curvature(self, rows: Rows, push: Array) -> tuple[Array, Array]:
        """Soft rows (k, nv) and weights (k,) that stand for the positive curvature of what is pulled and held.

        Args:
            rows: of the linearisation at the state's posture.
            push: (soft rows,) multipliers of the last program; goals pull with their residual.
        """
        state = self._lineariser.state
        force = np.concatenate([rows.soft_weight[: rows.goals] * rows.soft_error[: rows.goals], push[rows.goals :]])
        columns = state.support.shape[1]
        total, row = np.zeros((columns, columns)), 0
        for term in self._problem.goals:
            part = term.jacobian(state)
            size = len(part.rows) if isinstance(part, Wrench) else len(part)
            if isinstance(part, Wrench) and part.against == 0:
                _add_kinematic_hessian(total, state, part, force[row : row + size])
            row += size
        for held, equal in zip(self._problem.constraints, self._subproblem.equalities, strict=True):
            pulls = force[row : row + equal]
            row += equal
            if pulls.any():
                part = held.jacobian(state)
                if isinstance(part, Wrench) and part.against == 0 and equal == len(part.rows):
                    _add_kinematic_hessian(total, state, part, pulls)
        bending = state.folded(state.folded(total).T)
        bent = np.flatnonzero(bending.any(axis=0))
        value, vector = np.linalg.eigh(bending[np.ix_(bent, bent)])
        kept = value > NEAREST.negligible * max(float(value.max(initial=0.0)), 1.0)
        ways = np.zeros((int(kept.sum()), len(bending)))
        ways[:, bent] = vector[:, kept].T
        return ways, value[kept]


def _add_kinematic_hessian(total: Array, state: State, part: Wrench, force: Array) -> None:
    """Add the second derivative of force times place, for the rows of one term on one joint, to a total.

    The rows are forces along the world's axes through a point, or moments, or both in this order; others have none.

    Args:
        total: (n, n) over the columns of the state's Jacobian; it is changed.
        state: at the posture.
        part: rows of the term.
        force: (rows,) what each pulls with.
    """
    linear, moment = part.rows[:3], force[3:6] if len(force) == 6 else np.zeros(3)
    if len(linear) != 3:
        return
    pull, point = force[:3], np.zeros(3)
    # by which rows of a wrench may differ from the axes of the world
    if np.abs(linear[:, :3] - np.eye(3)).max() <= 1e-9:
        point = np.array([linear[1, 5], linear[2, 3], linear[0, 4]])
    elif not linear[:, :3].any():
        pull, moment = np.zeros(3), force[:3]
    else:
        return
    compiled_kernel().add_kinematic_hessian(total, state.columns, state.support[part.joint], point, pull, moment)
