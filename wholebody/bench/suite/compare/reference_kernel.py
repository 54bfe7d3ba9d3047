"""A fixed piece of work of the kind that all methods do: matrix products, and distances by coal.

It is timed in every process before each case. Times in units of it can be compared between machines, better than
milliseconds can; and how much it varies within a run says how noisy the machine was.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from wholebody.base.runner import processor_time

SIZE = 64  # of the matrices: about the degrees of freedom of a person
PRODUCTS = 60
QUERIES = 1000  # distances: about the pairs of a person among twenty things
REPEATS = 3  # of which the fastest counts: others were interrupted


def kernel_seconds() -> float:
    """Seconds of the processor that the kernel takes now; about 4 ms on a processor of 2020."""
    work = _made()
    return min(_timed(*work) for _ in range(REPEATS))


def _timed(matrix: Any, pairs: Any) -> float:
    import coal

    request, result = coal.DistanceRequest(), coal.DistanceResult()
    began = processor_time()
    product = matrix
    for _ in range(PRODUCTS):
        product = product @ matrix
    for first, placed_first, second, placed_second in pairs:
        result.clear()
        coal.distance(first, placed_first, second, placed_second, request, result)
    return processor_time() - began


@lru_cache(maxsize=1)
def _made() -> tuple[Any, Any]:
    """An orthogonal matrix, whose powers neither grow nor vanish, and boxes and capsules beside each other."""
    import coal

    rng = np.random.default_rng(0)
    matrix = np.linalg.qr(rng.normal(size=(SIZE, SIZE)))[0]
    shapes = (coal.Box(0.3, 0.2, 0.1), coal.Capsule(0.05, 0.3))
    pairs = []
    for number in range(QUERIES):
        turns = np.linalg.qr(rng.normal(size=(2, 3, 3)))[0]
        turns *= np.sign(np.linalg.det(turns))[:, None, None]
        places = [coal.Transform3s(turn, rng.uniform(-0.5, 0.5, 3)) for turn in turns]
        pairs.append((shapes[number % 2], places[0], shapes[number // 2 % 2], places[1]))
    return matrix, pairs
