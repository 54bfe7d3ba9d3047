"""One step of tracking: goals that move from call to call are followed by one quadratic program a step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.errors import InputError
from wholebody.methods.qp.quadratic_program import ActiveSet, Array
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.subproblem import Subproblem
from wholebody.methods.qp.working_set import solve_by_rows
from wholebody.problem import Problem

WITHIN = 0.06  # m beyond the clearance: pairs nearer than this get rows; at least what moves in one step
LARGEST_STEP = 0.25  # rad, m: where no velocity bounds a step, this does


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
    """

    q: Array
    displacement: Array
    velocity: Array
    contacts: int
    rows: int
    exact: bool
    iterations: int


class Tracker:
    """Follows the goals of one problem, step by step."""

    def __init__(self, problem: Problem, solver: QPSolver, dt: float) -> None:
        """Set up for steps of `dt` seconds.

        Raises:
            InputError: dt is not a positive finite number.
        """
        if not (np.isfinite(dt) and dt > 0.0):
            raise InputError(f"dt is {dt}; give a step in seconds, such as 0.01")
        self.problem, self.dt = problem, dt
        self._solver = solver
        self._subproblem = Subproblem(problem)
        self._lineariser = problem.lineariser(dt)
        self._guess: ActiveSet | None = None

    def step(self, q: Array) -> Step:
        """One step from q, shape (nq,)."""
        model = self.problem.scene.model
        at = self._lineariser.at(q, WITHIN)
        rows = self._subproblem.rows(at)
        program = self._subproblem.program(at, rows, LARGEST_STEP, 0.0, np.zeros(len(rows.soft_error)), True)
        answer = solve_by_rows(self._solver, program, self._guess)
        self._guess = answer.active
        following = pin.integrate(model, at.q, answer.x)
        return Step(
            following, answer.x, answer.x / self.dt, len(at.contacts.distance), len(at.gap), answer.exact,
            answer.iterations,
        )  # fmt: skip
