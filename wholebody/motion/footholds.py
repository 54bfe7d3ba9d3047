"""Where points of a moving body rest on the ground: found by their speed and their height above what is below them.

A point rests while it is slow (with hysteresis) and low. Low means: not higher than the lowest rest nearby by more than
a few centimetres; or the body came down onto it, or was borne by nothing else. So it is found on stairs, chairs and
uneven ground too, and a foot that is held up in the air, which is reached from below, does not rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.motion.windows import Window, long_runs, runs

NEARBY = 0.8  # m: ground farther away than a step says nothing of the height here
BEFORE = 0.4  # s: how long before and after a rest a point is looked at: half of a swing
CAME_DOWN = 0.006  # m: by which a point that rests on higher ground was above it before and after
SPAN = 1 / 30  # s before and after a frame between which its speed is that of a rest, whatever the rate of frames
WAITED = 0.25  # s: a body that nothing lower bears for longer is borne by what rests higher


class RestLimits(NamedTuple):
    """What counts as rest."""

    speed: float = 0.15  # m/s, largest speed; a rest begins where the speed falls below two thirds of it
    height: float = 0.05  # m, largest height above the lowest rest nearby
    least: float = 0.1  # s, shortest rest
    slid: float = 0.08  # m: a point that goes on farther while it is slow has made a step, and rests at two places


def speeds(places: Array, dt: float, span: float = 0.0) -> Array:
    """(n, ...) speeds of places (n, ..., 3), `dt` seconds apart: from `span` seconds before a frame to after it.

    It is a frame before and after at least; none is beyond the ends.
    """
    if len(places) < 2:
        return np.zeros(places.shape[:-1])
    half, frames = max(1, round(span / dt)), np.arange(len(places))
    first, last = np.maximum(frames - half, 0), np.minimum(frames + half, len(places) - 1)
    times = dt * (last - first).reshape(-1, *(1,) * (places.ndim - 2))
    return np.asarray(np.linalg.norm(places[last] - places[first], axis=-1) / times)


def resting(places: Array, dt: float, limits: RestLimits, kinds: Sequence[int], allowed: Mask | None = None) -> Mask:
    """(n, p) when points (n, p, 3) rest, `dt` seconds apart; points of one kind are equally high on level ground.

    They rest only where that is `allowed` (n, p).
    """
    found = np.zeros(places.shape[:2], dtype=bool)
    may = np.ones_like(found) if allowed is None else allowed
    rests = [slow(places[:, k], dt, limits) & may[:, k] for k in range(places.shape[1])]
    if not rests:
        return found
    marks = np.stack(rests, axis=1)
    stands = [(k, run, lowest(places[run.first : run.end, k, 2])) for k, mask in enumerate(rests) for run in runs(mask)]
    kind = np.array(kinds, dtype=int)
    lows = _level_of_kinds(stands, kind)
    base = np.array([low - lows[kind[k]] for k, _, low in stands])
    middles = np.array([places[run.first : run.end, k, :2].mean(axis=0) for k, run, _ in stands]).reshape(-1, 2)
    accepted = np.zeros(len(stands), dtype=bool)
    for number in np.argsort(base, kind="stable").tolist():
        k, run, low = stands[number]
        near = accepted & (np.linalg.norm(middles - middles[number], axis=1) < NEARBY)
        floor = float(base[near].max(initial=-np.inf)) if near.any() else float(base.min())
        lone = not near.any() and not accepted.any()
        if lone or base[number] <= floor + limits.height or _bears(places[:, k, 2], run, low, dt, found, marks):
            accepted[number] = True
            frames = np.arange(run.first, run.end)
            found[frames[places[frames, k, 2] <= low + limits.height], k] = True
    return np.stack([long_runs(column, max(1, round(limits.least / dt))) for column in found.T], axis=1)


def slow(places: Array, dt: float, limits: RestLimits) -> Mask:
    """(n,) rest frames of a point (n, 3) by speed alone; the fastest frames of a slow motion separate two rests."""
    speed = speeds(places, dt, SPAN)
    low, high = speed <= 2.0 / 3.0 * limits.speed, speed <= limits.speed
    kept = np.zeros(len(speed), dtype=bool)
    for run in runs(high):
        kept[run.first : run.end] = bool(low[run.first : run.end].any())
    waiting = runs(kept)
    while waiting:
        first, last = waiting.pop()
        if last - first > 2 and np.linalg.norm(np.ptp(places[first:last], axis=0)) > limits.slid:
            cut = first + 1 + int(speed[first + 1 : last - 1].argmax())
            kept[cut] = False
            waiting += [Window(first, cut), Window(cut + 1, last)]
    return long_runs(kept, max(1, round(limits.least / dt)))


def lowest(heights: Array) -> float:
    """Height [m] above which a point is in four of five frames in which it rests."""
    return float(np.percentile(heights, 20.0))


def _level_of_kinds(stands: Sequence[tuple[int, Window, float]], kind: Array) -> dict[int, float]:
    """How high points of each kind are above the ground, by what is lowest of each; metres, to a common constant."""
    found = {}
    for each in set(kind.tolist()):
        lows = [(low, len(run)) for k, run, low in stands if kind[k] == each]
        if lows:
            heights = np.repeat([low for low, _ in lows], [count for _, count in lows])
            found[each] = float(np.percentile(heights, 10.0))
    return found


def _bears(heights: Array, run: Window, low: float, dt: float, found: Mask, marks: Mask) -> bool:
    """Whether a point came down to a rest and goes up from it, or the body has nothing else that may bear it."""
    far = max(1, round(BEFORE / dt))
    before, after = heights[max(0, run.first - far) : run.first], heights[run.end : run.end + far]
    if len(before) + len(after) and all(
        not len(part) or float(part.max()) > low + CAME_DOWN for part in (before, after)
    ):
        return True
    alone = ~(found[run.first : run.end].any(axis=1)) & (marks[run.first : run.end].sum(axis=1) <= 1)
    return bool(alone.sum() * dt > WAITED)


class LiveRests:
    """When points of a stream rest on a level floor, by speed and height as in a recording; no frame is seen twice."""

    def __init__(self, lowest: Array, dt: float, back: int) -> None:
        """Take the heights (p,) at which the points rest, metres; a rest begins `back` frames ago at most."""
        self._lowest, self._dt, self._back, self._limits = lowest, dt, back, RestLimits()
        self._least, self._half = max(1, round(self._limits.least / dt)), max(1, round(SPAN / dt))
        self._places, self._frame = list[Array](), 0
        self._begun: list[tuple[int, Array, bool] | None] = [None] * len(lowest)  # frame, place, whether slow enough
        self._rests: Mask = np.zeros(len(lowest), dtype=bool)

    def push(self, places: Array) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
        """Take places (p, 3); rests that begin and that end, each as the number of a point and the frame."""
        self._places = [*self._places[-2 * self._half :], places]
        if len(self._places) <= self._half:
            return [], []
        span, here = self._places[-1] - self._places[0], self._places[-1 - self._half]
        speed = np.linalg.norm(span, axis=1) / (self._dt * (len(self._places) - 1))
        limits, begins, ends = self._limits, list[tuple[int, int]](), list[tuple[int, int]]()
        low = (speed <= limits.speed) & (here[:, 2] <= self._lowest + limits.height)
        for number, begun in enumerate(self._begun):
            slow = bool(speed[number] <= 2.0 / 3.0 * limits.speed)
            if begun is not None and low[number] and np.linalg.norm(here[number] - begun[1]) <= limits.slid:
                begun = (begun[0], begun[1], begun[2] or slow)
                if not self._rests[number] and begun[2] and self._frame - begun[0] + 1 >= self._least:
                    self._rests[number] = True
                    begins.append((number, max(begun[0], self._frame - self._back)))
            else:
                if self._rests[number]:
                    self._rests[number] = False
                    ends.append((number, self._frame))
                begun = (self._frame, here[number], slow) if low[number] and begun is None else None
            self._begun[number] = begun
        self._frame += 1
        return begins, ends
