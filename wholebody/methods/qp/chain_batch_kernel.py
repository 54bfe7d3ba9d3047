"""Inverse kinematics of one chain for many goals, as a compiled loop: see `chain_batch`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.methods.qp.chain_kernel import Chain, Goals, Room, reach
from wholebody.methods.qp.closed_form_kernel import BRANCHES, Arm, branches, least


@compiled(error_model="numpy", nogil=True)
def reach_all(
    bodies: tuple[Chain, Arm, Room], asked: Array, goals: tuple[Array, NDArray[np.int64]], held: Array, nearest: Array,
    ends: Array, found: Array, counts: Indices,
) -> None:  # fmt: skip
    """Do for each of k problems what `chain_kernel.reach` does, from the branches of its closed form or given seeds.

    Args:
        bodies: the joints; the arm that they are, without joints where it has no closed form; room, written.
        asked: (5,) as in `chain_kernel.reach`.
        goals: floats (k, e, 36) and integers (e, 6) of the goals.
        held: (k, v) values of the joint that the closed form holds.
        nearest: (k, 2, 2, n) as in `chain_kernel.reach`: for the branches, then for the descents.
        ends: (k, m, n) seeds of arms without a closed form; written: where descents end.
        found: (k, m, 4) written, as in `chain_kernel.reach`.
        counts: (k,) of seeds; written: of those that were taken, -1 for more than there is room for.
    """
    chain, arm, room = bodies
    tables, integers = goals
    size, samples, most = len(chain.lower), held.shape[1], ends.shape[1]
    branch, effort = np.empty((samples, BRANCHES, size)), np.empty((samples, BRANCHES))
    order, seeds = np.empty(samples * BRANCHES, dtype=np.intp), np.empty((samples * BRANCHES, size))
    met = np.empty((samples * BRANCHES, 4))
    for p in range(len(tables)):
        one = Goals(tables[p], integers)
        if not len(arm.joints):
            counts[p] = reach(chain, one, room, ends[p, : counts[p]], nearest[p, 1], asked, found[p])
            continue
        branches(arm, tables[p, 0], held[p], branch)
        number = least(branch, chain.lower, chain.upper, nearest[p, 0], effort, order)
        for k in range(number):
            seeds[k] = branch[order[k] // BRANCHES, order[k] % BRANCHES]
        taken = reach(chain, one, room, seeds[:number], nearest[p, 1], asked, met)
        counts[p] = taken if taken <= most else -1
        for k in range(min(taken, most)):
            ends[p, k], found[p, k] = seeds[k], met[k]
