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
        left = self.scene.contacts(result.q, within=-NOTED).distance
        note = f"{-1e3 * left[0]:.1f} mm of overlap are left" if len(left) else ""
        return Removal(
            (result.q,), result.contact_seconds, result.ik_seconds, result.iterations, result.joints, result.pairs, note
        )
