"""Compiled tests of guards: whether a limb is in its reach cone, and its twist beyond a bound, many in a sweep."""

from __future__ import annotations

from math import atan2
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled, with_loops


@with_loops(__name__)
def compiled_kernel(_: Any) -> None:
    """This module, after its loops are compiled or loaded from the cache; called before a solve, not during it."""
    frames, turn, three = np.zeros((1, 12)), np.zeros(9), np.zeros(3)
    in_cone(np.zeros((1, 9)), 0.0, 0.0, 1.0)
    limb_in_cone(np.zeros((1, 9)), frames, 0, 0, three, turn)
    twist_beyond(frames, 0, 0, turn, turn, three, 1.0, 0.0)


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
    """A direction of the frame of one node in that of another; frames (n, 12) of nodes, the last the world's."""
    a, b = frames[limb], frames[base]
    u = a[0] * x + a[1] * y + a[2] * z
    v = a[3] * x + a[4] * y + a[5] * z
    w = a[6] * x + a[7] * y + a[8] * z
    return b[0] * u + b[3] * v + b[6] * w, b[1] * u + b[4] * v + b[7] * w, b[2] * u + b[5] * v + b[8] * w


@compiled(inner=True)
def turned_back(turn: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A direction by the inverse of a rotation (9,), row by row."""
    return (
        turn[0] * x + turn[3] * y + turn[6] * z,
        turn[1] * x + turn[4] * y + turn[7] * z,
        turn[2] * x + turn[5] * y + turn[8] * z,
    )


@compiled()
def limb_in_cone(wedges: Array, frames: Array, limb: int, base: int, axis: Array, turn: Array) -> bool:
    """Whether an axis (3,) of a node is in a cone, whose frame is turned by `turn` (9,) in that of node `base`."""
    x, y, z = seen(frames, limb, base, axis[0], axis[1], axis[2])
    x, y, z = turned_back(turn, x, y, z)
    return in_cone(wedges, x, y, z)


@compiled()
def twist_beyond(
    frames: Array, limb: int, base: int, own: Array, turn: Array, slope: Array, sign: float, bound: float
) -> float:  # fmt: skip
    """The twist of a limb beyond its bound, rad: `own` (9,) is its rotation in its node, `turn` the central one's."""
    x, y, z = seen(frames, limb, base, own[0], own[3], own[6])
    a, b, _ = turned_back(turn, x, y, z)
    x, y, z = seen(frames, limb, base, own[1], own[4], own[7])
    d, e, _ = turned_back(turn, x, y, z)
    x, y, z = seen(frames, limb, base, own[2], own[5], own[8])
    x, y, z = turned_back(turn, x, y, z)
    along = slope[0] * x + slope[1] * y + slope[2] * z
    return float(sign * atan2(b - d, a + e) - bound - along)
