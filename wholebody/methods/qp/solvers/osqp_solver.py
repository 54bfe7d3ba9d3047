"""OSQP with a workspace that lives on: set up once for a sparsity, warm from program to program."""

from __future__ import annotations

import sys
from functools import lru_cache
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Mask, with_values
from wholebody.methods.qp.active_set import last_resort, solve_from, violated_set
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.settings import CORRECTIONS
from wholebody.methods.qp.solvers.base import ACTIVE_SET, SCALING, QPSolver, read_active, scaled_split

ROUNDS = (25, 50, 100, 200, 400)  # iterations, until an active set read off the multipliers settles
SLOTS = 8  # elastic rows come in multiples of this, so that sizes seldom change; more slots = slower iterations
PATIENCE = 120  # corrections of a set that nothing is known of, before OSQP is asked
EXTENSION = "osqp.ext_builtin"


class OSQPSolver(QPSolver):
    """OSQP (Stellato et al. 2020) on the split form.

    OSQP is a first-order method: its answer is near, and its multipliers tell exactly which bounds and rows are active.
    It iterates until the active set read off them, corrected, settles.
    """

    name = "osqp"

    def __init__(self, hot_start: bool = True) -> None:
        super().__init__(hot_start)
        self._workspace: Workspace | None = None

    def load(self) -> None:
        """Import OSQP."""
        extension()

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise; see `QPSolver.solve_cold`."""
        workspace = self.workspace(program)
        iterations = 0
        for limit in ROUNDS:
            iterations += workspace.run(limit)
            near = self.uncorrected = workspace.x()
            solution = solve_from(program, workspace.active(), CORRECTIONS.most)
            if solution is not None:
                return with_values(solution, iterations=iterations, by=OSQPSolver.name)
        return last_resort(program, near, iterations)

    def workspace(self, program: QuadraticProgram) -> Workspace:
        """The workspace with a program in it, set up anew where its pattern does not fit."""
        if self._workspace is None or not self._workspace.fits(program):
            self._workspace = Workspace(program, self._workspace)
        self._workspace.load(program)
        return self._workspace


class ActiveSetSolver(OSQPSolver):
    """The primal-dual active set method throughout; OSQP where the sets do not settle."""

    name = "active_set"

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise from no bounds and the rows that x = 0 does not meet; see `QPSolver.solve_cold`."""
        solution = solve_from(program, violated_set(program), PATIENCE)
        return super().solve_cold(program) if solution is None else with_values(solution, by=ACTIVE_SET)


