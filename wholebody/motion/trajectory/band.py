"""The compiled loops of `interior_point`, which are compiled or read back without scipy."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or loaded from the cache."""
    from wholebody.motion.trajectory import banded_kernel

    none, places, band = np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros((1, 1))
    begins = np.zeros(1, dtype=np.intp)
    banded_kernel.add_rows(band, places, begins, none, none)
    banded_kernel.add_sums(band, places, begins, none, none, places, begins, none)
    return banded_kernel
