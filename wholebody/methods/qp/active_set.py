"""From a guess to the exact answer of a quadratic program: by correcting active sets, else by semismooth Newton steps.

docs/theory/qp_programs.md has the equations (Hintermueller, Ito and Kunisch 2002).
"""

from __future__ import annotations

from functools import lru_cache
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array, with_values
from wholebody.base.compiled import with_loops
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram, Room, work_size
from wholebody.methods.qp.settings import CORRECTIONS, DESCENT, Corrections

SEMISMOOTH = "semismooth newton"
"""What `QPSolution.by` says of answers that `last_resort` found."""

NOT_EXACT = "not exact"
"""What it says of programs that nothing closed: the answer is the best that was found."""


def violated_set(program: QuadraticProgram) -> ActiveSet:
    """Active set to begin from where nothing is known: no bounds, and the elastic rows that x = 0 does not meet."""
    free = np.zeros(program.size, dtype=bool)
    return ActiveSet(free, free.copy(), program.least > 0.0)


def _corrected(
    program: QuadraticProgram, guess: ActiveSet, corrections: int, room: Room
) -> tuple[bool, Array, ActiveSet]:
    """Correct a guessed active set, with all elastic rows: whether it is right then, the minimiser (n,), the set."""
    program.check_shapes(guess)
    x, active = np.empty(program.size), ActiveSet(guess.lower.copy(), guess.upper.copy(), guess.elastic.copy())
    key, known = np.arange(len(guess.elastic)), guess.elastic.nonzero()[0]
    rounds = compiled_kernel().solve(program.packed(), key, known, active, _of_all_rows(corrections), room, x, 0)
    return rounds >= 0, x, active


@lru_cache(maxsize=8)
def _of_all_rows(corrections: int) -> Corrections:
    return with_values(CORRECTIONS, rounds=0, most=corrections)


def solve_from(program: QuadraticProgram, guess: ActiveSet, corrections: int) -> QPSolution | None:
    """Exact answer by a bounded number of corrections of a guessed active set; None if it does not settle."""
    settled, x, active = _corrected(program, guess, corrections, room_for(program))
    return QPSolution(x, active, True, 0) if settled else None


def _without_gradient(program: QuadraticProgram, active: ActiveSet, target: Array, room: Room) -> Array | None:
    """Minimiser (n,), clipped to the box, with g = 0, an active set and targets (m,); None where not finite."""
    without = with_values(program, linear=np.zeros(program.size), target=target)
    settled, x, _ = _corrected(without, active, 1, room)  # x is of the set before its first correction
    if settled:
        return x
    finite = isfinite(x.dot(x)) or np.isfinite(x).all()  # the first takes a fifth of the time
    return np.minimum(np.maximum(x, program.lower), program.upper) if finite else None


class Parts(NamedTuple):
    """A step in two parts, (n,) each."""

    normal: Array
    tangential: Array


def parts_of(program: QuadraticProgram, answer: QPSolution, shift: Array, room: Room) -> Parts | None:
    """The normal and tangential part of the answer of a program; None where its face has no normal part.

    A bound that was some way off and now holds belongs to the measures, so to the tangential part, unless the normal
    one comes to it too. `shift` (s,), of the method of multipliers, makes up for g in the first errors.
    """
    target = program.target.copy()
    target[: len(shift)] += shift
    active, normal = answer.active, None
    lower = active.lower & (program.lower >= -DESCENT.room)
    upper = active.upper & (program.upper <= DESCENT.room)
    left = (active.lower & ~lower) | (active.upper & ~upper)
    if left.any():
        normal = _without_gradient(program, with_values(active, lower=lower, upper=upper), target, room)
        if normal is not None and not ((program.lower < normal) & (normal < program.upper))[left].all():
            normal = None
    if normal is None:
        normal = _without_gradient(program, active, target, room)
    return None if normal is None else Parts(normal, answer.x - normal)


def minimise(program: QuadraticProgram, start: Array, iterations: int) -> tuple[Array, ActiveSet, int]:
    """Lower the objective from `start` by semismooth Newton steps: x (n,) in the box, active set, iterations used."""
    x = np.array(start, dtype=float)
    active = ActiveSet(*(np.zeros(size, dtype=bool) for size in (program.size, program.size, len(program.least))))
    program.check_shapes(active)
    none, room = np.zeros(0, dtype=np.intp), room_for(program)
    used = compiled_kernel().solve(program.packed(), none, none, active, CORRECTIONS, room, x, iterations)
    return x, active, used


def last_resort(program: QuadraticProgram, x: Array, iterations: int) -> QPSolution:
    """Exact answer by semismooth Newton steps where an approximate one x (n,), of `iterations`, does not lead to it."""
    x, active, used = minimise(program, x, 300)  # the hardest programs seen took 63
    solution = solve_from(program, active, CORRECTIONS.most)
    if solution is not None:
        return with_values(solution, iterations=iterations + used, by=SEMISMOOTH)
    exact = program.optimality(x) <= 1e-10
    return QPSolution(x, active, exact, iterations + used, SEMISMOOTH if exact else NOT_EXACT)


def room_for(program: QuadraticProgram, times: int = 1) -> Room:
    """Room of the compiled loops for a program, and for larger ones where it is to be so many times as much."""
    k = len(program.least)
    work = work_size(program.size, len(program.target), k)
    return Room(np.empty(times * work), np.empty(2 * times * k, dtype=np.intp), np.empty(times * k, dtype=bool))


@with_loops("wholebody.methods.qp.active_set_kernel")
def compiled_kernel(active_set_kernel: Any) -> None:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    program, active = smallest()
    index = np.zeros(0, dtype=np.intp)
    active_set_kernel.solve(program, index, index, active, CORRECTIONS, room_for(program), np.zeros(1), 0)


def smallest() -> tuple[QuadraticProgram, ActiveSet]:
    """A program of one variable without rows, with which loops are compiled."""
    none, one, rows = np.zeros(0), np.ones(1), np.zeros((0, 1))
    masks = (np.zeros(size, dtype=bool) for size in (1, 1, 0))
    return QuadraticProgram(one, one, rows, none, none, rows, none, none, -one, one), ActiveSet(*masks)
