"""What solvers that are asked by their own interfaces share: a workspace that is kept, multipliers that are read."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, NamedTuple

import numpy as np

from wholebody.arrays import Array
from wholebody.methods.qp.active_set import solve_from
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.solvers.fallback import CORRECTIONS, last_resort
from wholebody.methods.qp.solvers.split_form import SCALE, SplitForm, read_active, scaled_split, slots_for
from wholebody.records import with_values


class Native(NamedTuple):
    """What a solver answers to a scaled split form.

    Attributes:
        z: (n + m + slots,) its variables.
        box: (n,) multipliers of the box, positive at upper bounds.
        push: (slots,) multipliers of the elastic rows, positive where they push.
        iterations: the solver's own.
    """

    z: Array
    box: Array
    push: Array
    iterations: int


class NativeSolver(QPSolver):
    """A solver on the scaled split form, whose answer is made exact by correcting the active set of its multipliers."""

    def __init__(self, hot_start: bool = True) -> None:
        """Begin without a workspace."""
        super().__init__(hot_start)
        self._shape = (0, 0, 0)
        self._workspace: Any = None
        self._own: Array | None = None

    def own(self) -> Array | None:
        """See `QPSolver.own`."""
        return self._own

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise, from the last answer where the workspace is of the program's size, and once more without it."""
        n, m, k = program.size, len(program.target), len(program.least)
        before = self._shape[2] if self._shape[:2] == (n, m) else 0
        slots = slots_for(program, before)
        form = scaled_split(program, slots)
        if self._shape != (n, m, slots):
            self._shape, self._workspace = (n, m, slots), None
        iterations, x = 0, np.zeros(n)
        for _ in range(1 if self._workspace is None else 2):
            found = self.minimise(form, n, m)
            if found is None:
                break
            iterations += found.iterations
            x = self._own = np.where(np.isfinite(found.z[:n]), found.z[:n], 0.0) / SCALE
            solution = solve_from(program, read_active(found.box, found.push[:k]), CORRECTIONS)
            if solution is not None:
                return with_values(solution, iterations=iterations, by=self.name)
            self._workspace = None
        return last_resort(program, x, iterations)

    @abstractmethod
    def minimise(self, form: SplitForm, n: int, m: int) -> Native | None:
        """Ask the solver.

        Args:
            form: what to solve; `self._workspace` is None where its size is another than that of the one before.
            n: variables with a box.
            m: soft rows, which come first.

        Returns:
            Its answer, or None where it refuses the program.
        """
