"""How the pull on a point bends with the posture, as a compiled loop: see `curved_reach`."""

from __future__ import annotations

from wholebody.arrays import Array
from wholebody.compiled import compiled


@compiled()
def add_bending(total: Array, jacobian: Array, support: Array, point: Array, force: Array, moment: Array) -> None:
    """Add the second derivative of force times place and moment times angle to a total.

    Args:
        total: (n, n) symmetric; it is changed.
        jacobian: (6, n) linear velocity of the world's origin and angular velocity for each column.
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
        wx, wy, wz = jacobian[3, k], jacobian[4, k], jacobian[5, k]
        moved_x = jacobian[0, k] + wy * pz - wz * py
        moved_y = jacobian[1, k] + wz * px - wx * pz
        moved_z = jacobian[2, k] + wx * py - wy * px
        for j in range(k + 1):
            if support[j] == 0.0:
                continue
            ux, uy, uz = jacobian[3, j], jacobian[4, j], jacobian[5, j]
            bent = (
                (fy * uz - fz * uy) * moved_x
                + (fz * ux - fx * uz) * moved_y
                + (fx * uy - fy * ux) * moved_z
                + 0.5 * ((my * uz - mz * uy) * wx + (mz * ux - mx * uz) * wy + (mx * uy - my * ux) * wz)
            )
            total[j, k] += bent
            if j != k:
                total[k, j] += bent
