"""The way along a branch of an arm of seven joints, as compiled loops: see `along_branches`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.base.dense_kernel import copy
from wholebody.methods.qp.chain_goals_kernel import Chain, Goals, Room
from wholebody.methods.qp.chain_kernel import reach
from wholebody.methods.qp.closed_form_kernel import BRANCHES, Arm, beside


@compiled(error_model="numpy")
def downhill(effort: Array, held: Array, most: float, order: Indices, bottoms: Array) -> int:
    """Where branches fall from their samples, the least effort first, as far as it may be less than `most`.

    That is the sample beside one of less effort; else its own, and a parabola's least; else one beyond limits. From a
    sample that is alone in its branch there are two bottoms.

    Args:
        effort: (v, 8) of the samples, inf for none.
        held: (v, 8) their values of the joint that is held; those at the ends may be turned by a whole turn.
        most: effort.
        order: (2 * v * 8,) written: places of the samples in the flattened array.
        bottoms: (2 * v * 8, 2) written: the value to which each falls, and the effort there.

    Returns:
        How many there are.
    """
    count, last, middle = 0, len(held) - 1, len(held) // 2
    step = held[middle, 0] - held[middle - 1, 0]
    for v in range(last + 1):
        for b in range(BRANCHES):
            own = effort[v, b]
            if own == np.inf:
                continue
            before, after = effort[v - 1, b] if v else np.inf, effort[v + 1, b] if v < last else np.inf
            bent, towards, least = before - 2.0 * own + after, held[v, b], min(before, after)
            if least < own:
                towards += -step if before < after else step
            elif 0.0 < bent < np.inf:
                least = own - 0.125 * (after - before) ** 2 / bent
            else:
                towards += -step if before == np.inf else step
                least = own - 3.0 * ((after if before == np.inf else before) - own)  # it falls faster towards limits
            for other in (towards, 2.0 * held[v, b] - towards):
                if least < most:
                    place = count
                    while place > 0 and bottoms[place - 1, 1] > least:
                        order[place] = order[place - 1]
                        copy(bottoms[place - 1], bottoms[place])
                        place -= 1
                    order[place], bottoms[place, 0], bottoms[place, 1] = BRANCHES * v + b, other, least
                    count += 1
                if least > -np.inf:
                    break
    return count


@compiled(error_model="numpy")
def along(
    bodies: tuple[Chain, Arm, Room, bool], asked: Array, goals: Goals, nearest: Array, most: tuple[float, float, int],
    samples: Array, towards: Array, found: tuple[Array, Array],
) -> None:  # fmt: skip
    """Follow branches from samples towards other values of the joint that is held, as far as they exist.

    Args:
        bodies: the joints; the arm that they are, or nearly are; room, written; whether they are that arm exactly. Else
            a descent with the joint at rest leads to the goals.
        asked: (5,) as in `chain_kernel.reach`.
        goals: one placement.
        nearest: (2, n) as there.
        most: share of the effort that another posture on the way to an end is worth; an effort to come below; how many
            postures are tried.
        samples: (k, n), which are only near to the goals, or were a little beyond limits and clamped to them.
        towards: (k,) values of the joint that is held.
        found: written: the posture at each sample, or the first one that is found on the way, and the last one
            (k, 2, n); the effort of both (k, 2), inf where there is none.
    """
    held, (gain, least, count), (ends, efforts) = bodies[1].joints[bodies[1].held], most, found
    there = np.empty(samples.shape[1])
    for k in range(len(samples)):
        q, begin, end = samples[k], ends[k, 0], ends[k, 1]
        size, share = towards[k] - q[held], 0.0
        first = _at(bodies, asked, goals, nearest, q[held], q, begin)
        while first == np.inf and size != 0.0 and share < 0.95:  # the branch begins between the samples
            share += 0.5 * (1.0 - share)
            first = _at(bodies, asked, goals, nearest, q[held] + share * size, q, begin)
        copy(begin, end)
        efforts[k, 0] = efforts[k, 1] = first
        if first == np.inf or size == 0.0:
            continue
        near, far, share = share, 1.0, 1.0
        for _ in range(count):
            effort = _at(bodies, asked, goals, nearest, q[held] + share * size, end, there)
            if effort == np.inf:
                far = share
            else:
                gained = efforts[k, 1] - effort
                if gained < 0.0:
                    break
                copy(there, end)
                near, efforts[k, 1] = share, effort
                # halves of the way to where a branch ends gain 0.7 of those before, or less
                if share == 1.0 or gained < max(gain * effort, 0.25 * (effort - least)):
                    break
            share = 0.5 * (near + far)


@compiled(inner=True, error_model="numpy")
def _at(
    bodies: tuple[Chain, Arm, Room, bool], asked: Array, goals: Goals, nearest: Array, value: float, q: Array,
    posture: Array,
) -> float:  # fmt: skip
    """The effort of the posture on the branch of q (n,) with the held joint at a value, written; inf for none."""
    chain, arm, room, exact = bodies
    held = arm.joints[arm.held]
    effort = beside(arm, goals.tables[0], (chain.lower, chain.upper), nearest, value, q, posture)
    if exact or effort == np.inf:
        return effort
    lower, upper, rest = chain.lower.copy(), chain.upper.copy(), np.zeros((2, len(q)))
    lower[held] = upper[held] = posture[held]
    copy(posture, rest[0])
    still = Chain(chain.parents, chain.places, chain.turns, chain.slides, chain.support, lower, upper)
    found = np.empty((1, 4))
    reach(still, goals, room, posture.reshape((1, len(q))), rest, asked, np.zeros(1), found)
    if found[0, 1] == np.inf:
        return np.inf
    effort = 0.0
    for i in range(len(q)):
        effort += nearest[1, i] * (posture[i] - nearest[0, i]) ** 2
    return effort
