"""Processor's time of a call."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np


def median_us(call: Callable[[], object], repeats: int) -> float:
    """Median time of a call [us]; one before is not counted."""
    call()
    times = []
    for _ in range(repeats):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return 1e6 * float(np.median(times))
