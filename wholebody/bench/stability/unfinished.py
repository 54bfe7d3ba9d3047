"""A QP solver that never finishes: what its iteration limit leaves is its answer."""

from __future__ import annotations

from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import approximate
from wholebody.methods.qp.solvers.osqp_solver import OSQPSolver, _Workspace

LIMIT = 5  # iterations: OSQP takes 25 to some hundreds for programs of a reach


class Unfinished(OSQPSolver):
    """OSQP that is stopped early, without the active sets and the fallback that make its answers exact."""

    name = "osqp, unfinished"

    def solve(self, program: QuadraticProgram, guess: ActiveSet | None) -> QPSolution:
        """Minimise, not quite; a guess is not used."""
        return self.solve_cold(program)

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """What some iterations lead to, inside the box of the program."""
        if self._workspace is None or not self._workspace.fits(program):
            self._workspace = _Workspace(program, self._workspace)
        self._workspace.load(program)
        x, used = self._workspace.run(LIMIT, 1e-3)
        return approximate(program, x, used, self.name)
