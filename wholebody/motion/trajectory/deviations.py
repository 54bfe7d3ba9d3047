"""Postures of a clip as deviations from the original postures, and what is minimised of these deviations.

The posture of frame t is ``q_t = integrate(r_t, x_t)`` with the original posture r_t and the deviation x_t (nv,).
For a joint of one degree of freedom x_t is a difference of angles. For a free root it is the logarithm of the motion
from the original placement. So deviations and their differences over time are linear in the unknowns.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices


class Chart:
    """The original postures of some frames, and the deviations from them.

    Attributes:
        model: Pinocchio's model.
        original: (n, nq) the original postures.
        curved: indices in the tangent of the joints whose postures are no vectors, such as a free root.
    """

    def __init__(self, model: pin.Model, original: Array) -> None:
        self.model, self.original = model, original
        dofs = [range(joint.idx_v, joint.idx_v + joint.nv) for joint in list(model.joints)[1:] if joint.nq != joint.nv]
        self.curved: Indices = np.array([index for part in dofs for index in part], dtype=np.intp)
        self._both = np.ix_(self.curved, self.curved)

    def __len__(self) -> int:
        return len(self.original)

    @cached_property
    def steps(self) -> Array:
        """(n - 1, nv) from each original posture to the next."""
        pairs = zip(self.original[:-1], self.original[1:], strict=True)
        return np.array([pin.difference(self.model, *pair) for pair in pairs]).reshape(-1, self.model.nv)

    def posture(self, frame: int, x: Array) -> Array:
        """(nq,) the posture of a frame with the deviation x (nv,)."""
        return np.asarray(pin.integrate(self.model, self.original[frame], x))

    def postures(self, x: Array) -> Array:
        """(n, nq) the postures of all frames with the deviations x (n, nv)."""
        return np.array([self.posture(frame, one) for frame, one in enumerate(x)])

    def deviation(self, frame: int, q: Array) -> Array:
        """(nv,) of a posture (nq,) from the original one of a frame."""
        return np.asarray(pin.difference(self.model, self.original[frame], q))

    def carried(self, frame: int, x: Array, rows: Array) -> Array:
        """Derivatives (r, nv) with respect to the deviation x (nv,) of a frame, of rows (r, nv) in its tangent."""
        curved = self.curved
        if not len(curved) or not x[curved].any():
            return rows
        turned = np.asarray(pin.dIntegrate(self.model, self.original[frame], x, pin.ARG1))
        result = np.array(rows)  # but for its curved joints the matrix is the identity
        result[:, curved] = rows[:, curved] @ turned[self._both]
        return result

    def between(self, before: Array, after: Array, share: float) -> tuple[Array, Array, Array]:
        """The posture at a fraction of the path between two (nq,), and its derivatives (nv, nv) by both."""
        model = self.model
        way = np.asarray(pin.difference(model, before, after))
        q = np.asarray(pin.integrate(model, before, share * way))
        nv = model.nv
        if not len(self.curved):
            return q, (1.0 - share) * np.eye(nv), share * np.eye(nv)
        from_way = share * np.asarray(pin.dIntegrate(model, before, share * way, pin.ARG1))
        from_before = np.asarray(pin.dIntegrate(model, before, share * way, pin.ARG0))
        first = from_before + from_way @ np.asarray(pin.dDifference(model, before, after, pin.ARG0))
        second = from_way @ np.asarray(pin.dDifference(model, before, after, pin.ARG1))
        return q, first, second


class Objective:
    """The objective of one window. It is quadratic in the deviations and does not change.

    Attributes:
        bands: (n, n) of a degree of freedom of weight 1: the second derivative over the frames, five bands.
        slope: (n, nv) derivative without deviations, of weight 1: what the frames beyond the seams ask for.
        weights: (nv,) of the degrees of freedom.
    """

    def __init__(
        self, frames: int, weights: Array, time: float, dt: float, seams: tuple[bool, bool], ends: Array | None = None
    ) -> None:  # fmt: skip
        """Lay out the bands, for weights (nv,) and tau `time` [s]; `ends` (4, nv): deviations beside the window."""
        # second differences over the frames and two on both sides, those across a seam included
        full, rows, scale = np.zeros((frames + 2, frames + 4)), np.arange(frames + 2), (time / dt) ** 4
        full[rows, rows], full[rows, rows + 1], full[rows, rows + 2] = 1.0, -2.0, 1.0
        full = full[0 if seams[0] else 2 : None if seams[1] else frames]
        inside, ends = full[:, 2:-2], np.zeros((4, len(weights))) if ends is None else ends
        beyond = full[:, [0, 1, -2, -1]] @ ends
        self.bands: Array = np.eye(frames) + scale * inside.T @ inside
        self.slope: Array = scale * inside.T @ beyond
        self.weights, self._least = weights, 0.5 * scale * float((beyond**2 @ weights).sum())

    def value(self, x: Array) -> float:
        """Of deviations (n, nv)."""
        return self._least + float(np.einsum("ti,ti,i->", x, 0.5 * self.bands @ x + self.slope, self.weights))
