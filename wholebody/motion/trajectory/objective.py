"""What a trajectory minimises: the deviation from the original, and the acceleration of that deviation.

    f(x) = 1/2 sum_t sum_i w_i (x_ti^2 + tau^4 ((x_(t+1)i - 2 x_ti + x_(t-1)i) / dt^2)^2)

The second difference of x is the deviation of the acceleration from the original's. Outside of a window x is zero, so
that posture, velocity and acceleration go over into the original ones at its ends; where a window ends with the clip,
its end is free. A push at one frame dies out as exp(-t / (sqrt(2) tau)).
"""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array


def second_differences(frames: int, seam_before: bool, seam_after: bool) -> Array:
    """(k, n) second differences over n frames, those across a seam included: beyond it everything is zero."""
    full = np.zeros((frames + 2, frames + 4))
    rows = np.arange(frames + 2)
    full[rows, rows], full[rows, rows + 1], full[rows, rows + 2] = 1.0, -2.0, 1.0
    inside = full[0 if seam_before else 2 : None if seam_after else frames, 2 : frames + 2]
    return inside


class Objective:
    """The objective of one window. It is quadratic in the deviations and does not change.

    Attributes:
        bands: (n, n) of a degree of freedom of weight 1: the second derivative over the frames, five bands.
        weights: (nv,) of the degrees of freedom.
    """

    def __init__(self, frames: int, weights: Array, time: float, dt: float, seams: tuple[bool, bool]) -> None:
        """Lay out the bands.

        Args:
            frames: of the window.
            weights: (nv,) positive.
            time: tau, seconds.
            dt: seconds from frame to frame.
            seams: whether the clip goes on before and after the window.
        """
        differences = second_differences(frames, *seams)
        self.bands: Array = np.eye(frames) + (time / dt) ** 4 * differences.T @ differences
        self.weights = weights

    def value(self, x: Array) -> float:
        """Of deviations (n, nv)."""
        return 0.5 * float(np.einsum("ti,ti,i->", x, self.bands @ x, self.weights))
