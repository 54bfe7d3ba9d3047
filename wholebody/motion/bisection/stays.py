"""What a posture keeps of the original one: frozen joints, bounds on the deviation, joint limits."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.figures.state import State
from wholebody.motion.frame_terms import FrameTerms
from wholebody.scene import Scene


class Stays:
    """Applies to any posture of a frame what must not change there."""

    def __init__(self, scene: Scene, original: Array, terms: FrameTerms, frozen: tuple[str, ...]) -> None:
        """Find the bounds of every frame; `original` is (n, nq)."""
        self._figure, self._original = scene.figure, original
        state = State(scene.model)
        dofs = scene.figure.dofs(frozen)
        self._low, self._high = np.empty((len(original), scene.model.nv)), np.empty((len(original), scene.model.nv))
        for frame in range(len(original)):
            self._low[frame], self._high[frame] = terms.bounds(frame, state)[:2]
        self._low[:, dofs] = self._high[:, dofs] = 0.0
        self._bounded = bool(np.isfinite(self._low).any() or np.isfinite(self._high).any())

    def applied(self, frame: int, q: Array) -> Array:
        """A copy of a posture (nq,) of a frame, within the bounds and the joint limits; frozen joints are exact."""
        model, original = self._figure.model, self._original[frame]
        if self._bounded:
            low, high = self._low[frame], self._high[frame]
            away = pin.difference(model, original, q)
            if ((away < low) | (away > high)).any():
                q = np.asarray(pin.integrate(model, original, np.clip(away, low, high)))
            q = np.array(q)
            for joint in model.joints[1:]:
                dofs = slice(joint.idx_v, joint.idx_v + joint.nv)
                if (low[dofs] == 0.0).all() and (high[dofs] == 0.0).all():
                    values = slice(joint.idx_q, joint.idx_q + joint.nq)
                    q[values] = original[values]
        return self._figure.clamp(q)
