"""What a QP solver has to do, which programs of a run it is given and in what form: docs/theory/qp_programs.md."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.methods.qp.active_set import NOT_EXACT, compiled_kernel, last_resort, room_for, violated_set
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram, Room, work_size
from wholebody.methods.qp.settings import CORRECTIONS

ACTIVE_SET = "active set"
"""What `QPSolution.by` says of answers that the hot start found: an active set that was known, corrected."""


class QPSolver(ABC):
    """Solves the programs of one run, one after the other; keeps what helps the next one, and counts what closed them.

    Attributes:
        name: of the solver.
        hot_start: whether programs begin with the active set of the one before, corrected, then semismooth Newton
            steps; the solver is asked only where these fail. Otherwise every program is the solver's.
        uncorrected: (n,) the solver's own answer to the last program that it was given, before the active set was
            corrected; None where it has none.
    """

    name: str
    hot_start: bool = False
    uncorrected: Array | None = None

    def __init__(self) -> None:
        self._programs: dict[str, int] = {}

    def solve(self, program: QuadraticProgram) -> QPSolution:
        """Minimise without a known active set: never NaN, inside the box; `exact` False for an approximation."""
        if not program.is_computable:
            stay = np.clip(np.zeros(program.size), program.lower, program.upper)
            return QPSolution(np.where(np.isfinite(stay), stay, 0.0), violated_set(program), False, 0, NOT_EXACT)
        answer = last_resort(program, np.zeros(program.size), 0) if self.hot_start else None
        return answer if answer is not None and answer.exact else self.solve_cold(program)

    def count(self, by: str) -> str:
        """Count one program by what closed it, and return that."""
        self._programs[by] = self._programs.get(by, 0) + 1
        return by

    def counted(self) -> dict[str, int]:
        """How many programs each closed since this was last asked."""
        programs, self._programs = self._programs, {}
        return programs

    @abstractmethod
    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise by the solver, from the solver's own last answer where it takes one."""


class WorkingSet:
    """Solves one program after the other, each from the active set of the one before.

    Rows come and go with the contacts; they are recognised by their keys.

    Attributes:
        held: (2, n) lower and upper bounds that held the last answer; None where none is known.
        pushing: keys of the elastic rows that pushed in it, in ascending order.
    """

    def __init__(self, solver: QPSolver) -> None:
        self.solver, self._kernel = solver, compiled_kernel()
        self._room: Room | None = None
        self.held: Mask | None = None
        self.reset()

    def solve(self, program: QuadraticProgram, key: Indices) -> QPSolution:
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

    def _corrected(self, program: QuadraticProgram, key: Indices) -> QPSolution | None:
        """The answer by the active set of the program before, corrected; None where that does not settle."""
        x: Array = np.empty(program.size)
        lower, upper = np.zeros((2, program.size), dtype=bool) if self.held is None else self.held.copy()
        active = ActiveSet(lower, upper, np.empty(len(key), dtype=bool))
        program.check_shapes(active)
        rounds = self._kernel.solve(program, key, self.pushing, active, CORRECTIONS, self.room(program), x, 0)
        return None if rounds < 0 else QPSolution(x, active, True, 0, ACTIVE_SET)

    def room(self, program: QuadraticProgram) -> Room:
        """Room of the compiled loops for a program, kept from one to the next."""
        size = work_size(program.size, len(program.target), len(program.least))
        room = self._room
        if room is None or size > len(room.work) or len(program.least) > len(room.chosen):
            room = self._room = room_for(program, 2)
        return room


class Scaling(NamedTuple):
    """How solvers get a program."""

    x: float = 100.0  # what it is multiplied by, so that its entries are as large as the residuals
    heaviest: float = 1e5  # scale of a row at most, squared; larger = heavy rows closer, light ones later


SCALING = Scaling()


class SplitForm(NamedTuple):
    """Objective and rows over z of size n + m + k."""

    diagonal: Array  # (n + m + k,) diagonal Hessian
    linear: Array  # (n + m + k,)
    matrix: Array  # (m + k, n + m + k) rows [T -I 0; C 0 I]
    least: Array  # (m + k,) what the first m rows are, and the others are at least
    box: Array  # (2, n) bounds of x; r and s have none


def scaled_split(program: QuadraticProgram) -> SplitForm:
    """The scaled split form of a program."""
    soft, scale = len(program.target), SCALING.x
    weight = np.concatenate([program.weight, program.elastic_weight])
    root, size = np.sqrt(np.minimum(weight, SCALING.heaviest)), len(weight)
    matrix = np.zeros((size, program.size + size))
    matrix[:, : program.size] = np.vstack([program.rows, program.elastic]) * (root / scale)[:, None]
    matrix[:, program.size :] = np.diag(np.where(np.arange(size) < soft, -root, root) / np.sqrt(weight))
    diagonal = np.concatenate([program.diagonal / scale**2, np.ones(size)])
    linear = np.concatenate([program.linear / scale, np.zeros(size)])
    least = root * np.concatenate([program.target, program.least])
    return SplitForm(diagonal, linear, matrix, least, scale * np.array([program.lower, program.upper]))


def read_active(box: Array, push: Array) -> ActiveSet:
    """The active set of multipliers `box` (n,), positive at an upper bound, and `push` (k,) of the elastic rows."""
    return ActiveSet(box < -1e-9, box > 1e-9, push > 1e-9)
