"""Contacts, joints, impacts and free motion in clear arrays: what the compiled loops of the engine must give.

Velocities of all bodies are one vector (6n,), rows of all points one matrix (3m, 6n).
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.dynamics.solve_kernel import JOINT_PRECISION, Laws

Array = np.ndarray


def rows_of_contact(normal: Array, first: Array, second: Array, point: Array) -> tuple[Array, Array]:
    """Rows (3, 2, 6) of one contact point for A and B, and its axes (3, 3)."""
    least = int(np.abs(normal).argmin())
    one = np.cross(np.eye(3)[least], normal)
    one /= np.linalg.norm(one)
    axes = np.array([normal, one, np.cross(normal, one)])
    return np.stack([-_point(axes, point - first), _point(axes, point - second)], axis=1), axes


def rows_of_joint(first: Array | None, second: Array) -> Array:
    """Rows (3, 2, 6) of one joint point with levers (3,) from both centres; the first is None for the world."""
    one = np.zeros((3, 6)) if first is None else -_point(np.eye(3), first)
    return np.stack([one, _point(np.eye(3), second)], axis=1)


def _point(axes: Array, lever: Array) -> Array:
    """Velocity of a point along axes (3, 3): v - [r] w."""
    return np.hstack([axes, -axes @ pin.skew(lever)])


def whole(bodies: Array, blocks: Array, count: int) -> Array:
    """The matrix (3m, 6n) of blocks (m, 3, 2, 6)."""
    matrix = np.zeros((3 * len(bodies), 6 * count))
    for c, pair in enumerate(bodies):
        for side in range(2):
            matrix[3 * c : 3 * c + 3, 6 * pair[side] : 6 * pair[side] + 6] += blocks[c, :, side]
    return matrix


def solve(
    jacobian: Array, inverse_mass: Array, laws: Laws, twist: Array, impulse: Array, tolerance: float, most: int
) -> tuple[Array, Array, int]:
    """Impulses (m, 3), velocities (6n,) and number of sweeps; `jacobian` (3m, 6n), `inverse_mass` (6n, 6n)."""
    m, contacts = len(impulse), len(laws.target)
    twist, p = twist.copy(), impulse.copy()
    answer = inverse_mass @ jacobian.T
    rows = [slice(3 * c, 3 * c + 3) for c in range(m)]
    gram = [jacobian[r] @ answer[:, r] for r in rows]
    way, last, calm = np.zeros((m, 3)), np.inf, 0
    for sweep in range(most):
        before, change, square = p.copy(), 0.0, 0.0
        order = list(range(contacts))
        for c in (order if sweep % 2 == 0 else order[::-1]) + list(range(contacts, m)):
            u = jacobian[rows[c]] @ twist
            if c >= contacts:
                off = laws.hold[c - contacts] - u
                step = np.linalg.solve(gram[c], off)
                change, square = max(change, JOINT_PRECISION * np.abs(off).max()), square + step @ off
            else:
                side = np.linalg.eigvalsh(gram[c][1:, 1:])[1]
                normal = max(0.0, p[c, 0] - (u[0] - laws.target[c]) / gram[c][0, 0])
                slid = u[1:] + gram[c][1:, 0] * (normal - p[c, 0])
                along = p[c, 1:] - slid / side
                size = np.linalg.norm(along)
                along *= min(1.0, laws.friction[c] * normal / size) if size > 0.0 else 1.0
                step = np.array([normal, *along]) - p[c]
                scale = np.array([gram[c][0, 0], side, side])
                change, square = max(change, np.abs(scale * step).max()), square + scale @ step**2
            twist += answer[:, rows[c]] @ step
            p[c] += step
        calm = calm + 1 if change < tolerance else 0
        if calm == 2 or sweep == most - 1:
            return p, twist, sweep + 1
        share, last = (square / last if last else np.nan), square
        farther = share * way if share < 1.0 else np.zeros_like(way)
        way = farther + p - before if share < 1.0 else farther
        twist += answer @ farther.ravel()
        p += farther
    return p, twist, most


def turned_freely(rotation: Array, inertia: Array, spin: Array, time: float, steps: int) -> tuple[Array, Array]:
    """Rotation and angular velocity of a free body after a time: classical Runge-Kutta of order 4."""
    momentum = rotation @ inertia @ rotation.T @ spin

    def rate(turned: Array) -> Array:
        return pin.skew(turned @ np.linalg.inv(inertia) @ turned.T @ momentum) @ turned

    h = time / steps
    for _ in range(steps):
        a = rate(rotation)
        b = rate(rotation + 0.5 * h * a)
        c = rate(rotation + 0.5 * h * b)
        d = rate(rotation + h * c)
        rotation = rotation + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return rotation, rotation @ np.linalg.inv(inertia) @ rotation.T @ momentum


def single_impact(
    velocity: list[Array], masses: list[float], inertias: list[Array], levers: list[Array], normal: Array,
    restitution: float, friction: float,
) -> Array:  # fmt: skip
    """Impulse (3,) on B of eqs. 8 to 10, friction reduced to what adds no energy; velocities are (6,) of A and B."""
    relative = [v[:3] + np.cross(v[3:], r) for v, r in zip(velocity, levers, strict=True)]
    u = relative[1] - relative[0]
    mobility = sum(
        np.eye(3) / m - pin.skew(r) @ np.linalg.inv(i) @ pin.skew(r)
        for m, i, r in zip(masses, inertias, levers, strict=True)
    )
    j = -(1.0 + restitution) * (normal @ u) / (normal @ mobility @ normal)
    slid = u - (normal @ u) * normal
    if np.linalg.norm(slid) < 1e-12 or friction == 0.0:
        return j * normal
    along = slid / np.linalg.norm(slid)
    now = along @ (u + mobility @ (j * normal))
    size = min(friction * j, max(0.0, now / (along @ mobility @ along)))

    def energy(share: float) -> float:
        impulse = j * normal - share * size * along
        return float(impulse @ u + 0.5 * impulse @ mobility @ impulse)

    if energy(1.0) > 0.0:  # the greatest share that adds none, by bisection
        low, high = 0.0, 1.0
        for _ in range(100):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if energy(middle) <= 0.0 else (low, middle)
        size *= low
    return j * normal - size * along