class Workspace:
    """One OSQP workspace: a fixed pattern of soft rows and a fixed number of dense slots for elastic rows.

    The soft rows are scaled by the roots of their weights as far as `Scaling.heaviest`; the rest of a weight is in the
    coefficient of the residual. The program is the true one, and its heaviest rows are nearly hard.
    """

    def __init__(self, program: QuadraticProgram, before: Workspace | None) -> None:
        """Set up for programs of one size; the pattern includes that of the workspace before, of the same size."""
        n, m = program.size, len(program.target)
        self.n, self.m, self.k = n, m, 0
        self.slots = SLOTS * -(-max(len(program.least), 1) // SLOTS)
        self.pattern: NDArray[np.bool_] = program.rows != 0.0
        if before is not None and before.pattern.shape == self.pattern.shape:
            self.pattern = self.pattern | before.pattern
            self.slots = max(self.slots, before.slots)
        size = n + m + self.slots
        objective, matrix, self._entries = _structure(n, m, self.slots, self.pattern.tobytes())
        self.hessian, self.gradient, self.values = np.ones(size), np.zeros(size), np.ones(matrix.nnz)
        self.low, self.high = np.full(size, SCALING.inactive), np.full(size, SCALING.infinite)
        self.low[n : n + m] = self.high[n : n + m] = 0.0  # OSQP factorises anew where other rows become equalities
        osqp = extension()
        settings = self._settings = osqp.OSQPSettings()
        osqp.osqp_set_default_settings(settings)
        settings.verbose, settings.scaling, settings.polishing = False, 0, False
        # OSQP's step length at the beginning; it adapts
        settings.warm_starting, settings.rho, settings.adaptive_rho = True, 0.1, 1
        settings.check_termination, settings.max_iter = 0, ROUNDS[0]
        self._solver: Any = osqp.OSQPSolver(
            osqp.CSC(objective), self.gradient, osqp.CSC(matrix), self.low, self.high, size, size, settings
        )

    def fits(self, program: QuadraticProgram) -> bool:
        """Whether the program has this workspace's size and pattern."""
        return (
            program.size == self.n
            and len(program.target) == self.m
            and len(program.least) <= self.slots
            and not program.rows[~self.pattern].any()
        )

    def load(self, program: QuadraticProgram) -> None:
        """Put the program's numbers in."""
        n, m, self.k = self.n, self.m, len(program.least)
        spare = self.slots - self.k
        elastic = np.vstack([program.elastic, np.zeros((spare, n))])
        least = np.append(program.least, np.full(spare, SCALING.inactive))
        weight = np.append(program.elastic_weight, np.ones(spare))
        form = scaled_split(with_values(program, elastic=elastic, least=least, elastic_weight=weight))
        self.hessian, self.gradient = form.diagonal, form.linear
        self.values = np.vstack([np.eye(n, len(form.linear)), form.matrix]).T[self._entries]
        self.low = np.concatenate([form.box[0], form.least])
        self.high = np.concatenate([form.box[1], form.least[:m], np.full(self.slots, SCALING.infinite)])
        self._solver.update_data_vec(q=self.gradient, l=self.low, u=self.high)
        self._solver.update_data_mat(P_x=self.hessian, P_i=None, A_x=self.values, A_i=None)

    def run(self, limit: int) -> int:
        """Iterate on from where the last run ended; how many iterations."""
        if self._settings.max_iter != limit:
            self._settings.max_iter = limit
            self._solver.update_settings(self._settings)
        self._solver.solve()
        return int(self._solver.info.iter)

    def x(self) -> Array:
        """(n,) where OSQP is."""
        x = np.asarray(self._solver.solution.x)[: self.n] / SCALING.x
        return np.where(np.isfinite(x), x, 0.0)

    def active(self) -> ActiveSet:
        """The active set read off the multipliers, which are exactly zero for what is not active."""
        y, first = self._solver.solution.y, self.n + self.m
        return read_active(y[: self.n], -y[first : first + self.k])


@lru_cache(maxsize=64)
def _structure(n: int, m: int, slots: int, pattern: bytes) -> tuple[Any, Any, Mask]:
    """P and A with ones for entries, for a pattern (m, n) of the soft rows, and where A' has entries."""
    from scipy import sparse

    soft = np.frombuffer(pattern, dtype=bool).reshape(m, n)
    size = n + m + slots
    block = np.zeros((size, size), dtype=bool)
    block[n : n + m, :n] = soft
    block[n + m :, :n] = True
    block.flat[:: size + 1] = True
    row = np.nonzero(block.T)[1]
    indptr = np.concatenate([[0], np.cumsum(block.sum(axis=0))])
    matrix = sparse.csc_matrix((np.ones(len(row)), row, indptr), shape=(size, size))
    objective = sparse.csc_matrix((np.ones(size), np.arange(size), np.arange(size + 1)), shape=(size, size))
    return objective, matrix, block.T


@lru_cache(maxsize=1)
def extension() -> Any:
    """OSQP's compiled module, without the package, which loads jinja2 and asyncio; its class is five times as slow."""
    package = find_spec("osqp")
    found = None if package is None else PathFinder.find_spec(EXTENSION, package.submodule_search_locations)
    if EXTENSION in sys.modules or found is None or found.loader is None:
        return import_module(EXTENSION)
    module = sys.modules[EXTENSION] = module_from_spec(found)
    found.loader.exec_module(module)
    return module
