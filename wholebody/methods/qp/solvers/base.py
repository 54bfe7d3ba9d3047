"""What a QP solver has to do, and which programs of a run it is given."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.qp.active_set import NOT_EXACT, last_resort, violated_set
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram

ACTIVE_SET = "active set"
"""What `QPSolution.by` says of answers that the hot start found: an active set that was known, corrected."""

LARGEST = 400
"""Rows of a program above which a hot start that does not settle asks no solver: setting one up takes longer."""


class QPSolver(ABC):
    """Solves the programs of one run, one after the other; keeps what helps the next one, and counts what closed them.

    Attributes:
        name: of the solver.
        hot_start: whether programs begin with the active set of the one before, corrected; the solver is then asked
            only where that does not settle. Otherwise every program is the solver's.
        uncorrected: (n,) the solver's own answer to the last program that it was given, before the active set was
            corrected; None where it has none.
    """

    name: str
    uncorrected: Array | None = None

    def __init__(self, hot_start: bool = True) -> None:
        self.hot_start = hot_start
        self._programs: dict[str, int] = {}

    def solve(self, program: QuadraticProgram) -> QPSolution:
        """Minimise without a known active set: never NaN, inside the box; `exact` False for an approximation."""
        if not program.is_computable:
            stay = np.clip(np.zeros(program.size), program.lower, program.upper)
            return QPSolution(np.where(np.isfinite(stay), stay, 0.0), violated_set(program), False, 0, NOT_EXACT)
        if self.hot_start and len(program.target) + len(program.least) > LARGEST:
            return last_resort(program, np.zeros(program.size), 0)
        return self.solve_cold(program)

    def count(self, by: str) -> str:
        """Count one program by what closed it, and return that."""
        self._programs[by] = self._programs.get(by, 0) + 1
        return by

    def counted(self) -> dict[str, int]:
        """How many programs each closed since this was last asked."""
        programs, self._programs = self._programs, {}
        return programs

    def load(self) -> None:
        """Import what `solve_cold` needs, for those who cannot wait for it later."""
        return

    @abstractmethod
    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise by the solver, from the solver's own last answer where it takes one."""
