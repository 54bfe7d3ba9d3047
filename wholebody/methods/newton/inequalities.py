"""Inequalities as equations with a slack each: squared slacks (eq. 15) or a logarithmic barrier (eqs. 13 and 14).

Either way the slack's own equation is scalar and is eliminated by hand. What is left of an inequality is one row with
an entry on the diagonal,

    grad phi . d + M y = -c,

so that the pattern of the linear system does not change when an inequality becomes active.
"""

from __future__ import annotations

from typing import Literal, Protocol

import numpy as np

from wholebody.arrays import Array

FREE = 1e12  # diagonal of an inequality that is not at work: it takes part in the pattern, and in nothing else
RELEASE = 1e-12  # multiplier below which an active inequality is let go; larger = held longer
CROSSED = 1e-9  # m or rad: predicted values below minus this make an inequality active
TOGETHER = 0.01  # of a step: inequalities that are met this much after the first become active with it
STAYS = 1e-2  # m or rad: an active inequality that finds itself farther away than this is free
FRACTION = 0.95  # of the way to the edge that a barrier step may go; larger = faster and nearer to the edge
LEAST_BARRIER = 1e-11  # m: product of slack and multiplier at which the barrier has done its work
BARRIER_FALL = 0.15  # factor of the barrier from step to step; smaller = fewer steps, less centred
Kind = Literal["slack", "barrier"]
KINDS = ("slack", "barrier")


class Inequalities(Protocol):
    """State of the inequalities phi >= 0 during an iteration."""

    def rows(self, phi: Array) -> tuple[Array, Array]:
        """Right-hand sides c and diagonals M (k,) at values phi (k,)."""

    def begin(self, phi: Array) -> None:
        """A new step begins at values phi (k,)."""

    def correct(self, predicted: Array, multiplier: Array) -> tuple[float, bool]:
        """Look at the phi (k,) that a linear solution leads to, and its multipliers (k,).

        Returns:
            How far to go from the last solution to this one, and whether to solve again.
        """

    def share(self) -> float:
        """Share of the step that keeps the slacks positive."""

    def accept(self, share: float, phi: Array) -> None:
        """Go this share of the step; phi (k,) are the new values."""

    def finished(self) -> bool:
        """Whether the iteration may stop as far as the inequalities go."""


class SquaredSlacks:
    """phi - Y^2 = 0.

    The derivative by Y is -2 Y, so Newton never moves a slack that is zero: the row is then an equation, phi = 0, and
    stays one whatever its multiplier says. So a slack at zero is looked at after each linear solution: a negative
    multiplier pulls where it may only push, and the slack is set free. A slack that the step would take through zero is
    set to zero, the step goes that far, and the rest of it is solved again. Away from zero the multiplier of a slack
    vanishes (2 y Y = 0) and so does its row. The objective of the step falls from system to system, so none is met
    twice (Nocedal and Wright 2006, "Numerical Optimization", section 16.5).
    """

    def __init__(self, phi: Array) -> None:
        """Begin with the slacks that fit the values phi (k,); violated inequalities begin at zero."""
        self.slack = np.sqrt(np.maximum(phi, 0.0))
        self._at = phi

    def begin(self, phi: Array) -> None:
        """A new step begins at values phi."""
        self._at = phi
        self.slack[phi <= 0.0] = 0.0

    def rows(self, phi: Array) -> tuple[Array, Array]:
        """A slack at zero: an equation. Any other: a row that is not at work."""
        active = self.slack == 0.0
        return np.where(active, phi, 0.0), np.where(active, 0.0, FREE)

    def correct(self, predicted: Array, multiplier: Array) -> tuple[float, bool]:
        """Set slacks to zero, or free."""
        active = self.slack == 0.0
        crossing = ~active & (predicted < -CROSSED)
        if crossing.any():
            way = np.full(len(active), np.inf)
            at = np.maximum(self._at[crossing], 0.0)
            way[crossing] = at / np.maximum(at - predicted[crossing], 1e-300)
            first = float(way.min())
            self.slack[way <= first + TOGETHER] = 0.0
            self._at = self._at + first * (predicted - self._at)
            return first, True
        self._at = predicted
        if not (active & (multiplier < -RELEASE)).any():
            return 1.0, False
        leave = int(np.where(active, multiplier, 0.0).argmin())
        self.slack[leave] = 1.0
        self._at[leave] = max(self._at[leave], 0.0)
        return 1.0, True

    def share(self) -> float:
        """All of it."""
        return 1.0

    def accept(self, share: float, phi: Array) -> None:
        """Slacks away from zero follow their values."""
        active = (self.slack == 0.0) & (phi < STAYS)
        self.slack = np.where(active, 0.0, np.sqrt(np.maximum(phi, 0.0)))

    def finished(self) -> bool:
        """Always."""
        return True


class LogBarrier:
    """phi - s = 0 with -mu log s in the objective, mu falling to nothing; s y = mu linearised in both (primal-dual)."""

    def __init__(self, phi: Array) -> None:
        """Begin inside; values phi (k,) that are not positive are reached through the equation phi = s."""
        self.slack = np.maximum(phi, 1e-2)
        self.barrier = 1e-3
        self.multiplier = self.barrier / self.slack
        self._slack_step = np.zeros(len(phi))
        self._multiplier_step = np.zeros(len(phi))

    def rows(self, phi: Array) -> tuple[Array, Array]:
        """The slack's step (mu - s y) / y put into the row."""
        return phi - self.slack - self.barrier / self.multiplier, self.slack / self.multiplier

    def begin(self, phi: Array) -> None:
        """Nothing to prepare."""

    def correct(self, predicted: Array, multiplier: Array) -> tuple[float, bool]:
        """Remember the steps; nothing to solve again."""
        self._slack_step = (self.barrier - self.slack * multiplier) / self.multiplier
        self._multiplier_step = multiplier - self.multiplier
        return 1.0, False

    def share(self) -> float:
        """As far as slacks stay positive."""
        falling = self._slack_step < 0.0
        ways = -FRACTION * self.slack[falling] / self._slack_step[falling]
        return float(min(1.0, ways.min(initial=1.0)))

    def accept(self, share: float, phi: Array) -> None:
        """Move slacks and multipliers, and lower the barrier."""
        falling = self._multiplier_step < 0.0
        ways = -FRACTION * self.multiplier[falling] / self._multiplier_step[falling]
        self.slack = self.slack + share * self._slack_step
        self.multiplier = self.multiplier + min(1.0, ways.min(initial=1.0)) * self._multiplier_step
        self.barrier = max(BARRIER_FALL * self.barrier, 0.1 * LEAST_BARRIER)

    def finished(self) -> bool:
        """Once the barrier is gone."""
        return len(self.slack) == 0 or float((self.slack * self.multiplier).max()) <= 10.0 * LEAST_BARRIER


def inequalities(kind: Kind, phi: Array) -> Inequalities:
    """The state to begin with at values phi (k,)."""
    return LogBarrier(phi) if kind == "barrier" else SquaredSlacks(phi)
