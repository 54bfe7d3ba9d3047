"""The products of J D^-1 J' as a compiled loop: what `Gram` does in array code, without the arrays of products.

Needs numba (the extra "fast"), which compiles it at the first use and keeps the result beside this file. Both ways give
the same sums to rounding; the array code is the reference.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Places = NDArray[np.int32]


@njit(cache=True)  # type: ignore[untyped-decorator]
def sum_products(
    scaled: Array, values: Array, first: Places, second: Places, starts: Places, filled: Places, data: Array
) -> None:
    """Put the sums of scaled[first] values[second] between starts into data, at the places `filled`."""
    for k in range(len(filled)):
        total = 0.0
        for p in range(starts[k], starts[k + 1]):
            total += scaled[first[p]] * values[second[p]]
        data[filled[k]] = total
