"""Patterns of equations that were laid out and analysed, for contacts that come and go."""

from __future__ import annotations

import time
from collections.abc import Hashable, Sequence

from wholebody.arrays import Array
from wholebody.methods.newton.batches import Batch, Key
from wholebody.methods.newton.linear_algebra.base import LinearAlgebra
from wholebody.methods.newton.linear_algebra.choice import linear_algebra
from wholebody.methods.newton.system import System

REMEMBERED = 32  # cached structures; more = more memory


class Patterns:
    """Systems by what lays them out: each pattern is analysed once while it is remembered.

    Attributes:
        structures: number of patterns that were analysed.
        laying: processor's time of these analyses [s].
    """

    def __init__(self, count: int, weight: Array, algebra: str) -> None:
        """Take the number of bodies, the weights (7 count,) of the least motion, and the name of the factorisation."""
        self._count, self._weight, self._algebra = count, weight, algebra
        self._known: dict[Hashable, tuple[System, LinearAlgebra]] = {}
        self.structures, self.laying = 0, 0.0

    def system(self, laid: Hashable, batches: Sequence[tuple[Batch, Key]]) -> tuple[System, LinearAlgebra]:
        """The system of these equations and its factorisation; `laid` tells patterns apart."""
        if laid not in self._known:
            if len(self._known) >= REMEMBERED:
                self._known.clear()
            began = time.process_time()
            system = System(self._count, batches, self._weight)
            self._known[laid] = (system, linear_algebra(system.pattern, self._algebra))
            self.structures += 1
            self.laying += time.process_time() - began
        return self._known[laid]
