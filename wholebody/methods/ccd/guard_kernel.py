"""Tests of reach cones and ranges of motion, and descents that stop where one is left, as compiled loops.

Rows (28,) of parts: what it is, the nodes of limb and reference, its first and last row of wedges or angles, the limb's
rotation (9,) in its node (of a cone the axis), the reference's (9,), slope (3,), sign and bound.
"""

from __future__ import annotations

from math import atan2
from typing import Any

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled, with_loops
from wholebody.methods.ccd.limbs import forward
from wholebody.methods.ccd.sweep import carry, greatest_error, sweep

CONE, TWIST, SUM, ELLIPSE = 0.0, 1.0, 2.0, 3.0
ROW = 28


@with_loops(__name__)
def compiled_kernel(_: Any) -> None:
    """This module, after its loops are compiled or loaded from the cache; called before a solve, not during it."""
    frames, none, nodes = np.zeros((1, 12)), np.zeros(0), np.zeros(0, dtype=np.intp)
    tables = np.zeros((0, ROW)), np.zeros((1, 9)), np.zeros((0, 5)), np.zeros((0, 2))
    limbs = (
        nodes, frames[:0], np.zeros(0, dtype=bool), np.zeros((0, 3)), none, np.zeros((2, 0)), frames, np.zeros((0, 6)),
    )  # fmt: skip
    aims = np.zeros((0, 11))
    outside(*tables, frames, none)
    carry_both(frames, aims, nodes, aims, nodes)
    twist_beyond(np.zeros(ROW), frames)
    square(np.zeros(ROW), *tables[2:], none)
    in_cone(tables[1], 0.0, 0.0, 1.0)
    pursuit = aims, nodes, aims, nodes, np.zeros((1, 0))
    descend(limbs, pursuit, (np.zeros((0, 4), dtype=np.intp), nodes), tables, none, np.zeros(3), 0.0, 1.0)


@compiled()
def descend(
    limbs: tuple[Indices, Array, Mask, Array, Array, Array, Array, Array],
    pursuit: tuple[Array, Indices, Array, Indices, Array],
    plan: tuple[Indices, Indices],
    tables: tuple[Array, Array, Array, Array],
    inside: Array,
    state: Array,
    tolerance: float,
    most: float,
) -> bool:
    """Sweep until goals are met, nothing moves, or `most` sweeps are made; true if a part is left before.

    `limbs` are arrays of `Limbs`; `pursuit`: aims and their nodes, targets and theirs, factors (halves, m) in each half
    of a sweep. `inside` (n,) has the last values that left nothing. `state` (3,): sweeps, halves of the next one that
    are made, its largest change. After a true answer bring what is left back, carry the aims, and call it again.
    """
    parents, places, slides, axes, values, limits, frames, lines = limbs
    aims, nodes, targets, bases, halves = pursuit
    while state[0] < most:
        if state[1] == 0.0:
            state[2] = 0.0
        while state[1] < len(halves):
            for k in range(len(nodes)):
                aims[k, 6] = halves[int(state[1]), k]
            state[2] = max(state[2], sweep(lines, slides, values, limits, aims, plan[0], plan[1]))
            state[1] += 1.0
            forward(parents, places, slides, axes, values, frames, lines)
            if outside(tables[0], tables[1], tables[2], tables[3], frames, values) >= 0:
                return True
            for k in range(len(values)):
                inside[k] = values[k]
            carry_both(frames, aims, nodes, targets, bases)
        state[0], state[1] = state[0] + 1.0, 0.0
        if state[2] < 1e-9 or greatest_error(aims) <= tolerance:
            break
    return False


@compiled()
def carry_both(frames: Array, aims: Array, nodes: Indices, targets: Array, bases: Indices) -> None:
    """Write where aims and their targets, which nodes carry too, are now; see `carry`."""
    carry(frames, bases, targets)
    carry(frames, nodes, aims)
    for k in range(len(nodes)):
        for axis in range(3):
            aims[k, 3 + axis] = targets[k, axis]


