"""overlap="ccd": the overlap of an articulated figure is removed limb by limb by cyclic coordinate descent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.interaction.removal import Removal
from wholebody.methods.ccd.overlap import remove_overlap
from wholebody.scene import Scene

Array = NDArray[np.float64]

NOTED = 1e-3
"""Depth left, metres, that a frame's note speaks of."""


class LimbByLimb:
    """Follows tracked postures by the loop of Schmidl and Lin, see `wholebody.methods.ccd.overlap`."""

    graze = 8e-4

    def __init__(self, scene: Scene, seed: int) -> None:
        """Set up; the seed is of the order of the chains."""
        self.scene = scene
        self._rng = np.random.default_rng(seed)

    def remove(self, shown: Array, tracked: Array) -> Removal:
        """One frame from the overlap-free posture `shown` towards `tracked`, both (nq,)."""
        result = remove_overlap(self.scene, shown, tracked, self._rng)
        note = f"{1e3 * result.deepest:.1f} mm of overlap are left" if result.deepest > NOTED else ""
        return Removal(
            ways=(result.q,),
            contact_seconds=result.contact_seconds,
            solve_seconds=result.ik_seconds,
            iterations=result.iterations,
            joints=result.joints,
            pairs=result.pairs,
            note=note,
            swept=result.swept,
        )
