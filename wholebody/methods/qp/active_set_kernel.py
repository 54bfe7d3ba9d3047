"""The correcting of an active set, as compiled loops: see `active_set`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.methods.qp.dense_kernel import dot
from wholebody.methods.qp.face_kernel import Face, face, minimise_on_face, stack_elastic, stack_soft
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram, Room
from wholebody.methods.qp.settings import Corrections


@compiled(error_model="numpy", forceinline=True)
def grow(
    program: QuadraticProgram,
    key: Indices,
    known: Indices,
    active: ActiveSet,
    limits: Corrections,
    room: Room,
    x: Array,
) -> int:
    """Solve a program from the active set of the one before, with the elastic rows that matter; see `WorkingSet`.

    `key` (k,) names its elastic rows, `known` those that pushed before, ascending; `active` has the bounds of then and
    becomes the answer's, x (n,) the minimiser. How often rows were added, or -1 where a round did not settle.
    """
    elastic, least = program.elastic, program.least
    pushing = active.elastic
    k, chosen, places = len(least), room.chosen, room.places
    for j in range(k):
        pushing[j] = _contains(known, key[j])
        chosen[j] = least[j] > limits.near or pushing[j]
    for attempt in range(limits.rounds + 1):
        count = 0
        for j in range(k):
            if chosen[j] or attempt == limits.rounds:
                chosen[j] = True
                places[count] = j
                count += 1
        if not primal_dual_active_set(program, places[:count], active, limits.most, limits, room, x):
            return -1
        missed = False
        for j in range(k):
            if not chosen[j] and dot(elastic[j], x) < least[j] - 1e-9:
                chosen[j] = missed = True
        if not missed:
            return attempt
    return limits.rounds


@compiled(inner=True)
def _contains(sorted_keys: Indices, key: int) -> bool:
    """Whether keys (k,) in ascending order contain one; numba's searchsorted would load scipy.linalg at every start."""
    low, high = 0, len(sorted_keys)
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if sorted_keys[middle] < key else (low, middle)
    return low < len(sorted_keys) and sorted_keys[low] == key


@compiled(error_model="numpy", forceinline=True)
def primal_dual_active_set(
    program: QuadraticProgram, places: Indices, active: ActiveSet, most: int, limits: Corrections, room: Room, x: Array
) -> bool:
    """Correct an active set for the rows `places` (c,), in place; x (n,) becomes the minimiser. Whether it is right."""
    # The first corrections change all wrong entries, later ones only the worst.
    elastic, lower, upper = program.elastic, program.lower, program.upper
    pushing = active.elastic
    n, m, k = len(program.diagonal), len(program.target), len(places)
    own, pushes = face(room.work, n, m, k), room.places[len(room.places) // 2 :]
    reached = own.reached
    stack_soft(program, own)
    for attempt in range(most):
        size = m
        for c in range(k):
            if pushing[places[c]]:
                pushes[size - m] = places[c]
                size += 1
        stack_elastic(program, pushes[: size - m], own)
        if not minimise_on_face(program, active, own, size, limits.tolerance, x):
            return False
        for c in range(k):
            reached[c] = dot(elastic[places[c]], x)
        if not _correct(program, places, active, own, limits.tolerance, x, attempt < limits.at_once):
            for i in range(n):
                x[i] = min(max(x[i], lower[i]), upper[i])
            return True
    return False


@compiled(error_model="numpy")
def minimise_with(program: QuadraticProgram, active: ActiveSet, tolerance: float, work: Array, x: Array) -> bool:
    """Minimiser x (n,) of a program with its active set fixed, clipped to the bounds; whether it is finite."""
    soft = len(program.target)
    own = face(work, len(x), soft, len(program.least))
    stack_soft(program, own)
    pushes = active.elastic.nonzero()[0]
    stack_elastic(program, pushes, own)
    finite = minimise_on_face(program, active, own, soft + len(pushes), tolerance, x)
    for i in range(len(x)):
        x[i] = min(max(x[i], program.lower[i]), program.upper[i])
    return finite


@compiled(inner=True, error_model="numpy", forceinline=True)
def _correct(
    program: QuadraticProgram, places: Indices, active: ActiveSet, own: Face, tolerance: float, x: Array, every: bool
) -> bool:
    """Put right every wrong entry of an active set, or the one that is most wrong in units of x; whether any was."""
    diagonal, target, elastic = program.diagonal, program.target, program.elastic
    least, lower, upper = program.least, program.lower, program.upper
    at_lower, at_upper, pushing = active.lower, active.upper, active.elastic
    multiplier, gradient, reached = own.multiplier, own.gradient, own.reached
    worst, mask, place, found = -np.inf, at_lower, 0, False
    for i in range(len(x)):
        low = gradient[i] >= 0.0 if at_lower[i] else x[i] < lower[i] - tolerance
        high = gradient[i] <= 0.0 if at_upper[i] else x[i] > upper[i] + tolerance
        if low == at_lower[i] and high == at_upper[i]:
            continue
        found = True
        if every:
            at_lower[i], at_upper[i] = low, high
            continue
        pull = abs(gradient[i]) / diagonal[i]
        wrong = pull if at_lower[i] else lower[i] - x[i]
        if low != at_lower[i] and wrong > worst:
            worst, mask, place = wrong, at_lower, i
        wrong = pull if at_upper[i] else x[i] - upper[i]
        if high != at_upper[i] and wrong > worst:
            worst, mask, place = wrong, at_upper, i
    following = len(target)
    for c in range(len(places)):
        j = places[c]
        push, wrong = reached[c] < least[j] - tolerance, least[j] - reached[c]
        if pushing[j]:
            push, wrong = multiplier[following] <= 0.0, multiplier[following]
            following += 1
        if push == pushing[j]:
            continue
        found = True
        if every:
            pushing[j] = push
            continue
        if pushing[j]:
            norm = 0.0
            for i in range(len(x)):
                norm += elastic[j, i] * elastic[j, i] / diagonal[i]
            wrong *= norm
        if wrong > worst:
            worst, mask, place = wrong, pushing, j
    if found and not every:
        mask[place] = not mask[place]
    return found