@compiled()
def outside(parts: Array, wedges: Array, angles: Array, terms: Array, frames: Array, values: Array) -> int:
    """The first of some parts that is left at values (n,) of nodes with frames (n + 1, 12); -1 for none."""
    for k in range(len(parts)):
        part = parts[k]
        if part[0] == CONE:
            x, y, z = seen(frames, int(part[1]), int(part[2]), part[5], part[6], part[7])
            x, y, z = turned_back(part, x, y, z)
            within = in_cone(wedges[int(part[3]) : int(part[4])], x, y, z)
        elif part[0] == TWIST:
            within = twist_beyond(part, frames) <= 0.0
        elif part[0] == SUM:
            within = added(angles[int(part[3])], terms, values) <= part[27]
        else:
            within = square(part, angles, terms, values) <= 1.0
        if not within:
            return k
    return -1


@compiled()
def in_cone(wedges: Array, x: float, y: float, z: float) -> bool:
    """Whether a unit direction is in a cone: find the wedge (9,) that contains it, then test the wedge's edge."""
    for k in range(len(wedges)):
        wedge = wedges[k]
        before = wedge[0] * x + wedge[1] * y + wedge[2] * z
        if before >= 0.0 > wedge[3] * x + wedge[4] * y + wedge[5] * z:
            return bool(wedge[6] * x + wedge[7] * y + wedge[8] * z >= 0.0)
    wedge = wedges[0]
    return bool(wedge[6] * x + wedge[7] * y + wedge[8] * z >= 0.0)


@compiled(inner=True)
def seen(frames: Array, limb: int, base: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A direction of the frame of one node in that of another; frames (n + 1, 12) of nodes, the last the world's."""
    a, b = frames[limb], frames[base]
    u = a[0] * x + a[1] * y + a[2] * z
    v = a[3] * x + a[4] * y + a[5] * z
    w = a[6] * x + a[7] * y + a[8] * z
    return b[0] * u + b[3] * v + b[6] * w, b[1] * u + b[4] * v + b[7] * w, b[2] * u + b[5] * v + b[8] * w


@compiled(inner=True)
def turned_back(part: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A direction by the inverse of the rotation of a part's reference."""
    return (
        part[14] * x + part[17] * y + part[20] * z,
        part[15] * x + part[18] * y + part[21] * z,
        part[16] * x + part[19] * y + part[22] * z,
    )


@compiled()
def twist_beyond(part: Array, frames: Array) -> float:
    """The twist of a limb beyond its bound, rad; the rotation of the reference is the central one's."""
    limb, base = int(part[1]), int(part[2])
    x, y, z = seen(frames, limb, base, part[5], part[8], part[11])
    a, b, _ = turned_back(part, x, y, z)
    x, y, z = seen(frames, limb, base, part[6], part[9], part[12])
    d, e, _ = turned_back(part, x, y, z)
    x, y, z = seen(frames, limb, base, part[7], part[10], part[13])
    x, y, z = turned_back(part, x, y, z)
    along = part[23] * x + part[24] * y + part[25] * z
    return float(part[26] * atan2(b - d, a + e) - part[27] - along)


@compiled()
def square(part: Array, angles: Array, terms: Array, values: Array) -> float:
    """The sum of the squares of a part's angles, each as a share of its limit."""
    total = 0.0
    for k in range(int(part[3]), int(part[4])):
        angle = angles[k]
        value = added(angle, terms, values)
        share = value / (angle[4] if value > 0.0 else angle[3])
        total += share * share
    return total


@compiled(inner=True)
def added(angle: Array, terms: Array, values: Array) -> float:
    """An angle: what does not change, and the weighted sum of the values of nodes."""
    total = angle[2]
    for k in range(int(angle[0]), int(angle[1])):
        total += terms[k, 1] * values[int(terms[k, 0])]
    return float(total)
