"""The compiled loops of the engine, compiled or read back all together: not in the middle of a frame."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from wholebody.base.arrays import Indices
from wholebody.dynamics import energy_kernel, impact_kernel, motion_kernel, passing, rows_kernel, solve_kernel
from wholebody.dynamics.contact_points import ContactPoints
from wholebody.dynamics.motion_kernel import Bodies
from wholebody.dynamics.pieces import SweptPoints
from wholebody.dynamics.rows_kernel import JointPoints, Rows
from wholebody.dynamics.solve_kernel import Laws, Limits


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The loops of motion; those of all other modules named above are compiled or read back with them."""
    one, unit, mask, twist = np.zeros((1, 3)), np.eye(3)[None].copy(), np.ones(1, dtype=bool), np.zeros((1, 6))
    none, pairs, some, no_mask = _integers(0), _integers(0, 2), np.zeros(0), np.zeros(0, dtype=bool)
    vectors, placed = np.zeros((0, 3)), np.zeros((1, 4, 3))
    bodies = Bodies(np.ones(1), unit, unit, one, unit.copy(), twist, mask, mask, mask)
    motion_kernel.drift(bodies, mask, np.zeros(3), 1.0)
    motion_kernel.displace(bodies, twist)
    motion_kernel.place_pieces(one, unit, one, _integers(1), placed, placed.copy())
    rows, joints = Rows.room(pairs, 0, mask), JointPoints(pairs, np.zeros((0, 2, 3)), no_mask)
    rows_kernel.contact_rows(ContactPoints(none, pairs, vectors, vectors, some), bodies, rows)
    rows_kernel.joint_rows(joints, bodies, rows)
    rows_kernel.joint_gaps(joints, bodies, vectors)
    rows_kernel.rates(pairs, rows.jacobian, twist, vectors)
    laws = Laws(some, some, vectors)
    solve_kernel.solve(none, rows, laws, twist, vectors, Limits(1.0, 1))
    solve_kernel.solve_islands(rows, laws, twist, vectors, Limits(1.0, 1))
    solve_kernel.residuals(rows, laws, twist, vectors)
    solve_kernel.join(none, pairs, mask, _integers(1))
    solve_kernel.solve_from((none, vectors, vectors), (none, vectors), rows, laws, twist, vectors, Limits(1.0, 1))
    energy_kernel.restrain(pairs, vectors, no_mask, bodies, twist, np.zeros(3), no_mask)
    energy_kernel.settle(pairs, vectors, some, 0, bodies, (one, unit, twist), np.zeros(3))
    impact_kernel.resolve(none, none, rows, some, laws, mask, twist, np.zeros((1, 5)))
    swept = SweptPoints(vectors, none, none, some, vectors, np.zeros((0, 4)))
    way = passing.Way(pairs, none, np.zeros((2, 0)), np.zeros((2, 0, 3)), np.zeros((2, 0, 4, 3)), one, some, some, 0.0)
    passing.doubtful(way, swept, no_mask)
    return motion_kernel


def _integers(*shape: int) -> Indices:
    return np.zeros(shape, dtype=np.intp)
