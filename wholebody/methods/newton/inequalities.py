"""Inequalities as equations with one slack each: squared slacks (eq. 15) or a logarithmic barrier (eqs. 13 and 14).

In both cases the slack's own equation is scalar and is eliminated analytically. An inequality becomes one row with
an entry on the diagonal,

    grad phi . d + M y = -c,

so that the pattern of the linear system does not change when an inequality becomes active.
"""

from __future__ import annotations

from typing import Literal, Protocol

import numpy as np

from wholebody.base.arrays import Array

FREE = 1e12  # diagonal of an inactive inequality: it is in the pattern, but has no effect
Kind = Literal["slack", "barrier"]
KINDS = ("slack", "barrier")


class Inequalities(Protocol):
    """State of the inequalities phi >= 0 during an iteration."""

    def rows(self, phi: Array) -> tuple[Array, Array]:
        """Right-hand sides c and diagonals M (k,) at values phi (k,)."""

    def begin(self, phi: Array) -> None:
        """A new step begins at values phi (k,)."""

    def correct(self, predicted: Array, multiplier: Array) -> tuple[float, bool]:
        """Update the active set from the phi (k,) and the multipliers (k,) of a linear solution.

        Returns:
            Share of the motion from the last solution to this one, and whether to solve again.
        """

    def share(self) -> float:
        """Share of the step that keeps the slacks positive."""

    def accept(self, share: float, phi: Array) -> None:
        """Take this share of the step; phi (k,) are the new values."""

    def finished(self) -> bool:
        """Whether the inequalities allow the iteration to stop."""


class SquaredSlacks:
    """phi - Y^2 = 0.

    The derivative by Y is -2 Y, so Newton never moves a slack that is zero: the row is then an equation, phi = 0, and
    stays one whatever the sign of its multiplier. So slacks at zero are tested after each linear solution: if the
    multiplier is negative, the slack is released. A slack that the step would take through zero is set to zero; the
    step is shortened to that point, and the remainder is solved again. Away from zero the multiplier of a slack
    vanishes (2 y Y = 0) and so does its row. The first solution of a step that crosses no inequality releases all
    slacks whose multipliers are negative, later ones release the most negative one. The objective of the step decreases
    from system to system then, so no active set repeats (Nocedal and Wright 2006, "Numerical Optimization", 16.5).
    """

    def __init__(self, phi: Array) -> None:
        """Begin with the slacks of the values phi (k,); violated inequalities begin at zero."""
        self.slack = np.sqrt(np.maximum(phi, 0.0))
        self.begin(phi)

    def begin(self, phi: Array) -> None:
        """A new step begins at values phi."""
        self._at, self._releases_all = phi, True
        self.slack[phi <= 0.0] = 0.0

    def rows(self, phi: Array) -> tuple[Array, Array]:
        """A slack at zero gives an equation, any other an inactive row."""
        active = self.slack == 0.0
        return np.where(active, phi, 0.0), np.where(active, 0.0, FREE)

    def correct(self, predicted: Array, multiplier: Array) -> tuple[float, bool]:
        """Set slacks to zero, or release them."""
        active = self.slack == 0.0
        crossing = ~active & (predicted < -1e-9)  # m or rad
        if crossing.any():
            way = np.full(len(active), np.inf)
            at = np.maximum(self._at[crossing], 0.0)
            way[crossing] = at / np.maximum(at - predicted[crossing], 1e-300)
            first = float(way.min())
            self.slack[way <= first + 0.01] = 0.0  # those that become zero soon after the first become active with it
            self._at = self._at + first * (predicted - self._at)
            return first, True
        self._at = predicted
        leave = np.flatnonzero(active & (multiplier < -1e-12))
        if not len(leave):
            return 1.0, False
        if not self._releases_all:
            leave = leave[multiplier[leave].argmin()][None]
        self._releases_all = False
        self.slack[leave] = 1.0
        self._at[leave] = np.maximum(self._at[leave], 0.0)
        return 1.0, True

    def share(self) -> float:
        """The whole step."""
        return 1.0

    def accept(self, share: float, phi: Array) -> None:
        """Slacks away from zero follow their values."""
        active = (self.slack == 0.0) & (phi < 1e-2)  # m or rad: one that is farther is released
        self.slack = np.where(active, 0.0, np.sqrt(np.maximum(phi, 0.0)))

    def finished(self) -> bool:
        """Always."""
        return True


class LogBarrier:
    """phi - s = 0 with -mu log s in the objective, mu decreasing to zero; s y = mu linearised in both (primal-dual)."""

    def __init__(self, phi: Array) -> None:
        """Begin with positive slacks; the equation phi = s corrects values phi (k,) that are not positive."""
        self.slack = np.maximum(phi, 1e-2)
        self.barrier = 1e-3
        self.multiplier = self.barrier / self.slack
        self._slack_step = np.zeros(len(phi))
        self._multiplier_step = np.zeros(len(phi))

    def rows(self, phi: Array) -> tuple[Array, Array]:
        """Rows after substitution of the slack's step (mu - s y) / y."""
        return phi - self.slack - self.barrier / self.multiplier, self.slack / self.multiplier

    def begin(self, phi: Array) -> None:
        """Nothing to prepare."""

    def correct(self, predicted: Array, multiplier: Array) -> tuple[float, bool]:
        """Store the steps; no second solution is needed."""
        self._slack_step = (self.barrier - self.slack * multiplier) / self.multiplier
        self._multiplier_step = multiplier - self.multiplier
        return 1.0, False

    def share(self) -> float:
        """As far as slacks stay positive."""
        return _to_boundary(self.slack, self._slack_step)

    def accept(self, share: float, phi: Array) -> None:
        """Move slacks and multipliers, and lower the barrier."""
        self.slack = self.slack + share * self._slack_step
        self.multiplier = self.multiplier + _to_boundary(self.multiplier, self._multiplier_step) * self._multiplier_step
        self.barrier = max(0.15 * self.barrier, 1e-12)  # a faster fall takes fewer steps, which are less centred

    def finished(self) -> bool:
        """Whether all products of slack and multiplier are small [m]."""
        return len(self.slack) == 0 or float((self.slack * self.multiplier).max()) <= 1e-10


def _to_boundary(values: Array, step: Array) -> float:
    """Share of a step (k,) that keeps positive values (k,) positive: at most 0.95 of the way to the boundary."""
    falling = step < 0.0
    return float(min(1.0, (-0.95 * values[falling] / step[falling]).min(initial=1.0)))


def inequalities(kind: Kind, phi: Array) -> Inequalities:
    """The first state at values phi (k,)."""
    return LogBarrier(phi) if kind == "barrier" else SquaredSlacks(phi)
