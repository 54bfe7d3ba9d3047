"""The products of J D^-1 J', as a compiled loop: see `gram`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.arrays import Array
from wholebody.compiled import compiled

Places = NDArray[np.int32]


@compiled()
def sum_products(
    scaled: Array, values: Array, first: Places, second: Places, starts: Places, filled: Places, data: Array
) -> None:
    """Write the sums of scaled[first] values[second] between starts into data, at the indices `filled`."""
    for k in range(len(filled)):
        total = 0.0
        for p in range(starts[k], starts[k + 1]):
            total += scaled[first[p]] * values[second[p]]
        data[filled[k]] = total
