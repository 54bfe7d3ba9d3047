"""The program of all contacts against Pinocchio's own solver."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wholebody.base.arrays import Array
from wholebody.dynamics import rows_kernel, solve_kernel
from wholebody.dynamics.motion_kernel import Bodies
from wholebody.dynamics.pieces import ContactPoints
from wholebody.dynamics.rows_kernel import Rows
from wholebody.dynamics.solve_kernel import Laws, Limits

ADMM = pytest.mark.skipif(not hasattr(pin, "ADMMContactSolver"), reason="this Pinocchio names its solver otherwise")


def heap(seed: int) -> tuple[Rows, Array]:
    """Three bodies with random contact points among themselves and with one that does not move."""
    rng = np.random.default_rng(seed)
    bodies = np.array([(0, 1), (0, 1), (1, 2), (0, 2), (2, 3)], dtype=np.intp)
    normal = rng.normal(size=(5, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    point, position = rng.normal(size=(5, 3)), rng.normal(size=(4, 3))
    mass = np.array([np.inf, 1.0, 2.0, 0.5])
    inertia = np.array([np.eye(3), *(np.diag(1.0 / rng.uniform(0.5, 2.0, 3)) for _ in range(3))])
    free, none, gap = np.isfinite(mass), np.zeros(4, dtype=bool), np.zeros(5)
    still, upright = np.zeros((4, 6)), np.tile(np.eye(3), (4, 1, 1))
    held = Bodies(mass, inertia, np.linalg.inv(inertia), position, upright, still, free, none, none)
    rows = Rows.room(bodies, 0, free)
    rows_kernel.contact_rows(ContactPoints(gap.astype(np.intp), bodies, normal, point, gap), held, rows)
    return rows, rng.normal(size=(4, 6)) * free[:, None]


@ADMM
@pytest.mark.parametrize("seed", range(3))
def test_velocities_are_those_of_pinocchios_solver(seed: int) -> None:
    rows, twist = heap(seed)
    laws = Laws(np.full(5, 0.3), np.zeros(5), np.zeros((0, 3)))
    full = np.zeros((15, 24))
    inverse = np.zeros((24, 15))
    for c, pair in enumerate(rows.bodies):
        for row in range(3):
            for side in range(2):
                columns = slice(6 * pair[side], 6 * pair[side] + 6)
                own = slice(6 * side, 6 * side + 6)
                full[3 * c + row, columns] += rows.jacobian[c, row, own]
                inverse[columns, 3 * c + row] += rows.response[c, row, own]
    free = full @ twist.ravel()
    # Pinocchio's axes are two tangents, then the normal
    order = np.concatenate([3 * c + np.array([1, 2, 0]) for c in range(5)])
    gram = (full @ inverse)[np.ix_(order, order)]
    solver = pin.ADMMContactSolver(15)
    solver.setAbsolutePrecision(1e-11)
    solver.setRelativePrecision(1e-11)
    solver.setMaxIterations(100_000)
    cones = pin.StdVec_CoulombFrictionCone()
    cones.extend([pin.CoulombFrictionCone(0.3)] * 5)
    delassus = pin.DelassusOperatorDense(gram + 1e-10 * np.eye(15))
    solved = solver.solve(delassus, free[order], cones, np.zeros(15))
    impulse = np.zeros((5, 3))
    after = twist.copy()
    solve_kernel.solve(np.arange(5), rows, laws, after, impulse, Limits(1e-13, 100_000))
    assert max(solve_kernel.residuals(rows, laws, after, impulse)) < 1e-9
    if solved:
        theirs = free[order] + gram @ np.array(solver.getPrimalSolution()).ravel()
        ours = (full @ after.ravel())[order]
        assert ours == pytest.approx(theirs, abs=1e-5)
