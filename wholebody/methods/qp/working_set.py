"""Programs with hundreds of elastic rows, of which a handful matters: solve with those, look, add what was missed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.arrays import Mask
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import QPSolver

NEAR = 0.03  # m: rows lacking less than this at x = 0 are in from the beginning
ROUNDS = 8  # most times that rows are added before all of them are


class WorkingSet:
    """Solves one program after the other, each from the active set of the one before.

    Rows come and go with the contacts; they are recognised by their keys.
    """

    def __init__(self, solver: QPSolver) -> None:
        """Begin without a guess."""
        self.solver = solver
        self._lower: Mask | None = None
        self._upper: Mask | None = None
        self._pushing: set[int] = set()

    def solve(self, program: QuadraticProgram, key: NDArray[np.intp]) -> QPSolution:
        """Solve a program by growing its set of elastic rows until no other row is violated.

        The answer is the full program's: rows left out are satisfied, and would not push.

        Args:
            program: the full program.
            key: (k,) names of its elastic rows.
        """
        pushing = np.array([name in self._pushing for name in key.tolist()], dtype=bool)
        chosen = (program.least > -NEAR) | pushing
        lower, upper = self._lower, self._upper
        closed: list[str] = []
        iterations = 0
        for attempt in range(ROUNDS + 1):
            if attempt == ROUNDS:
                chosen[:] = True
            smaller = program.with_elastic(chosen)
            guess = None if lower is None or upper is None else ActiveSet(lower, upper, pushing[chosen])
            answer = self.solver.solve(smaller, guess)
            closed.append(answer.by)
            iterations += answer.iterations
            missed = (program.elastic @ answer.x < program.least - 1e-9) & ~chosen
            lower, upper = answer.active.lower, answer.active.upper
            pushing = np.zeros(len(key), dtype=bool)
            pushing[chosen] = answer.active.elastic
            if not missed.any():
                break
            chosen |= missed
        self._lower, self._upper, self._pushing = lower, upper, set(key[pushing].tolist())
        active = ActiveSet(answer.active.lower, answer.active.upper, pushing)
        return answer._replace(active=active, iterations=iterations, by=self.solver.count(closed))

    def forget(self) -> None:
        """Drop the guess."""
        self._lower = self._upper = None
        self._pushing = set()
