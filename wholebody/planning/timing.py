"""The fastest timing of a path within limits of velocity and acceleration (TOPP-RA, Pham and Pham 2018).

Along a path x(s) with b = (ds/dt)^2 and u = d2s/dt2, velocities x' sqrt(b) bound b, and accelerations x' u + x'' b are
linear in both. A backward pass finds the largest b at each point from which the path can be ended at rest; a forward
pass accelerates as much as these let it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.interpolate import make_interp_spline

from wholebody.assessment.motion import velocities
from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.fields import Checked, Range
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.methods.control import BUDGET
from wholebody.motion.trajectory.retiming import passed
from wholebody.planning.smoothing import places
from wholebody.tasks.base import Bound


@dataclass(frozen=True)
class Pace(Checked):
    """How fast a planned motion may be.

    Attributes:
        velocity: largest of every joint and of the root, rad/s and m/s; None for the limits of the figure, and 2 where
            it has none.
        acceleration: largest of every joint and of the root, rad/s^2 and m/s^2.
        dt: seconds from frame to frame.

    Raises:
        InputError: a value out of range.

    Examples:
        >>> calm = wb.planning.Pace(velocity=1.0, acceleration=4.0)
    """

    velocity: Annotated[float, Range(1e-3, 1e3, "rad/s")] | None = None
    acceleration: Annotated[float, Range(1e-3, 1e5, "rad/s^2")] = 10.0
    dt: Annotated[float, checks.time_step] = 1.0 / 60.0

    def fastest(self, figure: Figure) -> Array:
        """(nv,) largest velocities; a limit of the figure of 0 counts as none."""
        checks.instance(figure, Figure, "fastest: figure", "load one with wb.load('human')")
        own = np.array(figure.model.velocityLimit, dtype=float).reshape(-1)
        usual = 2.0 if self.velocity is None else self.velocity  # rad/s, m/s: of joints without a limit of their own
        own = np.where((own > 0.0) & (own < 1e9), own, usual)  # rad/s, m/s: a free root has the largest number
        return own if self.velocity is None else np.minimum(own, self.velocity)


FINER = 4  # places of a path between two postures at which limits are kept; fewer = all is slowed for what exceeds them
STILL = 1e-7  # rad, m: a displacement that counts as none


class Timing:
    """When the places of a path are passed: a cubic spline through postures (m, nq), from rest to rest."""

    def __init__(self, figure: Figure, path: Array, pace: Pace, bounds: Sequence[Bound] = ()) -> None:
        """Take a path (m, nq), and bounds of the displacement from frame to frame."""
        self._figure, self._path, self._pace, self._bounds = figure, path, pace, bounds
        knots = np.arange(len(path))
        self._spline = make_interp_spline(knots, places(figure.model, path), k=min(3, len(path) - 1))
        limits = pace.fastest(figure), np.full(figure.model.nv, pace.acceleration)
        at = np.linspace(0.0, knots[-1], FINER * knots[-1] + 1)
        self._b = squared_rates(self._spline(at, 1) / FINER, self._spline(at, 2) / FINER**2, *limits)

    def frames(self, slower: float) -> Array:
        """Postures (frames, nq), `pace.dt` apart, all of it so many times as slow as the limits let it be."""
        model, path = self._figure.model, self._path
        between = self._spline(passed(self._b, self._pace.dt / slower)[0] / FINER)[1:-1]
        found = [self._figure.clamp(np.asarray(pin.integrate(model, path[0], place))) for place in between]
        return np.array([path[0], *found, path[-1]])

    def within(self, corrected: Callable[[Array], Array] | None = None) -> Array:
        """The frames of the fastest timing whose differences keep the limits, each corrected (nq,) where they do."""
        slower, exact = 1.0, corrected is None
        for _ in range(11):  # a motion whose derivatives keep the limits is slowed until its frames do
            left, q = BUDGET.left, self.frames(slower)
            if exact and corrected is not None:
                for k in range(1, len(q) - 1):
                    if BUDGET.over:
                        return q
                    q[k] = corrected(q[k])
            use = used(self._figure, q, self._pace, self._bounds)
            over = max(use.velocity, np.sqrt(use.acceleration), use.step)
            if (over <= 1.0 and exact) or not np.isfinite(over):
                break
            if exact and corrected is not None and over > 3.0:  # one jumps, however slow all else is
                break
            if use.step > 1.0 and 5.0 * (left - BUDGET.left) * over > BUDGET.left:  # frames of which none is judged
                break
            slower *= (1.01 if exact else 1.001) * max(over, 1.0)  # corrections differ from timing to timing
            exact = exact or over <= 1.0
        return q


def least_time(figure: Figure, path: Sequence[Array], pace: Pace) -> float:
    """Seconds that no motion along a path of postures (nq,) is sooner than, as joints rest where they turn back."""
    most, limit = 0.0, pace.acceleration
    for steps, speed in zip(np.diff(places(figure.model, path), axis=0).T, pace.fastest(figure), strict=True):
        senses = np.sign(steps)
        runs = np.bincount(np.cumsum(np.diff(senses, prepend=senses[:1]) != 0.0), np.abs(steps), 1)
        cruised = runs > speed**2 / limit
        most = max(most, float(np.where(cruised, runs / speed + speed / limit, 2.0 * np.sqrt(runs / limit)).sum()))
    return most


class Use(NamedTuple):
    """The largest velocity, acceleration and displacement between two frames of a motion in parts of their limits."""

    velocity: float
    acceleration: float
    step: float = 0.0


def used(figure: Figure, q: Array, pace: Pace, bounds: Sequence[Bound] = ()) -> Use:
    """What postures (frames, nq) use, by their differences; they begin and end at rest."""
    speed, still = velocities(figure.model, q, pace.dt), np.zeros((1, figure.model.nv))
    change = np.diff(np.concatenate([still, speed, still]), axis=0) / pace.dt
    fast = np.abs(speed) / pace.fastest(figure)
    step = max((_step(figure, q, pace, bound) for bound in bounds), default=0.0)
    return Use(float(fast.max(initial=0.0)), float(np.abs(change).max(initial=0.0) / pace.acceleration), step)


def _step(figure: Figure, q: Array, pace: Pace, bound: Bound) -> float:
    """The largest displacement between two of postures (frames, nq) in parts of what a bound lets it be."""
    state, most = State(figure.model), 0.0
    for here, there in pairwise(q):
        low, high = bound.bounds(state.update(here), pace.dt)
        away = np.asarray(pin.difference(figure.model, here, there))
        moves = np.abs(away) > STILL
        limit = np.maximum(np.where(away > 0.0, high, -low), 0.0)[moves]
        with np.errstate(divide="ignore"):
            most = max(most, float((np.abs(away[moves]) / limit).max(initial=0.0)))
    return most


def squared_rates(first: Array, second: Array, velocity: Array, acceleration: Array) -> Array:
    """(m,) largest squared rates within velocities and accelerations (nv,); `first`, `second` (m, nv)."""
    count = len(first)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        most = np.where(first != 0.0, velocity / np.abs(first), np.inf).min(axis=1, initial=np.inf) ** 2
        # a constant rate is within the accelerations, so that none forces another where a joint turns back
        curved = np.where(second != 0.0, acceleration / np.abs(second), np.inf).min(axis=1, initial=np.inf)
    most = np.minimum(np.minimum(most, curved), 1e12)
    most[[0, -1]] = 0.0
    for k in range(count - 2, -1, -1):
        most[k] = min(most[k], _largest(first[k], second[k], acceleration, most[k + 1]))
    b = np.zeros(count)
    for k in range(count - 1):
        high, slope = _bounds_of_u(first[k], second[k], acceleration)
        b[k + 1] = min(most[k + 1], b[k] + 2.0 * float((high + slope * b[k]).min(initial=1e12)))
    return b


def _bounds_of_u(first: Array, second: Array, acceleration: Array) -> tuple[Array, Array]:
    """Coefficients: u lies between ``slope b - high`` and ``slope b + high``, for each joint that moves."""
    moving = np.abs(first) > 1e-12
    return acceleration[moving] / np.abs(first[moving]), -second[moving] / first[moving]


def _largest(first: Array, second: Array, acceleration: Array, following: float) -> float:
    """The largest b from which some u leads to at most a b of `following` at the next point."""
    high, slope = _bounds_of_u(first, second, acceleration)
    low, slope = np.append(-high, 0.0), np.append(slope, -0.5)  # 0 <= b + 2 u <= following
    high = np.append(high, 0.5 * following)
    steeper = slope[:, None] - slope[None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = np.where(steeper > 1e-12, (high[None, :] - low[:, None]) / steeper, np.inf)
    return float(max(0.0, crossing.min()))
