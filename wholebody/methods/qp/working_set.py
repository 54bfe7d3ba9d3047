"""Programs with hundreds of elastic rows, of which a handful matters: solve with those, look, add what was missed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import QPSolver

NEAR = 0.03  # m: rows lacking less than this at x = 0 are in from the beginning
ROUNDS = 8  # most times that rows are added before all of them are


def solve_by_rows(solver: QPSolver, program: QuadraticProgram, guess: ActiveSet | None) -> QPSolution:
    """Solve a program by growing its set of elastic rows until no other row is violated.

    The answer is the full program's: rows left out are satisfied, and would not push.

    Args:
        solver: solves the smaller programs.
        program: the full program.
        guess: active set of a program like this one; its elastic part is used where it has as many rows.
    """
    count = len(program.least)
    known = guess is not None and len(guess.elastic) == count
    chosen = program.least > -NEAR
    if guess is not None and known:
        chosen |= guess.elastic
    for attempt in range(ROUNDS + 1):
        if attempt == ROUNDS:
            chosen[:] = True
        smaller = replace(
            program,
            elastic=program.elastic[chosen],
            least=program.least[chosen],
            elastic_weight=program.elastic_weight[chosen],
        )
        hint = None
        if guess is not None:
            pushing = guess.elastic[chosen] if known else smaller.least > 0.0
            hint = ActiveSet(guess.lower, guess.upper, pushing)
        answer = solver.solve(smaller, hint)
        missed = (program.elastic @ answer.x < program.least - 1e-9) & ~chosen
        active = np.zeros(count, dtype=bool)
        active[chosen] = answer.active.elastic
        answer = answer._replace(active=ActiveSet(answer.active.lower, answer.active.upper, active))
        if not missed.any():
            return answer
        chosen |= missed
        guess, known = answer.active, True
    return answer
