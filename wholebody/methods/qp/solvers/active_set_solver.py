"""Our own solver of whole programs: an active set, corrected from the rows that lack, and OSQP where that fails."""

from __future__ import annotations

from wholebody.methods.qp.active_set import lacking, solve_from
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import ACTIVE_SET, WARM_CORRECTIONS, QPSolver
from wholebody.methods.qp.solvers.osqp_solver import OSQPSolver


class ActiveSetSolver(QPSolver):
    """The primal-dual active set method throughout; OSQP where the sets do not settle."""

    name = "active_set"

    def __init__(self, hot_start: bool = True) -> None:
        """Begin without a workspace."""
        super().__init__(hot_start)
        self._osqp = OSQPSolver()

    def load(self) -> None:
        """Import OSQP."""
        self._osqp.load()

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise from no bounds and the rows that x = 0 does not meet; see `QPSolver.solve_cold`."""
        solution = solve_from(program, lacking(program), WARM_CORRECTIONS)
        return self._osqp.solve_cold(program) if solution is None else solution._replace(by=ACTIVE_SET)
