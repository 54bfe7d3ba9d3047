"""What a QP solver has to do, and which programs of a run it is given."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.records import with_values
from wholebody.methods.qp.active_set import NOT_EXACT, last_resort, solve_from, violated_set
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.settings import CORRECTIONS

ACTIVE_SET = "active set"
"""What `QPSolution.by` says of answers that the hot start found: an active set that was known, corrected."""

LARGEST = 400
"""Rows of a program above which a hot start that does not settle asks no solver: setting one up takes longer."""


class QPSolver(ABC):
    """Solves the programs of one run, one after the other; keeps what helps the next one, and counts what closed them.

    Attributes:
        name: of the solver.
        hot_start: whether programs after the first begin with an active set that is known, corrected; the solver is
            then asked only where that does not settle. Otherwise every program is the solver's.
        uncorrected: (n,) the solver's own answer to the last program that it was given, before the active set was
            corrected; None where it has none.
    """

    name: str
    uncorrected: Array | None = None

    def __init__(self, hot_start: bool = True) -> None:
        """Begin with no program solved."""
        self.hot_start = hot_start
        self._begun = False
        self._programs = Counter[str]()

    def solve(self, program: QuadraticProgram) -> QPSolution:
        """Minimise, without an active set of a program like this one.

        Returns:
            The answer; `exact` is False where only an approximation was found. Never NaN, always inside the box. No
            solver gets a program that is not computable: its answer is to stay, as far as the box has zero.
        """
        hot = self.hot_start and self._begun  # the first program of a run is the solver's
        solution = solve_from(program, violated_set(program), CORRECTIONS.most) if hot else None
        if solution is not None:
            return with_values(solution, by=ACTIVE_SET)
        if not program.is_computable:
            stay = np.clip(np.zeros(program.size), program.lower, program.upper)
            return QPSolution(np.where(np.isfinite(stay), stay, 0.0), violated_set(program), False, 0, NOT_EXACT)
        if hot and len(program.target) + len(program.least) > LARGEST:
            return last_resort(program, np.zeros(program.size), 0)
        self._begun = True
        return self.solve_cold(program)

    def count(self, by: str) -> str:
        """Count one program by what closed it, and return that."""
        self._programs[by] += 1
        return by

    def counted(self) -> dict[str, int]:
        """How many programs each closed since this was last asked."""
        programs, self._programs = dict(self._programs), Counter()
        return programs

    def load(self) -> None:
        """Import what `solve_cold` needs, for those who cannot wait for it later."""
        return

    @abstractmethod
    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise by the solver, from the solver's own last answer where it takes one."""
