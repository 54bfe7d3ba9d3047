"""From an approximate answer to the exact one: by an active set near it, else by semismooth Newton steps."""

from __future__ import annotations

from wholebody.base.arrays import Array
from wholebody.base.records import with_values
from wholebody.methods.qp.active_set import guess_active_set, solve_from
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.semismooth_newton import minimise

SEMISMOOTH = "semismooth newton"
"""What `QPSolution.by` says of answers that `last_resort` found."""

NOT_EXACT = "not exact"
"""What it says of programs that nothing closed: the answer is the best that was found."""

EXACT = 1e-10
"""Optimality up to which an answer counts as exact although no active set settles at it [rad, m]."""

GUESS_TOLERANCE = 1e-4
"""How near to its bound an approximate answer counts as on it [rad, m]."""

CORRECTIONS = 12
"""Corrections of a guessed active set before the solver is asked for a better answer."""

LAST_ITERATIONS = 300
"""Semismooth Newton steps; the hardest programs seen took 63."""


def finish(program: QuadraticProgram, x: Array, iterations: int, by: str) -> QPSolution | None:
    """Exact answer from an approximate one, or None when no active set near it settles.

    Args:
        program: what is solved.
        x: (n,) approximate answer.
        iterations: what it took.
        by: name of the solver it came from.
    """
    solution = solve_from(program, guess_active_set(program, x, GUESS_TOLERANCE), CORRECTIONS)
    return None if solution is None else with_values(solution, iterations=iterations, by=by)


def last_resort(program: QuadraticProgram, x: Array, iterations: int) -> QPSolution:
    """Exact answer by semismooth Newton steps where an approximate one x, shape (n,), does not lead to it.

    Args:
        program: what is solved.
        x: (n,) where to begin.
        iterations: what it took so far.
    """
    x, active, used = minimise(program, x, LAST_ITERATIONS)
    solution = solve_from(program, active, CORRECTIONS)
    if solution is not None:
        return with_values(solution, iterations=iterations + used, by=SEMISMOOTH)
    exact = program.optimality(x) <= EXACT
    return QPSolution(x, active, exact, iterations + used, SEMISMOOTH if exact else NOT_EXACT)
