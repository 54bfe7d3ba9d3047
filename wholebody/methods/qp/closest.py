"""The closest posture to goals out of reach, by Newton steps with the second derivative of the residual.

With F the force that the weighted residual puts on a point p of a body, and w_j, v_j the angular and linear velocity
that joint j gives it, it is ``d2/dq_j dq_k (F . p) = F . (w_j x (v_k + w_k x p))``, j between the root and k, for goals
and, by their multipliers, for holds (Nocedal and Wright 2006, section 18.1). Its positive part joins as soft rows.
Where a descent rests although constraints are violated, the penalty on these grows (section 17.2, framework 17.2).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, with_values
from wholebody.figures.state import State, Wrench
from wholebody.methods.qp.iterates import Iterate, LocalSolution, Stage
from wholebody.methods.qp.quadratic_program import Rows, StepSize, Violation
from wholebody.methods.qp.settings import NEAREST, SEARCH
from wholebody.methods.qp.solvers.base import WorkingSet
from wholebody.methods.qp.subproblem import compiled_kernel
from wholebody.problem import Problem

ENDLESS = 1e3  # m: of relaxation, with which no pair is looked at
LEAST_RADIUS = 1e-4
WORTH, POOR, GOOD = 0.05, 0.25, 0.6  # shares of the predicted reduction: a step is taken, was too long, may be longer
SHRINK = 0.3


@dataclass
class Closest(Stage):
    """Comes as near to a problem's goals as goes, with the curvature of what is pulled and held in every program.

    `run` ends where the violation is within the tolerance, and has converged where nothing nearer is near. Without
    contacts the answer may be inside of things.
    """

    problem: Problem = field(kw_only=True)
    contacts: bool = True  # whether things count; without, the lineariser is to be relaxed by `ENDLESS`

    def __post_init__(self) -> None:
        """Find the translations of free roots."""
        model = self.shared.lineariser.state.model
        free = [joint.idx_v for joint in model.joints if joint.shortname() == "JointModelFreeFlyer"]
        self._share = 1.0  # of the goals against constraints
        self._walk = np.array([first + k for first in free for k in range(3)], dtype=np.intp)

    def look(self, q: Array, longest: float = np.inf) -> Iterate:
        """See `Stage.look`."""
        here = self.iterate_at(q, NEAREST.within if self.contacts else 0.0, longest)
        here.rows.soft_weight[: here.rows.goals] *= self._share
        return here

    def _merit(self, violation: Violation) -> float:
        return violation.total - (1.0 - self._share) * violation.goal

    def run(self, start: Array) -> LocalSolution:
        """Descend from a posture within limits and constraints, shape (nq,)."""
        working_set, subproblem, control = WorkingSet(self.shared.solver), self.shared.subproblem, self.shared.control
        enough = self.tolerance
        flat = NEAREST.flat if self.contacts else NEAREST.nearly_flat
        self._share = 1.0
        here = self.look(start)
        push = np.zeros(len(here.rows.soft_error))
        radius, used, converged = NEAREST.radius, 0, False
        bent: tuple[Array, Array] | None = None  # at this posture; it stays where a step is rejected
        while used < self.iterations and here.violation.worst > enough and radius > LEAST_RADIUS and not control.over:
            used += 1
            rows = here.rows
            program = subproblem.program(here.at, rows, StepSize(0.5 * radius, 0.0, 0.0, False))
            if bent is None:
                self.shared.lineariser.state.update(here.at.q)
                bent = self._curvature(rows, push if here.violation.hold <= NEAREST.held else np.zeros_like(push))
            bend, weight = bent
            if not self.contacts:  # where nothing is in the way, and a translation bends nothing
                for own, most in ((program.lower, here.at.lower), (program.upper, here.at.upper)):
                    own[self._walk] = most[self._walk]
            program = with_values(
                program.with_squares(bend, weight),
                diagonal=np.maximum(program.diagonal, NEAREST.damping * float(weight.max(initial=0.0))),
            )
            x = working_set.solve(program, rows.key).x
            predicted = subproblem.violation(rows, x)
            pull = float(rows.soft_weight[: rows.goals].max(initial=0.0)) or 1.0
            goal = np.sqrt(predicted.goal**2 + float(weight @ (bend @ x) ** 2) / pull)
            total = self._merit(here.violation)
            gain = total - self._merit(with_values(predicted, goal=float(goal)))
            held = not self.contacts or max(here.violation.hold, here.violation.elastic) <= enough
            if gain <= (flat * total if held else enough):
                if held or self._share < 1.0:
                    converged = True
                    break
                self._share = NEAREST.share
                here, bent, radius = self.look(here.at.q), None, NEAREST.radius
                continue
            step = float(np.abs(x).max(initial=0.0))
            there = self.moved(here, x)
            if there is None:
                radius = SHRINK * min(radius, step)
                continue
            ratio = (total - self._merit(there.violation)) / gain
            blocked = ratio > WORTH and self.contacts and self.jumps(here, there)
            if ratio < POOR or blocked:
                radius = SHRINK * min(radius, step)
            elif ratio > GOOD and step > 0.7 * radius:
                radius = min(2.0 * radius, NEAREST.largest_radius)
            if ratio > WORTH and not blocked:
                push = rows.soft_weight * (rows.soft @ x + rows.soft_error)
                here, bent = there, None
        return self.ended(here, converged, used)

    def _curvature(self, rows: Rows, push: Array) -> tuple[Array, Array]:
        """Soft rows (k, nv) and weights (k,) of the positive curvature of what `push` (soft rows,) pulls and holds."""
        state = self.shared.lineariser.state
        force = np.concatenate([rows.soft_weight[: rows.goals] * rows.soft_error[: rows.goals], push[rows.goals :]])
        columns = state.support.shape[1]
        total, row = np.zeros((columns, columns)), 0
        for term in self.problem.goals:
            part = term.jacobian(state)
            size = len(part.rows) if isinstance(part, Wrench) else len(part)
            if isinstance(part, Wrench) and part.against == 0:
                _add_kinematic_hessian(total, state, part, force[row : row + size])
            row += size
        for held, equal in zip(self.problem.constraints, self.shared.subproblem.equalities, strict=True):
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
        directions = np.zeros((int(kept.sum()), len(bending)))
        directions[:, bent] = vector[:, kept].T
        return directions, value[kept]


class ReachTrials(NamedTuple):
    """What descents through everything tell of how near goals can come."""

    out_of_reach: bool  # whether enough of them rest at the same distance
    nearest: LocalSolution | None  # of all ends that count and what was known the nearest; None without any
    spent: int  # programs
    others: tuple[Array, ...] = ()  # where the others rest (nq,) that are as near


def reach_trials(
    reach: Closest, starts: Iterable[Array], near: LocalSolution | None, agreeing: int, tolerance: float
) -> ReachTrials:
    """Descend from each start (nq,) until one reaches the goals, or `agreeing` ends are equally near.

    This is then the least that limits and constraints allow, if no end came nearer than these, `near` among them: local
    minima differ.
    """
    ends, spent = list[LocalSolution](), 0
    for begin in starts:
        local = reach.run(begin)
        spent += local.iterations
        if local.violation.worst <= reach.tolerance or reach.shared.control.over:
            return ReachTrials(False, near, spent)
        if local.violation.hold > SEARCH.held * local.violation.left:
            continue  # from there the constraints alone are too far
        ends.append(local)
        near = local if near is None or local.violation.total < near.violation.total else near
        most = SEARCH.agree * near.violation.total + tolerance
        alike = [end for end in ends if end.violation.total <= most]
        if len(alike) == agreeing:
            return ReachTrials(True, near, spent, tuple(end.q for end in alike if end is not near))
    return ReachTrials(False, near, spent)


def _add_kinematic_hessian(total: Array, state: State, part: Wrench, force: Array) -> None:
    """Add the second derivative of force times place to a total (n, n), for rows of one term on one joint."""
    # The rows are forces along the world's axes through a point, or moments, or both; others have none.
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
