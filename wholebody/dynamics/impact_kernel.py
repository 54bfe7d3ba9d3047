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
from wholebody.dynamics.contact_kernel import coupling, push, relative
from wholebody.dynamics.solve_kernel import solve

EXACT = 1e-10  # m/s: to which the program of one pair is solved
SWEEPS = 200  # of it
VISITS = 20_000  # of its points
JOINTED = 50  # times as many of both with joints: one that is near the contact converges slowly


@compiled()
def resolve(
    touching: Indices,
    pair: Indices,
    bodies: Indices,
    axes: Array,
    jacobian: Array,
    response: Array,
    mobility: Array,
    restitution: Array,
    friction: Array,
    effective_mass: Array,
    jointed: Mask,
    twist: Array,
    slow: float,
    most: int,
    impulse: Array,
    events: Array,
) -> tuple[int, bool]:
    """Resolve impacts until none is left, at most `most`.

    Args:
        touching: (k,) contact points that touch.
        pair: (m - j,) pair of each contact point; the other arrays are as in `contact_kernel`.
        bodies: (m, 2).
        axes: (m - j, 3, 3).
        jacobian: (m, 3, 2, 6).
        response: (m, 3, 2, 6).
        mobility: (m, 2).
        restitution: (m - j,).
        friction: (m - j,).
        effective_mass: (j, 3, 3) as in `solve_kernel.solve`; the last j points are those of joints.
        jointed: (n,) bodies that have joints.
        twist: (n, 6) changed in place.
        slow: approach that is no impact, m/s.
        most: events.
        impulse: (m, 3) room for the impulses of one event.
        events: (most, 5) room for the point, the approach [m/s] and the impulse [N s] along the world's axes.

    Returns:
        How many events there were, and whether all are resolved.
    """
    joints = len(effective_mass)
    chosen, before = np.empty(len(touching) + joints, dtype=np.intp), np.zeros((len(touching) + joints, 3))
    target, hold = np.zeros(len(pair)), np.zeros((joints, 3))
    for event in range(most):
        worst, speed = -1, -slow
        for c in touching:
            u = relative(c, 0, bodies, jacobian, twist)
            if u < speed and mobility[c, 0] > 0.0:
                worst, speed = c, u
        if worst < 0:
            return event, True
        count = 0
        for c in touching:
            if pair[c] == pair[worst]:
                chosen[count] = c
                for row in range(3):
                    before[count, row] = relative(c, row, bodies, jacobian, twist)
                    impulse[c, row] = 0.0
                target[c] = -restitution[c] * before[count, 0]
                count += 1
        points, times = count, 1
        if jointed[bodies[worst, 0]] or jointed[bodies[worst, 1]]:
            for c in range(len(pair), len(bodies)):
                chosen[count], impulse[c] = c, 0.0
                before[count] = 0.0
                count += 1
            times = JOINTED
        if count == 1:
            _single(
                worst, bodies, jacobian, response, mobility, restitution[worst], friction[worst], twist, before[0],
                impulse[worst],
            )  # fmt: skip
        else:
            solve(
                chosen[:count], bodies, jacobian, response, mobility, friction, target, effective_mass, hold, twist,
                impulse, EXACT, times * VISITS, times * SWEEPS,
            )  # fmt: skip
            _remove_gain(chosen[:count], bodies, jacobian, response, twist, before, impulse)
        events[event, 0], events[event, 1] = worst, -speed
        events[event, 2:] = 0.0
        for number in range(points):
            for row in range(3):
                for k in range(3):
                    events[event, 2 + k] += impulse[chosen[number], row] * axes[chosen[number], row, k]
    return most, False


@compiled(inner=True)
def _single(
    c: int,
    bodies: Indices,
    jacobian: Array,
    response: Array,
    mobility: Array,
    restitution: float,
    friction: float,
    twist: Array,
    before: Array,
    impulse: Array,
) -> None:
    """The impulse at one point; eqs. 8 to 10."""
    normal = -(1.0 + restitution) * before[0] / mobility[c, 0]
    push(c, 0, normal, bodies, response, twist)
    impulse[0] = normal
    sliding = np.sqrt(before[1] ** 2 + before[2] ** 2)
    if sliding < 1e-12 or friction == 0.0:
        return
    one, two = before[1] / sliding, before[2] / sliding
    along = one * one * coupling(c, 1, 1, jacobian, response) + two * two * coupling(c, 2, 2, jacobian, response)
    along += 2.0 * one * two * coupling(c, 1, 2, jacobian, response)
    now = one * relative(c, 1, bodies, jacobian, twist) + two * relative(c, 2, bodies, jacobian, twist)
    size = min(friction * normal, max(0.0, now / along))
    # energy added by the share f of friction: lost + f linear + f^2 square
    lost = 0.5 * normal * before[0] * (1.0 - restitution)
    linear, square = -size * now, 0.5 * size * size * along
    if lost + linear + square > 0.0:
        size *= max(0.0, (-linear + np.sqrt(max(linear * linear - 4.0 * square * lost, 0.0))) / (2.0 * square))
    for row, part in ((1, -size * one), (2, -size * two)):
        push(c, row, part, bodies, response, twist)
        impulse[row] = part


@compiled(inner=True)
def _remove_gain(
    chosen: Indices,
    bodies: Indices,
    jacobian: Array,
    response: Array,
    twist: Array,
    before: Array,
    impulse: Array,
) -> None:
    """Scale the impulses of a pair down to what adds no kinetic energy."""
    linear, square = 0.0, 0.0
    for number in range(len(chosen)):
        c = chosen[number]
        for row in range(3):
            now = relative(c, row, bodies, jacobian, twist)
            linear += impulse[c, row] * before[number, row]
            square += impulse[c, row] * (now - before[number, row])
    if linear + 0.5 * square <= 0.0 or square <= 0.0:
        return
    share = max(0.0, -2.0 * linear / square)
    for c in chosen:
        for row in range(3):
            push(c, row, (share - 1.0) * impulse[c, row], bodies, response, twist)
            impulse[c, row] *= share
