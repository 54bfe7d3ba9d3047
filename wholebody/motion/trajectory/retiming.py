"""Timing of a clip: the same postures one after the other, passed more slowly where something does not hold.

Along a path q(s) the square of the rate b(s) = (ds/dt)^2 is 1 for the clip as it is. Speeds bound b, and torques are
linear in b and its derivative (Verscheure and others 2009). The timing is to stay where nothing is wrong:

    minimise 1/2 sum_k ((1 - b_k)^2 + tau^4 ((b_(k+1) - 2 b_k + b_(k-1)) / h^2)^2) + weight * sum of what loads miss

subject to ``1/stretch^2 <= b_k <= 1``, and b_k at most the square of the rate that speed limits leave.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from wholebody.base.arrays import Array, Indices
from wholebody.motion.trajectory.deviations import Objective
from wholebody.motion.trajectory.interior_point import BandedQP, minimise

SPREAD = 0.2
"""Seconds, tau: how far slowing at one frame spreads to its neighbours; larger = smoother, slower for longer."""


class TimedRows(NamedTuple):
    """Loads that are linear in b and its derivative, of frames (r,): ``gap + speed b + change b' >= 0``, all (r,)."""

    frame: Indices
    gap: Array
    speed: Array
    change: Array


def slowed(most: Array, dt: float, stretch: float, loads: TimedRows | None = None) -> Array:
    """(n,) squares of the rate at which each frame is passed, 1 where the timing stays, within 1/stretch^2."""
    # Speed limits bound it by `most` (n,); what cannot be met of other rows is missed by as little as can be.
    count = len(most)
    least = 1.0 / stretch**2
    if loads is None and (most >= 1.0).all():
        return np.ones(count)
    bands = sp.csr_matrix(Objective(count, np.ones(1), SPREAD, dt, (False, False)).bands)
    low, high = np.zeros(count), np.full(count, 1.0 - least)
    low = np.clip(1.0 - most, 0.0, high)  # unknowns are 1 - b
    P, c, G, lower = bands, np.zeros(count), sp.csr_matrix((0, count)), np.zeros(0)
    if loads is not None and len(loads.gap):
        rate = sp.csr_matrix(np.gradient(np.eye(count), dt, axis=0))[loads.frame]
        rows = sp.diags(loads.speed) @ sp.eye(count, format="csr")[loads.frame] + sp.diags(loads.change) @ rate
        ahead = np.asarray(rows @ np.ones(count)).ravel() + loads.gap  # of b = 1
        slacks = len(loads.gap)
        # a weight of 1e3 of shortfalls meets loads where the largest slowing lets them be; equal splits are unique
        P = sp.block_diag([bands, sp.eye(slacks)])
        c = np.concatenate([c, np.full(slacks, 1e3)])
        G, lower = sp.hstack([-rows, sp.eye(slacks)]), -ahead
        low, high = np.concatenate([low, np.zeros(slacks)]), np.concatenate([high, np.full(slacks, np.inf)])
    program = BandedQP(
        sp.csr_matrix(P), c, sp.csr_matrix(G), lower, np.full(len(lower), np.inf), low, high
    )  # fmt: skip
    z = minimise(program).z[:count]
    return np.asarray(1.0 - np.clip(z, low[:count], high[:count]))


def speed_bounds(steps: Array, slowest: Array, fastest: Array) -> Array:
    """(n,) largest squares of the rate with which every motion (n - 1, nv) keeps to negative and positive bounds."""
    bound = np.where(steps < 0.0, slowest, fastest)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(steps != 0.0, bound / steps, np.inf)
    rate = np.maximum(ratio, 0.0).min(axis=1, initial=np.inf) ** 2
    # Between two frames b is linear, so the rate is largest at one of them.
    return np.asarray(np.minimum(np.concatenate([rate, [np.inf]]), np.concatenate([[np.inf], rate])))


class Timing(NamedTuple):
    """Seconds of the clip as it is for each frame (m,) of the slowed one, and by what factor it is slowed most."""

    times: Array
    largest: float


def timing(b: Array, dt: float) -> Timing | None:
    """When each frame of the slowed clip is, by squares of the rate b (n,), linear in between; None where timing stays.

    The duration becomes a multiple of the time step; for that everything is slowed by less than one step in all.
    """
    if len(b) < 2 or (b >= 1.0 - 1e-3).all():  # it is slowed by next to nothing
        return None
    s, longer = passed(b, 1.0)
    return Timing(s * dt, float(longer / np.sqrt(b).min()))


def passed(b: Array, step: float) -> tuple[Array, float]:
    """Places (m,) in n frames at equal times, of squared rates (n,), and step / their difference."""
    rate = np.sqrt(b)
    begun = np.concatenate([[0.0], np.cumsum(2.0 / (rate[:-1] + rate[1:]))])
    count = max(1, int(np.ceil(begun[-1] / step - 1e-9)))
    at = np.linspace(0.0, begun[-1], count + 1)
    gap = np.clip(np.searchsorted(begun, at, side="right") - 1, 0, len(b) - 2)
    since = at - begun[gap]
    ahead = rate[gap] * since + 0.25 * (b[gap + 1] - b[gap]) * since**2
    return gap + np.clip(ahead, 0.0, 1.0), float(count * step / begun[-1])


def allowance(frames: int, stretch: float) -> float:
    """The largest factor when the duration is made a multiple of the time step; at least 1."""
    return max(1.0, stretch * (frames - 1) / frames)
