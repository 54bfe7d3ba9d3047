"""Impacts, resolved one by one, as compiled loops.

The pair that approaches fastest comes first. At one point the impulse is that of Schmidl and Lin (2004), eqs. 8 to 10:

    j = -(1 + e) u_n / (1/m_A + 1/m_B + n . (I_A^-1 (r_A x n) x r_A) + n . (I_B^-1 (r_B x n) x r_B))
    j_t = -min(mu j, sticking) u_t / |u_t|

where `sticking` is the impulse that ends the sliding. Where several points of a pair touch (a box falls flat), the pair
has one program with u_n+ >= -e u_n- at every point. Where a body has joints, they are part of that program. An impulse
that would add kinetic energy, as friction can where its direction is coupled with the normal (Kane and Levinson, 1985),
is reduced until it adds none.
"""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.dynamics.rows_kernel import Rows, coupling, push, relative
from wholebody.dynamics.solve_kernel import Laws, Limits, solve

SLOW = 0.02  # m/s: slower approaches are no impacts; 20 um of fall


@compiled()
def resolve(
    touching: Indices, pair: Indices, rows: Rows, restitution: Array, laws: Laws, jointed: Mask, twist: Array,
    events: Array,
) -> tuple[int, bool]:  # fmt: skip
    """Resolve impacts of points (k,); how many, and if none is left. `events`: point, approach [m/s], impulse [N s]."""
    count = len(touching) + len(laws.hold)
    chosen, before, impulse = np.empty(count, dtype=np.intp), np.zeros((count, 3)), np.zeros((len(rows.bodies), 3))
    for event in range(len(events)):
        worst, speed = -1, -SLOW
        for c in touching:
            u = relative(c, 0, rows, twist)
            if u < speed and rows.mobility[c, 0] > 0.0:
                worst, speed = c, u
        if worst < 0:
            return event, True
        count = 0
        for c in touching:
            if pair[c] == pair[worst]:
                chosen[count], impulse[c] = c, 0.0
                for row in range(3):
                    before[count, row] = relative(c, row, rows, twist)
                laws.target[c] = -restitution[c] * before[count, 0]
                count += 1
        points, sweeps = count, 200
        if jointed[rows.bodies[worst, 0]] or jointed[rows.bodies[worst, 1]]:
            for c in range(len(pair), len(rows.bodies)):
                chosen[count], impulse[c], before[count] = c, 0.0, 0.0
                count += 1
            sweeps = 10_000  # a joint near the contact converges slowly
        if count == 1:
            _single(worst, rows, restitution[worst], laws.friction[worst], twist, before[0], impulse[worst])
        else:
            solve(chosen[:count], rows, laws, twist, impulse, Limits(1e-10, sweeps))
            _remove_gain(chosen[:count], rows, twist, before, impulse)
        events[event, 0], events[event, 1] = worst, -speed
        for c in chosen[:points]:
            for row in range(3):
                for k in range(3):
                    events[event, 2 + k] += impulse[c, row] * rows.axes[c, row, k]
    return len(events), False


@compiled(inner=True)
def _single(
    c: int, rows: Rows, restitution: float, friction: float, twist: Array, before: Array, impulse: Array
) -> None:
    """The impulse at one point; eqs. 8 to 10."""
    normal = -(1.0 + restitution) * before[0] / rows.mobility[c, 0]
    push(c, 0, normal, rows, twist)
    impulse[0] = normal
    sliding = np.sqrt(before[1] ** 2 + before[2] ** 2)
    if sliding < 1e-12 or friction == 0.0:
        return
    one, two = before[1] / sliding, before[2] / sliding
    along = one * one * coupling(c, 1, 1, rows) + two * two * coupling(c, 2, 2, rows)
    along += 2.0 * one * two * coupling(c, 1, 2, rows)
    now = one * relative(c, 1, rows, twist) + two * relative(c, 2, rows, twist)
    size = min(friction * normal, max(0.0, now / along))
    # energy added by the share f of friction: lost + f linear + f^2 square
    lost = 0.5 * normal * before[0] * (1.0 - restitution)
    linear, square = -size * now, 0.5 * size * size * along
    if lost + linear + square > 0.0:
        size *= max(0.0, (-linear + np.sqrt(max(linear * linear - 4.0 * square * lost, 0.0))) / (2.0 * square))
    for row, part in ((1, -size * one), (2, -size * two)):
        push(c, row, part, rows, twist)
        impulse[row] = part


@compiled(inner=True)
def _remove_gain(chosen: Indices, rows: Rows, twist: Array, before: Array, impulse: Array) -> None:
    """Scale the impulses of a pair down to what adds no kinetic energy."""
    linear, square = 0.0, 0.0
    for number in range(len(chosen)):
        c = chosen[number]
        for row in range(3):
            now = relative(c, row, rows, twist)
            linear += impulse[c, row] * before[number, row]
            square += impulse[c, row] * (now - before[number, row])
    if linear + 0.5 * square <= 0.0 or square <= 0.0:
        return
    share = max(0.0, -2.0 * linear / square)
    for c in chosen:
        for row in range(3):
            push(c, row, (share - 1.0) * impulse[c, row], rows, twist)
            impulse[c, row] *= share
