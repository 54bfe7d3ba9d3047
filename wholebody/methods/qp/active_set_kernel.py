"""The correcting of an active set, as compiled loops: see `active_set`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.methods.qp.dense_kernel import dot
from wholebody.methods.qp.face_kernel import minimise_on_face


@compiled(error_model="numpy")
def solve_growing(
    diagonal: Array,
    linear: Array,
    rows: Array,
    target: Array,
    weight: Array,
    elastic: Array,
    least: Array,
    elastic_weight: Array,
    lower: Array,
    upper: Array,
    key: Indices,
    known: Indices,
    at_lower: Mask,
    at_upper: Mask,
    pushing: Mask,
    chosen: Mask,
    limits: Array,
    work: Array,
    places: Indices,
    x: Array,
) -> int:
    """Solve a program from the active set of the one before, with the elastic rows that matter; see `WorkingSet`.

    The first ten arguments are the program. `key` (k,) names its elastic rows, `known` the rows that pushed in the
    program before, in ascending order. `at_lower` and `at_upper` (n,) are the bounds that held x then; they become
    those that hold it now. `pushing` and `chosen` (k,), `work` (see `work_size`) and `places` (2 k,) are room; x (n,)
    becomes the minimiser. `limits` are the violation below which a row is left out, rounds, corrections, corrections of
    everything at once, and the tolerances of bounds and of rows.

    Returns:
        How often rows were added, or -1 where the active set of a round did not settle.
    """
    k = len(least)
    for j in range(k):
        pushing[j] = _contains(known, key[j])
        chosen[j] = least[j] > -limits[0] or pushing[j]
    rounds = int(limits[1])
    for attempt in range(rounds + 1):
        count = 0
        for j in range(k):
            if chosen[j] or attempt == rounds:
                chosen[j] = True
                places[count] = j
                count += 1
        settled = primal_dual_active_set(
            diagonal, linear, rows, target, weight, elastic, least, elastic_weight, lower, upper, places[:count],
            at_lower, at_upper, pushing, int(limits[2]), int(limits[3]), limits[4], limits[5], work, places[k:], x,
        )  # fmt: skip
        if not settled:
            return -1
        missed = False
        for j in range(k):
            if not chosen[j] and dot(elastic[j], x) < least[j] - 1e-9:
                chosen[j] = missed = True
        if not missed:
            return attempt
    return rounds


@compiled(inner=True)
def _contains(sorted_keys: Indices, key: int) -> bool:
    """Whether keys (k,) in ascending order contain one; numba's searchsorted would load scipy.linalg at every start."""
    low, high = 0, len(sorted_keys)
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if sorted_keys[middle] < key else (low, middle)
    return low < len(sorted_keys) and sorted_keys[low] == key


@compiled()
def work_size(variables: int, soft: int, elastic: int) -> int:
    """Floats that `primal_dual_active_set` needs for a program of so many variables, soft rows and elastic rows."""
    rows = soft + elastic
    return 2 * rows * variables + rows * rows + 3 * rows + elastic + 3 * variables


@compiled(inner=True)
def _views(
    work: Array, n: int, m: int, k: int
) -> tuple[Array, Array, Array, Array, Array, Array, Array, Array, Array, Array]:
    """Parts of `work` (see `work_size`) for n variables, m soft and k elastic rows.

    They are the rows (m + k, n), room of the same size and of (m + k)^2; what rows are to be, their inverse weights and
    multipliers (m + k,); room (k,) and three times (n,).
    """
    most = m + k
    first, second, third = most * n, 2 * most * n, 2 * most * n + most * most
    fourth = third + 3 * most
    last = fourth + k
    return (
        work[:first].reshape((most, n)),
        work[first:second].reshape((most, n)),
        work[second:third],
        work[third:][:most],
        work[third + most :][:most],
        work[third + 2 * most :][:most],
        work[fourth:last],
        work[last:][:n],
        work[last + n :][:n],
        work[last + 2 * n :][:n],
    )


