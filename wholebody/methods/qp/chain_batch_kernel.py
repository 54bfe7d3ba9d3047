"""Inverse kinematics of one chain for many goals, as a compiled loop: see `chain_batch`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.methods.qp.chain_kernel import Chain, Goals, Room, reach
from wholebody.methods.qp.closed_form_kernel import BRANCHES, Arm, foreseen, sampled
from wholebody.methods.qp.dense_kernel import copy


@compiled(error_model="numpy", nogil=True)
def reach_all(
    bodies: tuple[Chain, Arm, Room], asked: Array, goals: tuple[Array, NDArray[np.int64]], samples: tuple[int, int],
    nearest: Array, ends: Array, found: Array, counts: Indices,
) -> None:  # fmt: skip
    """Do for each of k problems what `chain_kernel.reach` does, from the branches of its closed form or given seeds.

    Args:
        bodies: the joints; the arm that they are, without joints where it has no closed form; room, written.
        asked: (5,) as in `chain_kernel.reach`.
        goals: floats (k, e, 36) and integers (e, 6) of the goals.
        samples: how many of the joint that the closed form holds, and how many where none of these is within limits.
        nearest: (k, 2, n) as in `chain_kernel.reach`.
        ends: (k, m, n) seeds of arms without a closed form; written: where descents end.
        found: (k, m, 4) written, as in `chain_kernel.reach`.
        counts: (k,) of seeds; written: of those that were taken, -1 for more than there is room for.
    """
    chain, arm, room = bodies
    tables, integers = goals
    size, most, limits = len(chain.lower), ends.shape[1], (chain.lower, chain.upper)
    branch, effort = np.empty((samples[1], BRANCHES, size)), np.empty((samples[1], BRANCHES))
    order, seeds = np.empty(samples[1] * BRANCHES, dtype=np.intp), np.empty((samples[1] * BRANCHES, size))
    met, expected = np.empty((samples[1] * BRANCHES, 4)), np.zeros(max(most, samples[1] * BRANCHES))
    for p in range(len(tables)):
        one = Goals(tables[p], integers)
        if not len(arm.joints):
            given = ends[p, : counts[p]]
            counts[p] = reach(chain, one, room, given, nearest[p], asked, expected, found[p])
            continue
        number = 0
        for v in samples:
            if number == 0:
                number = sampled(arm, tables[p, 0], limits, nearest[p], branch[:v], effort[:v], order)
                for k in range(number):
                    at, b = order[k] // BRANCHES, order[k] % BRANCHES
                    copy(branch[at, b], seeds[k])
                    expected[k] = foreseen(effort[:v], at, b)
        taken = reach(chain, one, room, seeds[:number], nearest[p], asked, expected, met)
        counts[p] = taken if taken <= most else -1
        for k in range(min(taken, most)):
            copy(seeds[k], ends[p, k])
            copy(met[k], found[p, k])
