"""OSQP with a workspace that lives on: set up once for a sparsity, warm from step to step, finished exactly."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wholebody.arrays import Array
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.solvers.fallback import finish, last_resort

HEAVIEST = 1e5  # weights are cut to this: OSQP needs many times the iterations for larger ones
SLOTS = 8  # elastic rows come in multiples of this, so that the sparsity seldom changes; more slots = slower iterations
SCALE = 100.0  # x is in hundredths of a radian inside OSQP: its absolute tolerance then means 1e-7 rad
ROUNDS = ((50, 1e-3), (100, 1e-5))  # iterations and tolerance, tried until `finish` succeeds
FAR = 1e30  # OSQP's infinity


class OSQPSolver(QPSolver):
    """OSQP (Stellato et al. 2020) on the split form.

    OSQP iterates until an active set read off its answer settles. It is a first-order method, and where many bounds and
    contacts bind at once thousands of its iterations may not tell the set; such programs, a few in a hundred, are
    finished by semismooth Newton steps.
    """

    name = "osqp"

    def __init__(self, hot_start: bool = True) -> None:
        """Begin without a workspace."""
        super().__init__(hot_start)
        self._workspace: _Workspace | None = None

    def load(self) -> None:
        """Import OSQP."""
        import osqp  # noqa: F401

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise; see `QPSolver.solve_cold`."""
        if self._workspace is None or not self._workspace.fits(program):
            self._workspace = _Workspace(program, self._workspace)
        self._workspace.load(program)
        iterations = 0
        for limit, tolerance in ROUNDS:
            x, used = self._workspace.run(limit, tolerance)
            iterations += used
            solution = finish(program, x, iterations, self.name)
            if solution is not None:
                return solution
        return last_resort(program, x, iterations)


class _Workspace:
    """One OSQP workspace: a fixed pattern of soft rows and a fixed number of dense slots for elastic rows."""

    def __init__(self, program: QuadraticProgram, before: _Workspace | None) -> None:
        import osqp
        from scipy import sparse

        n, m = program.size, len(program.target)
        self.n, self.m = n, m
        self.slots = SLOTS * -(-max(len(program.least), 1) // SLOTS)
        self.pattern: NDArray[np.bool_] = program.rows != 0.0
        if before is not None and before.pattern.shape == self.pattern.shape:
            self.pattern = self.pattern | before.pattern
            self.slots = max(self.slots, before.slots)
        k = self.slots
        size = n + m + k
        block = np.zeros((n + m + k, size), dtype=bool)
        block[:n, :n] = np.eye(n, dtype=bool)
        block[n : n + m, :n] = self.pattern
        block[n + m :, :n] = True
        block[n:, n:] = np.eye(m + k, dtype=bool)
        column, self._row = np.nonzero(block.T)
        self._column = column
        indptr = np.concatenate([[0], np.cumsum(block.sum(axis=0))])
        # placeholder values that keep OSQP from dropping entries; load() overwrites all of them
        matrix = sparse.csc_matrix((np.ones(len(column)), self._row, indptr), shape=(n + m + k, size))
        objective = sparse.csc_matrix(sparse.diags(np.ones(size)))
        self._values = np.zeros((n + m + k, size))
        self._values[:n, :n] = np.eye(n)
        self._values[n : n + m, n : n + m] = -np.eye(m)
        self._values[n + m :, n + m :] = np.eye(k)
        bound = np.zeros(n + m + k)
        self._solver: Any = osqp.OSQP()
        self._solver.setup(
            objective, np.zeros(size), matrix, bound, bound, verbose=False, scaling=0, rho=0.1, eps_rel=0.0,
            eps_abs=1e-3, adaptive_rho=1, check_termination=10, max_iter=50, warm_starting=True, polishing=False,
        )  # fmt: skip

    def fits(self, program: QuadraticProgram) -> bool:
        """Whether the program has this workspace's size and pattern."""
        return (
            program.size == self.n
            and len(program.target) == self.m
            and len(program.least) <= self.slots
            and not (program.rows[~self.pattern] != 0.0).any()
        )

    def load(self, program: QuadraticProgram) -> None:
        """Put the program's numbers in; x is scaled, and so are r and s by the root of their weights."""
        n, m, k = self.n, self.m, len(program.least)
        root = np.sqrt(np.minimum(program.weight, HEAVIEST))
        elastic_root = np.sqrt(np.minimum(program.elastic_weight, HEAVIEST))
        values = self._values
        values[n : n + m, :n] = program.rows * (root / SCALE)[:, None]
        values[n + m :, :n] = 0.0
        values[n + m : n + m + k, :n] = program.elastic * (elastic_root / SCALE)[:, None]
        lower = np.full(n + m + self.slots, -FAR)
        upper = np.full(n + m + self.slots, FAR)
        lower[:n], upper[:n] = program.lower * SCALE, program.upper * SCALE
        lower[n : n + m] = upper[n : n + m] = program.target * root
        lower[n + m : n + m + k] = program.least * elastic_root
        self._solver.update(
            q=np.concatenate([program.linear / SCALE, np.zeros(m + self.slots)]),
            l=lower,
            u=upper,
            Px=np.concatenate([program.diagonal / SCALE**2, np.ones(m + self.slots)]),
            Ax=values[self._row, self._column],
        )

    def run(self, limit: int, tolerance: float) -> tuple[Array, int]:
        """TraceEntry on from where the last run ended; x and the iterations used."""
        self._solver.update_settings(max_iter=limit, eps_abs=tolerance)
        result = self._solver.solve(raise_error=False)
        x = np.asarray(result.x[: self.n]) / SCALE
        return np.where(np.isfinite(x), x, 0.0), int(result.info.iter)
