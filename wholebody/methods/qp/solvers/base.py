"""What a QP solver has to do."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from wholebody.methods.qp.active_set import lacking, solve_from
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.fallback import last_resort

WARM_CORRECTIONS = 120
"""Corrections of the last active set before the solver is asked."""

LARGEST = 400
"""Rows of a program above which no solver is asked: setting one up takes longer than the answer by other means."""


class QPSolver(ABC):
    """Solves programs one after the other; keeps what helps the next one."""

    name: str

    def solve(self, program: QuadraticProgram, guess: ActiveSet | None) -> QPSolution:
        """Minimise: from the last active set, which most steps of a drag do not change, else by the solver.

        Args:
            program: what to solve.
            guess: active set of a program like this one; None for what lacks at x = 0, from which nineteen in twenty
                first programs settle at a tenth of what setting up a solver costs.

        Returns:
            The answer; `exact` is False where only an approximation was found. Never NaN, always inside the box.
        """
        solution = solve_from(program, lacking(program) if guess is None else guess, WARM_CORRECTIONS)
        if solution is not None:
            return solution._replace(by="first active set" if guess is None else "last active set")
        if len(program.target) + len(program.least) > LARGEST:
            return last_resort(program, np.zeros(program.size), 0, self.name)
        return self.solve_cold(program)

    def load(self) -> None:
        """Import what `solve_cold` needs, for those who cannot wait for it later: most programs are closed without."""
        return

    @abstractmethod
    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise without a guess; what `solve` falls back on."""
