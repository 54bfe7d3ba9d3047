"""A convex piece: the unit that coal measures distances between, and the sizes that it can be trusted with."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.errors import InputError

Array = NDArray[np.float64]

SMALLEST = 1e-4
"""Least extent of a piece, metres: below 1e-5 m coal reads gaps as zero, and at 1e-6 m it loses the depth."""

LARGEST = 1e4
"""Greatest extent of a piece, metres: coal's distances are still right to micrometres there."""


class Piece(NamedTuple):
    """One convex piece of a shape.

    Attributes:
        geometry: coal's Box, Sphere, Capsule, Ellipsoid, Convex or Halfspace; its origin is the centre of
            its bounding sphere.
        placement: where the geometry's origin is in the shape.
        volume: cubic metres; infinite for a half-space.
    """

    geometry: Any
    placement: pin.SE3
    volume: float


def check_length(value: object, what: str) -> float:
    """Return a length as a float.

    Raises:
        InputError: not a number, or not within SMALLEST ... LARGEST metres.
    """
    try:
        length = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise InputError(f"{what} is {value!r}; give a number in metres") from None
    if not SMALLEST <= length <= LARGEST:
        raise InputError(f"{what} is {length!r}; give a length between {SMALLEST} and {LARGEST:g} m")
    return length


def check_vector(value: object, what: str) -> tuple[float, float, float]:
    """Return three finite numbers.

    Raises:
        InputError: not three numbers, or one that is not finite.
    """
    try:
        vector = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{what} is {value!r}; give three finite numbers")
    return float(vector[0]), float(vector[1]), float(vector[2])
