"""The program of all contacts against Pinocchio's own solver."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wholebody.base.arrays import Array
from wholebody.dynamics import contact_kernel, solve_kernel

ADMM = pytest.mark.skipif(not hasattr(pin, "ADMMContactSolver"), reason="this Pinocchio names its solver otherwise")


def heap(seed: int) -> tuple[Array, ...]:
    """Three bodies with random contact points among themselves and with one that does not move."""
    rng = np.random.default_rng(seed)
    bodies = np.array([(0, 1), (0, 1), (1, 2), (0, 2), (2, 3)], dtype=np.intp)
    normal = rng.normal(size=(5, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    point, position = rng.normal(size=(5, 3)), rng.normal(size=(4, 3))
    mass = np.array([0.0, 1.0, 0.5, 2.0])
    inertia = np.array([np.zeros((3, 3)), *(np.diag(rng.uniform(0.5, 2.0, 3)) for _ in range(3))])
    laid = np.empty((5, 3, 3)), np.empty((5, 3, 2, 6)), np.empty((5, 3, 2, 6)), np.empty((5, 2))
    contact_kernel.write_rows(bodies, normal, point, position, mass, inertia, *laid)
    return bodies, rng.normal(size=(4, 6)) * np.array([[0.0], [1.0], [1.0], [1.0]]), *laid


@ADMM
@pytest.mark.parametrize("seed", range(3))
def test_velocities_are_those_of_pinocchios_solver(seed: int) -> None:
    bodies, twist, _, jacobian, answer, mobility = heap(seed)
    friction = np.full(5, 0.3)
    full = np.zeros((15, 24))
    inverse = np.zeros((24, 15))
    for c, pair in enumerate(bodies):
        for row in range(3):
            for side in range(2):
                columns = slice(6 * pair[side], 6 * pair[side] + 6)
                full[3 * c + row, columns] += jacobian[c, row, side]
                inverse[columns, 3 * c + row] += answer[c, row, side]
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
    none, zero = (np.zeros((0, 3, 3)), np.zeros((0, 3))), np.zeros(5)
    solve_kernel.solve(
        np.arange(5), bodies, jacobian, answer, mobility, friction, zero, *none, after, impulse, 1e-13, 10**6, 100_000
    )
    signorini, coulomb = solve_kernel.residuals(
        bodies, jacobian, mobility, friction, zero, none[1], after, impulse
    )  # fmt: skip
    assert max(signorini, coulomb) < 1e-9
    if solved:
        theirs = free[order] + gram @ np.array(solver.getPrimalSolution()).ravel()
        ours = (full @ after.ravel())[order]
        assert ours == pytest.approx(theirs, abs=1e-5)
