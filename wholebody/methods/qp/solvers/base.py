"""What a QP solver has to do, and which programs of a run it is given."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.records import with_values
from wholebody.methods.qp.active_set import (
    NOT_EXACT,
    SEMISMOOTH,
    last_resort,
    solve_from,
    violated_set,
)
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.settings import CORRECTIONS

ACTIVE_SET = "active set"
"""What `QPSolution.by` says of answers that the hot start found: an active set that was known, corrected."""

_NEED = {ACTIVE_SET: 0, SEMISMOOTH: 2, NOT_EXACT: 3}  # a solver is between them

LARGEST = 400
"""Rows of a program above which a hot start that does not settle asks no solver: setting one up takes longer."""


class QPSolver(ABC):
    """Solves the programs of one run, one after the other; keeps what helps the next one, and counts what closed them.

    Attributes:
        name: of the solver.
        hot_start: whether programs after the first begin with an active set that is known, corrected; the solver is
            then asked only where that does not settle. Otherwise every program is the solver's.
    """

    name: str

    def __init__(self, hot_start: bool = True) -> None:
        """Begin with no program solved."""
        self.hot_start = hot_start
        self._begun = False
        self._programs: dict[str, int] = {}

    def solve(self, program: QuadraticProgram, guess: ActiveSet | None) -> QPSolution:
        """Minimise.

        Args:
            program: what to solve.
            guess: active set of a program like this one; None where none is known. With a hot start it is corrected,
                and None stands for the rows violated at x = 0; but the first program of all is the solver's.

        Returns:
            The answer; `exact` is False where only an approximation was found. Never NaN, always inside the box. No
            solver gets a program that is not computable: its answer is to stay, as far as the box has zero.
        """
        if self.hot_start and self._begun:
            solution = solve_from(program, violated_set(program) if guess is None else guess, CORRECTIONS.most)
            if solution is not None:
                return with_values(solution, by=ACTIVE_SET)
        if not program.is_computable:
            stay = np.clip(np.zeros(program.size), program.lower, program.upper)
            return QPSolution(np.where(np.isfinite(stay), stay, 0.0), violated_set(program), False, 0, NOT_EXACT)
        if not (self.hot_start and self._begun):
            self._begun = True
            return self.solve_cold(program)
        if len(program.target) + len(program.least) > LARGEST:
            return last_resort(program, np.zeros(program.size), 0)
        return self.solve_cold(program)

    def count(self, closed: Sequence[str]) -> str:
        """Count one program, of whose rounds this closed them; what it needed most of all.

        A program is the hot start's where that was enough in every round, and semismooth Newton's where one round
        needed it.
        """
        by = closed[0] if len(closed) == 1 else max(closed, key=lambda name: _NEED.get(name, 1))
        self._programs[by] = self._programs.get(by, 0) + 1
        return by

    def counted(self) -> dict[str, int]:
        """How many programs each closed since this was last asked."""
        programs, self._programs = self._programs, {}
        return programs

    def uncorrected(self) -> Array | None:
        """(n,) the solver's own answer to the last program that it was given, before the active set was corrected."""
        return None

    def load(self) -> None:
        """Import what `solve_cold` needs, for those who cannot wait for it later."""
        return

    @abstractmethod
    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise by the solver, from the solver's own last answer where it takes one."""
