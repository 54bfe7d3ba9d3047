"""Euler parameters of many bodies at once: rotations as quadratic forms, and their derivatives.

Quaternions are (x, y, z, w). For e = (v, w) of any length,

    R(e) c = (w^2 - v.v) c + 2 (v.c) v + 2 w v x c,          l . R(e) c = e' Q(c, l) e,

which is a rotation if e has unit length (a separate constraint keeps it there), and has constant second
derivatives. A relative orientation conj(a) b is bilinear, so the equations of joints need no trigonometry.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, cross

CONJUGATE = np.array((-1.0, -1.0, -1.0, 1.0))


def product(a: Array, b: Array) -> Array:
    """Hamilton product of quaternions, (..., 4)."""
    v, w, p, s = a[..., :3], a[..., 3:], b[..., :3], b[..., 3:]
    vector = w * p + s * v + cross(v, p)
    return np.concatenate([vector, w * s - (v * p).sum(axis=-1, keepdims=True)], axis=-1)


def conjugate(a: Array) -> Array:
    """The inverse of unit quaternions, (..., 4)."""
    result: Array = a * CONJUGATE
    return result


def rotate(e: Array, c: Array) -> Array:
    """R(e) c of k quaternions (k, 4) and vectors (k, 3)."""
    v, w = e[:, :3], e[:, 3:]
    square = w * w - (v * v).sum(axis=1, keepdims=True)
    along = 2.0 * (v * c).sum(axis=1, keepdims=True)
    result: Array = square * c + along * v + 2.0 * w * cross(v, c)
    return result


def rotate_derivative(e: Array, c: Array) -> Array:
    """Derivative (k, 3, 4) of R(e) c by e."""
    v, w = e[:, :3], e[:, 3]
    result = np.empty((len(e), 3, 4))
    outer = c[:, :, None] * v[:, None, :]
    np.subtract(outer.transpose(0, 2, 1), outer, out=result[:, :, :3])
    along = (v * c).sum(axis=1)
    x, y, z = c.T
    for i in range(3):
        result[:, i, i] += along
    result[:, 0, 1] += w * z
    result[:, 0, 2] -= w * y
    result[:, 1, 0] -= w * z
    result[:, 1, 2] += w * x
    result[:, 2, 0] += w * y
    result[:, 2, 1] -= w * x
    result[:, :, 3] = w[:, None] * c + cross(v, c)
    result *= 2.0
    return result


def spin(e: Array) -> Array:
    """(k, 3, 4) the angular velocity in the world, by the rate of unit quaternions (k, 4)."""
    a, b, c, w = e.T
    result: Array = 2.0 * np.array(((w, -c, b, -a), (c, w, -a, -b), (-b, a, w, -c))).transpose(2, 0, 1)
    return result


def rotate_form(c: Array, force: Array) -> Array:
    """The symmetric matrices Q (k, 4, 4) with force . R(e) c = e' Q e; twice that is the second derivative."""
    result = np.empty((len(c), 4, 4))
    inner = (c * force).sum(axis=1)
    outer = c[:, :, None] * force[:, None, :]
    result[:, :3, :3] = outer + outer.transpose(0, 2, 1) - inner[:, None, None] * np.eye(3)
    result[:, :3, 3] = result[:, 3, :3] = cross(c, force)
    result[:, 3, 3] = inner
    return result


_BASIS = np.eye(4)
RELATIVE = np.array([[product(conjugate(a), b) for b in _BASIS] for a in _BASIS]).transpose(2, 0, 1)
"""(4, 4, 4): component k of conj(a) b is a' RELATIVE[k] b."""


def relative_forms(first: Array, second: Array) -> Array:
    """Bilinear forms (k, 4, 4, 4) of conj(a first) (b second), for axes (k, 4) in two bodies: a' [.., i] b."""
    turn = product(conjugate(first)[:, None, :], product(_BASIS[None], second[:, None, :]))  # (k, basis, component)
    result: Array = np.einsum("kji,jab->kiab", turn, RELATIVE)
    return result


def axes_with_z(direction: Array) -> Array:
    """Quaternions (k, 4) of the smallest rotations that turn z to unit directions (k, 3)."""
    x, y, z = direction.T
    result = np.stack([-y, x, np.zeros_like(x), 1.0 + z], axis=1)
    back = z < -1.0 + 1e-9
    result[back] = (1.0, 0.0, 0.0, 0.0)
    result /= np.linalg.norm(result, axis=1, keepdims=True)
    return result


def axes_along(direction: Array) -> Any:
    """Axes (pin.Quaternion) whose z axis is a unit direction (3,)."""
    return pin.Quaternion(axes_with_z(direction[None])[0])