@compiled(error_model="numpy")
def primal_dual_active_set(
    diagonal: Array,
    linear: Array,
    rows: Array,
    target: Array,
    weight: Array,
    elastic: Array,
    least: Array,
    elastic_weight: Array,
    lower: Array,
    upper: Array,
    places: Indices,
    at_lower: Mask,
    at_upper: Mask,
    pushing: Mask,
    corrections: int,
    full_corrections: int,
    bound_tolerance: float,
    row_tolerance: float,
    work: Array,
    active: Indices,
    x: Array,
) -> bool:
    """Correct an active set, in place, until it is right; x (n,) becomes the minimiser.

    The first ten arguments are the program, of which the elastic rows `places` (c,) count. `at_lower` and `at_upper`
    (n,) say which bounds hold x, `pushing` (k,) which elastic rows push. Of at most `corrections` sets the first
    `full_corrections` put right all that is wrong, the others only the worst entry. An x may be out of its bounds by
    `bound_tolerance`, a row violated by `row_tolerance`. `work` (see `work_size`) and `active` (c,) are room.

    Returns:
        Whether it is right: false after so many corrections, and where a set has no finite minimiser.
    """
    n, m, k = len(diagonal), len(target), len(places)
    stacked, scaled, table, right, compliance, multiplier, reached, inverse, gradient, trial = _views(work, n, m, k)
    for r in range(m):
        compliance[r] = 1.0 / weight[r]
        right[r] = target[r]
        for i in range(n):
            stacked[r, i] = rows[r, i]
    for attempt in range(corrections):
        count = 0
        for c in range(k):
            j = places[c]
            if pushing[j]:
                active[count] = c
                for i in range(n):
                    stacked[m + count, i] = elastic[j, i]
                right[m + count] = least[j]
                compliance[m + count] = 1.0 / elastic_weight[j]
                count += 1
        size = m + count
        if not minimise_on_face(
            diagonal, linear, lower, upper, at_lower, at_upper, stacked, right, compliance, size, row_tolerance, scaled,
            table, inverse, trial, multiplier, gradient, x,
        ):  # fmt: skip
            return False
        same = True
        for i in range(n):
            if at_lower[i]:
                same = same and gradient[i] >= 0.0
            elif at_upper[i]:
                same = same and gradient[i] <= 0.0
            else:
                same = same and lower[i] - bound_tolerance <= x[i] <= upper[i] + bound_tolerance
        for c in range(k):
            j = places[c]
            reached[c] = dot(elastic[j], x)
            same = same and (pushing[j] or reached[c] >= least[j] - row_tolerance)
        for a in range(count):
            same = same and multiplier[m + a] <= 0.0
        if same:
            for i in range(n):
                x[i] = min(max(x[i], lower[i]), upper[i])
            return True
        if attempt < full_corrections:
            for i in range(n):
                held_low, held_high = at_lower[i], at_upper[i]
                at_lower[i] = gradient[i] >= 0.0 if held_low else x[i] < lower[i] - bound_tolerance
                at_upper[i] = gradient[i] <= 0.0 if held_high else x[i] > upper[i] + bound_tolerance
            following = 0
            for c in range(k):
                j = places[c]
                if pushing[j]:
                    pushing[j] = multiplier[m + following] <= 0.0
                    following += 1
                else:
                    pushing[j] = reached[c] < least[j] - row_tolerance
            continue
        # only the entry that is most wrong, in units of x
        worst, kind, place = -np.inf, 0, 0
        for i in range(n):
            pull = abs(gradient[i]) / diagonal[i]
            next_lower = gradient[i] >= 0.0 if at_lower[i] else x[i] < lower[i] - bound_tolerance
            next_upper = gradient[i] <= 0.0 if at_upper[i] else x[i] > upper[i] + bound_tolerance
            if next_lower != at_lower[i]:
                wrong = pull if at_lower[i] else lower[i] - x[i]
                if wrong > worst:
                    worst, kind, place = wrong, 0, i
            if next_upper != at_upper[i]:
                wrong = pull if at_upper[i] else x[i] - upper[i]
                if wrong > worst:
                    worst, kind, place = wrong, 1, i
        following = 0
        for c in range(k):
            j = places[c]
            violated = least[j] - reached[c]
            flips = violated > row_tolerance
            if pushing[j]:
                flips = not multiplier[m + following] <= 0.0
                norm = 0.0
                for i in range(n):
                    norm += elastic[j, i] * elastic[j, i] / diagonal[i]
                violated = multiplier[m + following] * norm
                following += 1
            if flips and violated > worst:
                worst, kind, place = violated, 2, j
        mask = at_lower if kind == 0 else (at_upper if kind == 1 else pushing)
        mask[place] = not mask[place]
    return False


@compiled(error_model="numpy")
def minimise_without_gradient(
    diagonal: Array,
    rows: Array,
    target: Array,
    weight: Array,
    elastic: Array,
    least: Array,
    elastic_weight: Array,
    lower: Array,
    upper: Array,
    at_lower: Mask,
    at_upper: Mask,
    pushing: Mask,
    row_tolerance: float,
    work: Array,
    x: Array,
) -> bool:
    """Minimiser x (n,) of a program with g = 0 and its active set fixed, clipped to the bounds.

    `work` (see `work_size`) is room; the others are as for `primal_dual_active_set`.

    Returns:
        Whether it is finite.
    """
    n, m, k = len(diagonal), len(target), len(least)
    stacked, scaled, table, right, compliance, multiplier, _, inverse, gradient, trial = _views(work, n, m, k)
    size = 0
    for r in range(m):
        stacked[size], right[size], compliance[size] = rows[r], target[r], 1.0 / weight[r]
        size += 1
    for j in range(k):
        if pushing[j]:
            stacked[size], right[size], compliance[size] = elastic[j], least[j], 1.0 / elastic_weight[j]
            size += 1
    finite = minimise_on_face(
        diagonal, np.zeros(n), lower, upper, at_lower, at_upper, stacked, right, compliance, size, row_tolerance,
        scaled, table, inverse, trial, multiplier, gradient, x,
    )  # fmt: skip
    for i in range(n):
        x[i] = min(max(x[i], lower[i]), upper[i])
    return finite
