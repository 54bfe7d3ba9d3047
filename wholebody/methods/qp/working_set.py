"""Programs with hundreds of elastic rows, of which a handful matters: solve with those, look, add what was missed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Mask
from wholebody.methods.qp.active_set import compiled_kernel, room_for
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram, Room, work_size
from wholebody.methods.qp.settings import CORRECTIONS
from wholebody.methods.qp.solvers.base import ACTIVE_SET, QPSolver


class WorkingSet:
    """Solves one program after the other, each from the active set of the one before.

    Rows come and go with the contacts; they are recognised by their keys.

    Attributes:
        held: (2, n) lower and upper bounds that held the last answer; None where none is known.
        pushing: keys of the elastic rows that pushed in it, in ascending order.
    """

    def __init__(self, solver: QPSolver) -> None:
        self.solver = solver
        self._kernel = compiled_kernel()
        self._room: Room | None = None
        self.held: Mask | None = None
        self.reset()

    def solve(self, program: QuadraticProgram, key: NDArray[np.intp]) -> QPSolution:
        """Solve a program with elastic rows named `key` (k,) from the last active set, or else by the solver."""
        # The set of elastic rows grows until no other row is violated: rows left out would not push.
        answer = self._corrected(program, key) if self.solver.hot_start else None
        if answer is None:
            answer = self.solver.solve(program)
        self.held = np.array([answer.active.lower, answer.active.upper])
        self.pushing = np.sort(key[answer.active.elastic])
        self.solver.count(answer.by)
        return answer

    def reset(self) -> None:
        """Drop the guess."""
        self.held = None
        self.pushing = np.zeros(0, dtype=np.intp)

    def _corrected(self, program: QuadraticProgram, key: NDArray[np.intp]) -> QPSolution | None:
        """The answer by the active set of the program before, corrected; None where that does not settle."""
        x: Array = np.empty(program.size)
        lower, upper = np.zeros((2, program.size), dtype=bool) if self.held is None else self.held.copy()
        active = ActiveSet(lower, upper, np.empty(len(key), dtype=bool))
        program.check_shapes(active)
        rounds = self._kernel.grow(program, key, self.pushing, active, CORRECTIONS, self.room(program), x)
        return None if rounds < 0 else QPSolution(x, active, True, 0, ACTIVE_SET)

    def room(self, program: QuadraticProgram) -> Room:
        """Room of the compiled loops for a program, kept from one to the next."""
        size = work_size(program.size, len(program.target), len(program.least))
        room = self._room
        if room is None or size > len(room.work) or len(program.least) > len(room.chosen):
            room = self._room = room_for(program, 2)
        return room
