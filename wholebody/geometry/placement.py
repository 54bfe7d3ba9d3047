"""Placements: every way of writing one, checked and converted to Pinocchio's."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.checks import array, numbers
from wholebody.base.errors import InputError

PlacementLike: TypeAlias = Sequence[float] | NDArray[np.float64] | pin.SE3
"""(x, y, z), (x, y, z, qx, qy, qz, qw), a 4x4 homogeneous matrix, or a ``pinocchio.SE3``."""

FARTHEST = 1e6  # largest distance of a placement from the origin, metres; beyond it rounding exceeds coal's accuracy

ROUNDING = 1e-3  # largest error of a rotation: numbers with four digits are repaired, larger errors are refused


_UPRIGHT = np.eye(3)


def placement(at: PlacementLike, what: str = "placement") -> pin.SE3:
    """Read a placement [m] as a fresh SE3 whose rotation is orthonormal to machine precision, or raise an InputError.

    `at`: (3,) position, (7,) position and unit quaternion x, y, z, w, (4, 4) matrix, or ``pin.SE3``. coal treats NaN as
    touching and accepts any matrix as a rotation, so both are refused here.
    """
    if isinstance(at, pin.SE3):
        return _rigid(np.asarray(at.rotation), np.asarray(at.translation), what)
    values = array(at, what, "(x, y, z), (x, y, z, qx, qy, qz, qw), a 4x4 matrix or a pin.SE3")
    if values.shape == (3,):
        if not all(abs(one) <= FARTHEST for one in values.tolist()):
            _check_values(values, what)
        return pin.SE3(_UPRIGHT, values)
    if values.shape == (7,):
        a, b, c, x, y, z, w = values.tolist()
        norm = math.sqrt(x * x + y * y + z * z + w * w)
        if math.isfinite(norm) and abs(norm - 1.0) > ROUNDING:
            raise InputError(f"{what}: the quaternion has length {norm:.6g}, not 1; give qx, qy, qz, qw of a rotation")
        if not a * a + b * b + c * c + norm <= FARTHEST**2:  # NaN is not
            _check_values(values, what)
        if x == 1.0:
            meaning = "is half a turn about x; quaternions are x, y, z, w, and (0, 0, 0, 1) is no turn"
            warnings.warn(f"{what}: the quaternion (1, 0, 0, 0) {meaning}", stacklevel=3)
        if norm != 1.0:
            values = np.hstack((values[:3], values[3:] / norm))
        return pin.XYZQUATToSE3(values)
    if values.shape == (4, 4):
        if np.isfinite(values).all() and np.abs(values[3] - (0.0, 0.0, 0.0, 1.0)).max() > ROUNDING:
            raise InputError(f"{what}: the last row of the 4x4 matrix is {values[3].tolist()}, not [0, 0, 0, 1]")
        return _rigid(values[:3, :3], values[:3, 3], what)
    angles = (
        "; for angles give pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), position)" if values.shape == (6,) else ""
    )
    raise InputError(
        f"{what}: shape {values.shape} is none of (3,) position, (7,) position and quaternion, (4, 4) matrix{angles}"
    )


def unit_vector(value: object, what: str) -> tuple[float, float, float]:
    """The unit vector along another; an InputError if that has no direction."""
    x, y, z = numbers(value, (3,), what).tolist()
    length = math.hypot(x, y, z)
    if not 1e-9 <= length <= 1e9:
        raise InputError(
            f"{what} is {[x, y, z]} and has no direction; give a vector of a length from 1e-9 to 1e9, such as (0, 0, 1)"
        )
    return x / length, y / length, z / length


def along_z(direction: Array) -> Array:
    """A rotation (3, 3) whose third column is the direction; in floats, as NumPy's cross product takes 20 us."""
    x, y, z = (float(part) for part in direction)
    length = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    sign = 1.0 if z >= 0 else -1.0  # Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017
    a, b = -1.0 / (sign + z), x * y * -1.0 / (sign + z)
    return np.array([[1.0 + sign * x * x * a, b, x], [sign * b, sign + y * y * a, y], [-sign * x, -y, z]], dtype=float)


def quaternions(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit quaternions (n, 4) as x, y, z, w of rotations (n, 3, 3)."""
    # A row of 4 q q^T (Shepperd, "Quaternion from rotation matrix", J. Guidance and Control 1(3), 1978).
    r, n = rotations, np.arange(len(rotations))
    xx, yy, zz = r[:, 0, 0], r[:, 1, 1], r[:, 2, 2]
    outer = np.empty((len(r), 4, 4))
    outer[:, 0, 0], outer[:, 1, 1] = 1 + xx - yy - zz, 1 - xx + yy - zz
    outer[:, 2, 2], outer[:, 3, 3] = 1 - xx - yy + zz, 1 + xx + yy + zz
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        outer[:, i, j] = outer[:, j, i] = r[:, j, i] + r[:, i, j]
        outer[:, 3, k] = outer[:, k, 3] = r[:, j, i] - r[:, i, j]
    row = outer[n, np.argmax(outer[:, range(4), range(4)], axis=1)]
    found: NDArray[np.float64] = row / np.sqrt((row * row).sum(axis=1, keepdims=True))
    return found


def _rigid(rotation: NDArray[np.float64], translation: NDArray[np.float64], what: str) -> pin.SE3:
    """Check both parts, and round the rotation to the nearest orthonormal matrix (polar decomposition)."""
    (x, y, z), ((a, b, c), (d, e, f), (g, h, i)) = translation.tolist(), rotation.tolist()
    square = x * x + y * y + z * z + a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + i * i
    if not square <= FARTHEST**2:  # NaN is not; in a tenth of the time
        _check_values(translation, what)
        _check_values(rotation, what)
    lengths = a * a + b * b + c * c - 1.0, d * d + e * e + f * f - 1.0, g * g + h * h + i * i - 1.0
    error = max(map(abs, (*lengths, a * d + b * e + c * f, a * g + b * h + c * i, d * g + e * h + f * i)))
    if error > ROUNDING:
        raise InputError(
            f"{what}: the rotation is not orthonormal (off by {error:.3g}); give a rotation without scale or shear"
        )
    if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0.0:
        raise InputError(f"{what}: the rotation is a reflection (determinant -1); give a right-handed rotation")
    if error >= 1e-14:
        left, _, right = np.linalg.svd(rotation)
        rotation = left @ right
    return pin.SE3(rotation, translation)


def _check_values(values: NDArray[np.float64], what: str) -> None:
    if np.abs(values).max() <= FARTHEST:  # NaN is not
        return
    if not np.isfinite(values).all():
        raise InputError(f"{what}: not every value is finite; give finite numbers")
    raise InputError(f"{what}: a value is beyond {FARTHEST:g}; give metres")


def steady(turns: Array) -> Array:
    """Quaternions (n, ..., 4), in place, each of the sign with which it is nearest to the one before."""
    flips = np.where((turns[1:] * turns[:-1]).sum(axis=-1) < 0.0, -1.0, 1.0)
    turns[1:] *= np.cumprod(flips, axis=0)[..., None]
    return turns
