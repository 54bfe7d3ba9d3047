"""Anderson acceleration (Walker and Ni 2011, type II) of steps that form a linear sequence."""

from __future__ import annotations

from math import isfinite

import numpy as np

from wholebody.base.arrays import Array

DEPTH = 5  # steps remembered; more adds little where a handful of joints settles slowly
STRETCH = 6.0  # an accelerated step is at most this many times the plain one


class Anderson:
    """Remembers plain steps and the displacements actually made."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the past steps: after a rejected step, or far from the goals."""
        self._step: Array | None = None  # whose displacement is not known yet
        self._steps: list[Array] = []
        self._displacements: list[Array] = []

    def propose(self, step: Array) -> Array | None:
        """The accelerated step for the plain one (k,), at most `STRETCH` times as long; None while too little known."""
        self._step = step
        if len(self._steps) < 2:
            return None
        steps, displacements = np.array([*self._steps[-DEPTH:], step]), np.array(self._displacements[-DEPTH:])
        changes = steps[1:] - steps[:-1]
        coefficients = np.linalg.lstsq(changes.T, step, rcond=None)[0]
        fast: Array = step - coefficients @ (displacements + changes)
        longest, size = STRETCH * float(np.abs(step).max()), float(np.abs(fast).max())
        if not isfinite(size):
            return None
        return fast if size <= longest else fast * (longest / size)

    def record(self, displacement: Array) -> None:
        """Remember the displacement (k,) that was made after the last step was proposed."""
        if self._step is not None:
            self._steps.append(self._step)
            self._displacements.append(displacement)
            self._step = None
