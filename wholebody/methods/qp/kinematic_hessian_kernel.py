"""The kinematic Hessian of a force on a point, as a compiled loop: see `curved_reach`."""

from __future__ import annotations

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled


@compiled()
def add_kinematic_hessian(
    total: Array, columns: Array, support: Array, point: Array, force: Array, moment: Array
) -> None:
    """Add the second derivative of force times place and moment times angle to a total.

    Args:
        total: (n, n) symmetric; it is changed.
        columns: (n, 6) of the joint Jacobian at the world's origin: linear, then angular velocity.
        support: (n,) nonzero for columns that move the point.
        point: (3,) where the force pulls, metres.
        force: (3,) what it pulls with.
        moment: (3,) what turns the body.
    """
    n = total.shape[0]
    px, py, pz = point
    fx, fy, fz = force
    mx, my, mz = moment
    for k in range(n):
        if support[k] == 0.0:
            continue
        wx, wy, wz = columns[k, 3], columns[k, 4], columns[k, 5]
        moved_x = columns[k, 0] + wy * pz - wz * py
        moved_y = columns[k, 1] + wz * px - wx * pz
        moved_z = columns[k, 2] + wx * py - wy * px
        for j in range(k + 1):
            if support[j] == 0.0:
                continue
            ux, uy, uz = columns[j, 3], columns[j, 4], columns[j, 5]
            bent = (
                (fy * uz - fz * uy) * moved_x
                + (fz * ux - fx * uz) * moved_y
                + (fx * uy - fy * ux) * moved_z
                + 0.5 * ((my * uz - mz * uy) * wx + (mz * ux - mx * uz) * wy + (mx * uy - my * ux) * wz)
            )
            total[j, k] += bent
            if j != k:
                total[k, j] += bent
