"""What solvers that are asked by their own interfaces share: a workspace that is kept, multipliers that are read."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.records import with_values
from wholebody.methods.qp.active_set import last_resort, solve_from
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram, SplitForm
from wholebody.methods.qp.settings import CORRECTIONS
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.solvers.split_form import (
    SCALING,
    compiled_kernel,
    empty_form,
    read_active,
    scaled_split,
    slots_for,
)


class NativeAnswer(NamedTuple):
    """What a solver answers to a program.

    Attributes:
        x: (n,) the displacement, in units of the program.
        box: (n,) multipliers of the box, positive at upper bounds.
        push: (k or more,) multipliers of the elastic rows, positive where they push.
        iterations: the solver's own.
    """

    x: Array
    box: Array
    push: Array
    iterations: int


class NativeSolver(QPSolver):
    """A solver whose answer is made exact by correcting the active set of its multipliers."""

    def __init__(self, hot_start: bool = True) -> None:
        """Begin without a workspace."""
        super().__init__(hot_start)
        self._shape = (0, 0, 0)
        self._workspace: Any = None
        self._uncorrected: Array | None = None

    def uncorrected(self) -> Array | None:
        """See `QPSolver.uncorrected`."""
        return self._uncorrected

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise, from the last answer where the workspace is of the program's size, and once more without it."""
        n, m, k = program.size, len(program.target), len(program.least)
        shape = (n, m, slots_for(program, self._shape[2] if self._shape[:2] == (n, m) else 0))
        if self._shape != shape:
            self._shape, self._workspace = shape, None
        iterations, x = 0, np.zeros(n)
        for _ in range(1 if self._workspace is None else 2):
            found = self.minimise(program, shape[2])
            if found is None:
                break
            iterations += found.iterations
            x = self._uncorrected = np.where(np.isfinite(found.x), found.x, 0.0)
            solution = solve_from(program, read_active(found.box, found.push[:k]), CORRECTIONS.of_guess)
            if solution is not None:
                return with_values(solution, iterations=iterations, by=self.name)
            self._workspace = None
        return last_resort(program, x, iterations)

    @abstractmethod
    def minimise(self, program: QuadraticProgram, slots: int) -> NativeAnswer | None:
        """Ask the solver.

        Args:
            program: what to solve; `self._workspace` is None where its size is another than that of the one before.
            slots: elastic rows that a workspace has room for, at least the program's.

        Returns:
            Its answer, or None where it refuses the program.
        """


class SplitFormSolver(NativeSolver):
    """A solver that gets the scaled split form."""

    def __init__(self, hot_start: bool = True) -> None:
        """Begin without a workspace."""
        super().__init__(hot_start)
        self._form = empty_form(0, 0, 0)

    def load(self) -> None:
        """Make the loop that fills the form ready."""
        compiled_kernel()

    def minimise(self, program: QuadraticProgram, slots: int) -> NativeAnswer | None:
        """See `NativeSolver.minimise`."""
        n, m = program.size, len(program.target)
        if self._workspace is None:
            self._form = empty_form(n, m, slots)
        found = self.answer(scaled_split(program, self._form), n, m)
        return None if found is None else with_values(found, x=found.x[:n] / SCALING.x)

    @abstractmethod
    def answer(self, form: SplitForm, n: int, m: int) -> NativeAnswer | None:
        """Ask the solver.

        Args:
            form: what to solve, written over by the next; `self._workspace` is None where it is of another size.
            n: variables with a box.
            m: soft rows, which come first.

        Returns:
            Its answer with all of the form's variables for x, or None where it refuses the program.
        """
