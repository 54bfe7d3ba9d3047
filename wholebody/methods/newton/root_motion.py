"""The motion of a free root as rows, for measures that count it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.methods.newton.batches import PLACE, TURN, Batch


class RootMotion(Batch):
    """Displacement of a free root from a posture, in its own axes there, less a target; linear in the body.

    Three rows are R_a' (r - r_a), three are 2 vec(conj(e_a) e). At r = r_a and e = e_a their derivative is that of
    Pinocchio's tangent displacement.
    """

    size = 6
    pattern = np.zeros((6, 7), dtype=bool)
    pattern[:3, PLACE] = pattern[3:, TURN] = True

    def __init__(self, body: int, label: str) -> None:
        """Take the number of the root's body; `anchor` says from where it moves."""
        super().__init__(np.array([[body]]), [label])
        self._place, self._target, self._slope = np.zeros(3), np.zeros(6), np.zeros((6, 7))

    def anchor(self, root: Array, target: Array) -> None:
        """Count from the root's placement (7,), position and quaternion x, y, z, w, towards a displacement (6,)."""
        a, b, c, w = root[3:].tolist()
        self._place, self._target = root[:3].copy(), target
        self._slope[:3, PLACE] = pin.Quaternion(root[3:]).toRotationMatrix().T
        self._slope[3:, TURN] = 2.0 * np.array(((w, c, -b, -a), (-c, w, a, -b), (b, -a, w, -c)))

    def residual(self, x: Array) -> Array:  # noqa: D102
        body = x[self.bodies[0, 0]]
        turned = self._slope[3:, TURN] @ body[TURN]
        moved = self._slope[:3, PLACE] @ (body[PLACE] - self._place)
        result: Array = np.concatenate([moved, turned])[None] - self._target
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        result: Array = self._slope[None].copy()
        return result

    def curvature(self, x: Array, force: Array) -> Array:  # noqa: D102
        return np.zeros((1, 7, 7))
