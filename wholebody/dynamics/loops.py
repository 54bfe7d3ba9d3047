"""The compiled loops of the engine, compiled or read back all together: not in the middle of a frame."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from wholebody.dynamics import (
    contact_kernel,
    energy_kernel,
    impact_kernel,
    joint_kernel,
    motion_kernel,
    passing_kernel,
    solve_kernel,
)


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The loops of motion; those of all other modules named above are compiled or read back with them."""
    one, none, mask = np.zeros((1, 3)), np.zeros(0, dtype=np.intp), np.ones(1, dtype=bool)
    unit, vectors, turned, twist = np.eye(3)[None].copy(), np.zeros((0, 3)), np.zeros((1, 4, 3)), np.zeros((1, 6))
    some, mass, pairs = np.zeros(0), np.zeros(1), np.zeros((0, 2), dtype=np.intp)
    motion_kernel.drift(one, unit.copy(), twist, unit, unit, mask, mask, mask, np.zeros(3), 1.0)
    motion_kernel.displace(one, unit.copy(), twist, mask)
    motion_kernel.world_inverses(unit, unit, mask, unit.copy())
    motion_kernel.place_pieces(one, unit, one, np.zeros(1, dtype=np.intp), turned, turned.copy())
    rows = np.zeros((0, 3, 3)), np.zeros((0, 3, 2, 6)), np.zeros((0, 3, 2, 6)), np.zeros((0, 2))
    effective_mass, hold, levers = np.zeros((0, 3, 3)), vectors, np.zeros((0, 2, 3))
    contact_kernel.write_rows(pairs, vectors, vectors, one, mass, unit, *rows)
    joint_kernel.place(pairs, levers, mask[:0], one, unit, levers, vectors)
    joint_kernel.write_rows(pairs, mask[:0], levers, mass, unit, *rows[1:], effective_mass)
    solve_kernel.solve(none, pairs, *rows[1:], some, some, effective_mass, hold, twist, vectors, 1.0, 1, 1)
    solve_kernel.solve_islands(pairs, *rows[1:], some, some, effective_mass, hold, twist, vectors, 1.0, 1, 1)
    solve_kernel.residuals(pairs, rows[1], rows[3], some, some, hold, twist, vectors)
    energy_kernel.restrain(
        pairs, vectors, vectors, some, 1.0, mask, mask, mask, mass, unit, one, unit, twist, twist, np.zeros(3), mask[:0]
    )
    energy_kernel.settle(
        pairs, vectors, some, 0, mask, mask, ~mask, mass, unit, one, unit, twist, one, unit, twist, np.zeros(3)
    )
    contact_kernel.rates(pairs, rows[1], twist, vectors)
    contact_kernel.join(none, pairs, mask, np.zeros(1, dtype=np.intp))
    contact_kernel.apply(pairs, rows[2], twist, vectors)
    contact_kernel.start_from(none, vectors, vectors, none, none, vectors, rows[0], 1.0, vectors)
    impact_kernel.resolve(
        none, none, pairs, *rows, some, some, effective_mass, mask, twist, 1.0, 1, vectors, np.zeros((1, 5))
    )
    passing_kernel.doubtful(
        pairs, some, vectors, some, vectors, turned, turned, none, one, mass, mass, 0.0, 1.0, vectors,
        none, none, some, vectors, np.zeros((0, 4)), mask[:0],
    )  # fmt: skip
    return motion_kernel
