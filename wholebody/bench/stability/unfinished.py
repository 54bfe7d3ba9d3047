"""A QP solver that never finishes: what its iteration limit leaves is its answer."""

from __future__ import annotations

from wholebody.methods.qp.active_set import guess_active_set
from wholebody.methods.qp.method import QP
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.solvers.fallback import GUESS_TOLERANCE
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
        x = x.clip(program.lower, program.upper)
        return QPSolution(x, guess_active_set(program, x, GUESS_TOLERANCE), False, used, self.name)


class UnfinishedQP(QP):
    """The QP method with such a solver."""

    def _qp_solver(self) -> QPSolver:
        """One that never finishes."""
        return Unfinished()
