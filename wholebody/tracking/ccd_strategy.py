"""overlap="ccd": cyclic coordinate descent removes the overlap of an articulated figure limb by limb."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.methods.ccd.frames import resolve_overlap
from wholebody.scene.scene import Scene
from wholebody.tracking.frame import Resolution


class CCDStrategy:
    """Follows tracked postures by the loop of Schmidl and Lin (`wholebody.methods.ccd.resolver`)."""

    sweep_tolerance = 8e-4

    def __init__(self, scene: Scene, shown: Array, dt: float, seed: int) -> None:
        """Prepare for frames of `dt` seconds.

        Args:
            scene: the figure among things.
            shown: (nq,) the present posture.
            dt: seconds from frame to frame.
            seed: of the order of the chains.
        """
        self.scene = scene
        # largest velocity, rad/s, with which a joint moves away from the tracked one or returns to it: fast
        # enough to return from 2 rad in half a second, and slow enough not to look like a jump
        self._largest_motion = np.full(scene.model.nv, 4.0 * dt)
        if scene.figure.root == "free":
            self._largest_motion[:3] = 2.0 * dt  # root speed, m/s
        self._tracked = shown
        self._rng = np.random.default_rng(seed)

    def resolve(self, shown: Array, tracked: Array) -> Resolution:
        """One frame from the overlap-free posture `shown` towards `tracked`, both (nq,)."""
        largest_motion = self._largest_motion + np.abs(pin.difference(self.scene.model, self._tracked, tracked))
        self._tracked = tracked
        result = resolve_overlap(self.scene, shown, tracked, self._rng, largest_motion)
        # remaining depth, metres, from which a frame's note reports it
        note = f"{1e3 * result.deepest:.1f} mm of overlap are left" if result.deepest > 1e-3 else ""
        return Resolution(
            candidates=(result.q,),
            contact_seconds=result.contact_seconds,
            solve_seconds=result.ik_seconds,
            iterations=result.iterations,
            joints=result.joints,
            pairs=result.pairs,
            note=note,
            swept=result.swept,
        )
