"""Anderson acceleration of the last part of a descent, where steps shrink by the same factor again and again.

The steps know the measures' curvature but not that of the constraints, so the steps f_k near an optimum form a
linear sequence. From the last few, the combination that would have made the step vanish tells where the sequence leads
(Walker and Ni 2011, "Anderson acceleration for fixed-point iterations", type II):

    step = f_k - (dX + dF) c,    c = argmin |f_k - dF c|.
"""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array

DEPTH = 5  # steps remembered; more adds little where a handful of joints settles slowly
STRETCH = 6.0  # an accelerated step is at most this many times the plain one


class Anderson:
    """Remembers plain steps and the ways actually gone."""

    def __init__(self) -> None:
        """Begin with nothing remembered."""
        self.reset()

    def reset(self) -> None:
        """Begin anew: after a rejected step, or when other constraints are at work."""
        self._steps: list[Array] = []
        self._ways: list[Array] = []

    def propose(self, step: Array) -> Array | None:
        """The accelerated step for the plain one (k,), or None while too little is known."""
        self._steps.append(step)
        if len(self._steps) < 3:
            return None
        changes = np.diff(np.array(self._steps[-DEPTH - 1 :]), axis=0).T
        ways = np.array(self._ways[-changes.shape[1] :]).T
        coefficients = np.linalg.lstsq(changes, step, rcond=None)[0]
        fast: Array = step - (ways + changes) @ coefficients
        if not np.isfinite(fast).all():
            return None
        longest = STRETCH * float(np.abs(step).max())
        size = float(np.abs(fast).max())
        return fast if size <= longest else fast * (longest / size)

    def went(self, way: Array) -> None:
        """Remember the way that was gone after the last step was proposed."""
        self._ways.append(way)
