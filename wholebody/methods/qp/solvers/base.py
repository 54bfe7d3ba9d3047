"""What a QP solver has to do, and the list of those there are."""

from __future__ import annotations

from abc import ABC, abstractmethod
from importlib.util import find_spec

import numpy as np

from wholebody.checks import shown
from wholebody.errors import InputError, MissingPackageError, UnknownNameError
from wholebody.methods.qp.active_set import compiled_kernel, guess_active_set, lacking, solve_from
from wholebody.methods.qp.quadratic_program import ActiveSet, Array, QPSolution, QuadraticProgram
from wholebody.methods.qp.semismooth_newton import minimise

SEMISMOOTH = "semismooth newton"
"""What `QPSolution.by` says of answers that `last_resort` found."""

EXACT = 1e-10
"""Optimality up to which an answer counts as exact although no active set settles at it [rad, m]."""

GUESS_TOLERANCE = 1e-4
"""How near to its bound an approximate answer counts as on it [rad, m]."""

WARM_CORRECTIONS = 120
"""Corrections of the last active set before the solver is asked."""

CORRECTIONS = 12
"""Corrections of a guessed active set before the solver is asked for a better answer."""

LARGEST = 400
"""Rows of a program above which no solver is asked: setting one up takes longer than the answer by other means."""

LAST_ITERATIONS = 300
"""Semismooth Newton steps; the hardest programs seen took 63."""


class QPSolver(ABC):
    """Solves programs one after the other; keeps what helps the next one."""

    name: str

    def solve(self, program: QuadraticProgram, guess: ActiveSet | None) -> QPSolution:
        """Minimise: from the last active set, which most steps of a drag do not change, else by the solver.

        Args:
            program: what to solve.
            guess: active set of a program like this one; None for what lacks at x = 0, from which nineteen in twenty
                first programs settle at a tenth of what setting up a solver costs.

        Returns:
            The answer; `exact` is False where only an approximation was found. Never NaN, always inside the box.
        """
        solution = solve_from(program, lacking(program) if guess is None else guess, WARM_CORRECTIONS)
        if solution is not None:
            return solution._replace(by="first active set" if guess is None else "last active set")
        if len(program.target) + len(program.least) > LARGEST:
            return last_resort(program, np.zeros(program.size), 0, self.name)
        return self.solve_cold(program)

    def load(self) -> None:
        """Import what `solve_cold` needs, for those who cannot wait for it later: most programs are closed without."""
        return

    @abstractmethod
    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise without a guess; what `solve` falls back on."""


def finish(program: QuadraticProgram, x: Array, iterations: int, by: str) -> QPSolution | None:
    """Exact answer from an approximate one, or None when no active set near it settles.

    Args:
        program: what is solved.
        x: (n,) approximate answer.
        iterations: what it took.
        by: name of the solver it came from.
    """
    solution = solve_from(program, guess_active_set(program, x, GUESS_TOLERANCE), CORRECTIONS)
    return None if solution is None else solution._replace(iterations=iterations, by=by)


def last_resort(program: QuadraticProgram, x: Array, iterations: int, by: str) -> QPSolution:
    """Exact answer by semismooth Newton steps where an approximate one x, shape (n,), does not lead to it.

    Args:
        program: what is solved.
        x: (n,) where to begin.
        iterations: what it took so far.
        by: name of the solver that was asked.
    """
    x, active, used = minimise(program, x, LAST_ITERATIONS)
    solution = solve_from(program, active, CORRECTIONS)
    if solution is not None:
        return solution._replace(iterations=iterations + used, by=SEMISMOOTH)
    exact = program.optimality(x) <= EXACT
    return QPSolution(x, active, exact, iterations + used, SEMISMOOTH if exact else by)


def solver_names() -> tuple[str, ...]:
    """Names that `make_solver` takes on this machine: "osqp", "daqp" and what qpsolvers finds installed."""
    names = ["osqp"]
    if find_spec("daqp") is not None:
        names.append("daqp")
    if find_spec("qpsolvers") is not None:
        from qpsolvers import available_solvers

        names += sorted(set(available_solvers) - set(names))
    return tuple(names)


def make_solver(name: str) -> QPSolver:
    """A QP solver by name.

    Raises:
        InputError: not a text.
        UnknownNameError: no installed solver has this name.
        MissingPackageError: it exists but its package is not installed.
    """
    compiled_kernel()  # not in the middle of a solve
    if not isinstance(name, str):
        raise InputError(f"solver is {shown(name)}; give the name of a QP solver, such as 'osqp'")
    if name == "osqp":
        from wholebody.methods.qp.solvers.osqp_solver import OSQPSolver

        return OSQPSolver()
    if name == "daqp":
        if find_spec("daqp") is None:
            raise MissingPackageError("the QP solver daqp is not installed; install it with: pip install daqp")
        from wholebody.methods.qp.solvers.daqp_solver import DAQPSolver

        return DAQPSolver()
    if name not in solver_names():
        raise UnknownNameError("QP solver", name, solver_names())
    from wholebody.methods.qp.solvers.qpsolvers_solver import QpsolversSolver

    return QpsolversSolver(name)
