"""Numpy views of Pinocchio's own vectors, which read hundreds of results without a Python loop.

Reading `distanceResults[k].min_distance` for 760 pairs one by one takes 205 us; through the view it takes 5 us.
When a view is made, the place of the last row is checked; where the fields of a result are, once in a process. If a
check fails (another build of Pinocchio), the caller gets None and reads through the official getters instead.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array

SE3_STRIDE = 96  # bytes: rotation (9 doubles, column major), translation (3 doubles)
RESULT_STRIDE = 160  # bytes of a coal.DistanceResult
RESULT_NORMAL = 64  # offset of its normal; the distance is in the 8 bytes before it
RESULT_DOUBLES = RESULT_STRIDE // 8
RESULT_FIRST = RESULT_NORMAL // 8 - 1  # of these: distance, normal, nearest point of the first, of the second
RESULT_FIELDS = 10
REQUEST_STRIDE = 128  # bytes of a coal.DistanceRequest


def address(array: NDArray[Any]) -> int:
    """Where an array begins in memory."""
    return int(array.__array_interface__["data"][0])


def placement_view(placements: Any) -> Array | None:
    """View of a StdVec_SE3 as (n, 4, 3): columns of the rotation, then the translation; None if laid out otherwise."""
    # It does not own the memory: keep the Pinocchio data alive.
    count = len(placements)
    if count == 0:
        return np.zeros((0, 4, 3))
    first = placements[0].rotation
    if address(placements[count - 1].translation) != address(first) + SE3_STRIDE * (count - 1) + 72:
        return None
    return np.lib.stride_tricks.as_strided(first, (count, 4, 3), (SE3_STRIDE, 24, 8))


def result_view(results: Any) -> Array | None:
    """View of a StdVec_DistanceResult as (n, 20) doubles without gaps, see `fields`; None if the layout is another."""
    count = len(results)
    if count == 0:
        return np.zeros((0, RESULT_DOUBLES))
    base = address(results[0].normal)
    if address(results[count - 1].normal) != base + RESULT_STRIDE * (count - 1) or not _fields_are_there():
        return None
    return _doubles(base - RESULT_NORMAL, count)


def _doubles(begin: int, count: int) -> Array:
    buffer = (ctypes.c_char * (RESULT_STRIDE * count)).from_address(begin)
    doubles: Array = np.ndarray((count, RESULT_DOUBLES), float, buffer=memoryview(buffer))
    return doubles


@lru_cache(maxsize=1)
def _fields_are_there() -> bool:
    """Whether what coal computes is where `fields` reads it."""
    result, turned = coal.DistanceResult(), coal.Transform3s(pin.exp3(np.ones(3)), np.array([3.0, 4.0, 5.0]))
    coal.distance(coal.Sphere(1.0), coal.Transform3s(), coal.Box(1.0, 2.0, 3.0), turned, coal.DistanceRequest(), result)
    read = fields(_doubles(address(result.normal) - RESULT_NORMAL, 1))[0]
    return np.array_equal(read, read_result(result))


def fields(view: Array) -> Array:
    """The columns (n, 10) of a `result_view`: distance, normal, point on the first, point on the second."""
    return view[:, RESULT_FIRST : RESULT_FIRST + RESULT_FIELDS]


def read_result(result: Any) -> Array:
    """One DistanceResult through its official getters, as a row of `fields`."""
    return np.concatenate([[result.min_distance], result.normal, result.getNearestPoint1(), result.getNearestPoint2()])


def guess_view(requests: Any) -> Array | None:
    """View of coal's guesses (n, 4): directions, and in 8 bytes two vertices; None if laid out otherwise."""
    count = len(requests)
    if count == 0:
        return np.zeros((0, 4))
    direction, vertices = requests[0].cached_gjk_guess, requests[0].cached_support_func_guess
    base = address(direction)
    if vertices.dtype != np.int32 or vertices.shape != (2,) or direction.shape != (3,):
        return None
    # bytes from the guessed direction to the guessed vertices of the two shapes
    if address(requests[count - 1].cached_support_func_guess) != base + REQUEST_STRIDE * (count - 1) + 24:
        return None
    return np.lib.stride_tricks.as_strided(direction, (count, 4), (REQUEST_STRIDE, 8))


def fix_box_inflation() -> None:
    """Make coal use the exact size of boxes in this process, whatever queries follow."""
    # In coal 3.0.2 the first query decides whether boxes are 1 + 1e-10 times as large (a static variable).
    direction = np.full(3, 3.0**-0.5)
    turned = coal.Transform3s(pin.exp3(direction), np.full(3, 3.0))
    here, box = coal.Transform3s(), coal.Box(1.0, 1.0, 1.0)
    for other in (coal.Halfspace(direction, 0.0), coal.Ellipsoid(1.0, 1.0, 1.0)):
        coal.distance(other, here, box, turned, coal.DistanceRequest(), coal.DistanceResult())
