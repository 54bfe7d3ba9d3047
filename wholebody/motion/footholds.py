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
from wholebody.motion.windows import Window, long_runs, normal, runs

NEARBY = 0.8  # m: ground farther away than a step says nothing of the height here
BEFORE = 0.4  # s: how long before and after a rest a point is looked at: half of a swing
CAME_DOWN = 0.006  # m: by which a point that rests on higher ground was above it before and after
STEP = 0.3  # m: what rests so much higher than what bears beside it does so for WAITED, or is a kick
SPAN = 1 / 30  # s before and after a frame between which its speed is that of a rest, whatever the rate of frames
TREMBLES = 0.015  # m: by which a point that rests goes to and fro, as markers do
SMOOTH = 0.04  # s: standard deviation over which places are smoothed to tell speeds of the body from those of noise
TELLING = 0.4  # m/s below which speeds tell the noise
QUIET, NOISE = 0.1, 0.5  # m/s of noise that changes no limit; share of what is above by which a rest may be faster
LOADED, NARROW = 0.2, 0.15  # share of the way between feet that moves the body's mass; m: of feet that stand together
WAITED = 0.25  # s: a body that nothing lower bears for longer is borne by what rests higher


class RestLimits(NamedTuple):
    """What counts as rest."""

    speed: float = 0.15  # m/s, largest speed; a rest begins where the speed falls below two thirds of it
    height: float = 0.05  # m, largest height above the lowest rest nearby
    least: float = 0.1  # s, shortest rest
    slid: float = 0.08  # m: a point that goes on farther while it is slow has made a step, and rests at two places
    stayed: float = 0.1  # s before and after a frame in which a point that trembles stays; 0 in clips, where none does


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


def _steady(places: Array, dt: float, stayed: float) -> Array:
    """(n,) speeds of a point (n, 3) between two frames, or over more where that is less.

    Over more it is that of going through its extent, or of its middle before to that after if that is faster: a point
    that trembles stays, one that is set down beside where it was does not.
    """
    if stayed == 0.0:
        return speeds(places, dt, SPAN)
    half, last = max(1, round(stayed / dt)), len(places) - 1
    near = np.clip(np.arange(len(places))[:, None] + np.arange(-half, half + 1), 0, last)
    around, time = places[near], dt * np.maximum(near[:, -1] - near[:, 0], 1)
    extent = np.linalg.norm(np.ptp(around, axis=1), axis=1) - TREMBLES
    moved = np.linalg.norm(around[:, half + 1 :].mean(axis=1) - around[:, :half].mean(axis=1), axis=1)
    return np.asarray(np.minimum(speeds(places, dt, SPAN), np.maximum(extent, 2.0 * moved - TREMBLES) / time))


def _noise(places: Array, dt: float) -> tuple[Array, float]:
    """(n,) speeds of a point (n, 3) without noise, and the noise: the median speed of it where the point is slow."""
    if len(places) < 2:
        return np.zeros(len(places)), 0.0
    weights = normal(SMOOTH, dt)
    beyond = np.pad(places, ((len(weights) // 2,) * 2, (0, 0)), mode="edge")
    means = np.stack([np.convolve(column, weights, "valid") for column in beyond.T], axis=1)
    raw, smooth = np.gradient(places, dt, axis=0), np.gradient(means, dt, axis=0)
    speed = np.linalg.norm(smooth, axis=1)
    near = speed < TELLING
    return speed, float(np.median(np.linalg.norm((raw - smooth)[near], axis=1))) if near.any() else 0.0


class Point(NamedTuple):
    """Which point of a body rests; points of one kind are equally high on level ground."""

    foot: str
    kind: int


def resting(
    places: Array,
    dt: float,
    limits: RestLimits,
    points: Sequence[Point],
    allowed: Mask | None = None,
    centre: Array | None = None,
) -> Mask:
    """(n, p) when points (n, p, 3) rest, `dt` seconds apart; only where that is `allowed` (n, p).

    `centre` (n, 2) is about where the body's mass is: what is beside a foot that bears all of it hangs.
    """
    found = np.zeros(places.shape[:2], dtype=bool)
    may = np.ones_like(found) if allowed is None else allowed
    rests = [slow(places[:, k], dt, limits) & may[:, k] for k in range(places.shape[1])]
    if not rests:
        return found
    marks = np.stack(rests, axis=1)
    stands = [(k, run, lowest(places[run.first : run.end, k, 2])) for k, mask in enumerate(rests) for run in runs(mask)]
    middles = np.array([places[run.first : run.end, k, :2].mean(axis=0) for k, run, _ in stands]).reshape(-1, 2)
    lows = np.array([low for *_, low in stands])
    rise = above_ground([points[k] for k, *_ in stands], [run for _, run, _ in stands], lows)
    base = np.asarray(lows - [rise[points[k].kind] for k, *_ in stands])
    accepted, seen = np.zeros(len(stands), dtype=bool), set[int]()
    beside = np.linalg.norm(middles[:, None] - middles, axis=2) < NEARBY
    order = np.argsort(base, kind="stable").tolist()
    for number in [*order, *order]:
        k, run, low = stands[number]
        near, away = accepted & beside[number], np.abs(base - base[number])
        if accepted[number]:
            continue
        if number in seen:  # the second time around: at the height of what bears beside it
            stays = bool((near & (away <= limits.height)).any())
        else:
            floor = float(base[near].max(initial=-np.inf)) if near.any() else float(base.min())
            # a foot whose toes, or heel, are far from where they would stand with the rest of it is in the air
            hangs = bool((_of_one_foot(points, stands, number) & ~accepted & (away > limits.height)).any())
            hangs = hangs or (base[number] > floor + STEP and (run.end - run.first) * dt < WAITED)  # or at its turn
            stays = not (near.any() or accepted.any()) or base[number] <= floor + limits.height
            other = [each for each, point in enumerate(points) if point.kind == points[k].kind and each != k]
            lower = np.flatnonzero(accepted & (base < base[number] - limits.height)).tolist()
            lower = [j for j in lower if stands[j][0] in other]
            hangs = hangs or (centre is not None and _unloaded(places, centre, stands, number, lower))
            stays = stays or (not hangs and _came_down(places[:, k, 2], run, low, dt))
            rest = [each for each in range(len(points)) if each != k]
            rest = [each for each in rest if points[each].foot != points[k].foot] or rest
            # nothing that is found, and no slow point of the other foot, bears
            alone = ~(found[run.first : run.end].any(axis=1) | marks[run.first : run.end, rest].any(axis=1))
            stays = stays or bool(alone.sum() * dt > WAITED)
        seen.add(number)
        if stays:
            accepted[number] = True
            frames = np.arange(run.first, run.end)
            found[frames[places[frames, k, 2] <= low + limits.height], k] = True
    return np.stack([long_runs(column, max(1, round(limits.least / dt))) for column in found.T], axis=1)


def slow(places: Array, dt: float, limits: RestLimits) -> Mask:
    """(n,) rest frames of a point (n, 3) by speed alone; the fastest frames of a slow motion separate two rests."""
    speed, most = _steady(places, dt, limits.stayed), limits.speed
    if limits.stayed:
        smooth, noise = _noise(places, dt)
        speed, most = np.minimum(speed, smooth), most + NOISE * max(noise - QUIET, 0.0)
    low, high = speed <= 2.0 / 3.0 * limits.speed, speed <= most
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


def above_ground(rests: Sequence[Point], times: Sequence[Window], lows: Array) -> dict[int, float]:
    """How high points of each kind are above level ground, metres, to a common constant.

    Points of one foot that rest at one time tell it; where none do, the lowest of each kind.

    Args:
        rests: k points that rest.
        times: the frames of each.
        lows: (k,) how high they are, metres.
    """
    known = dict[int, float]()
    for kind in sorted({each.kind for each in rests}):
        mine = [k for k, each in enumerate(rests) if each.kind == kind]
        known[kind] = float(np.percentile(np.repeat(lows[mine], [len(times[k]) for k in mine]), 10.0))
        for other, height in known.items():
            pairs = [(k, j) for k in mine for j, each in enumerate(rests) if each == Point(rests[k].foot, other)]
            common = [max(0, min(times[k].end, times[j].end) - max(times[k].first, times[j].first)) for k, j in pairs]
            if other != kind and any(common):
                known[kind] = height + float(np.median(np.repeat([lows[k] - lows[j] for k, j in pairs], common)))
                break
    return known


def _of_one_foot(points: Sequence[Point], stands: Sequence[tuple[int, Window, float]], number: int) -> Mask:
    """(k,) which of the stands of points are of the same foot at the same time as one of them."""
    own, run, _ = stands[number]
    return np.array([
        points[k].foot == points[own].foot and max(run.first, other.first) < min(run.end, other.end)
        for k, other, _ in stands
    ])  # fmt: skip


def _came_down(heights: Array, run: Window, low: float, dt: float) -> bool:
    """Whether a point of heights (n,) came down to a rest and goes up from it."""
    far = max(1, round(BEFORE / dt))
    before, after = heights[max(0, run.first - far) : run.first], heights[run.end : run.end + far]
    return bool(len(before) + len(after)) and all(
        not len(part) or float(part.max()) > low + CAME_DOWN for part in (before, after)
    )


def _unloaded(
    places: Array, centre: Array, stands: Sequence[tuple[int, Window, float]], number: int, lower: Sequence[int]
) -> bool:
    """Whether stands of the other foot bear a body with its mass at (n, 2) all the time of a stand."""
    k, run, _ = stands[number]
    loads = np.ones(run.end - run.first)  # share of the way from the other foot on which the body is
    for other, beside, _ in (stands[j] for j in lower):
        common = slice(max(run.first, beside.first), max(run.first, beside.first, min(run.end, beside.end)))
        way = places[common, k, :2] - places[common, other, :2]
        along = np.einsum("ni,ni->n", way, centre[common] - places[common, other, :2])
        here = slice(common.start - run.first, common.stop - run.first)
        loads[here] = np.minimum(loads[here], along / np.maximum(np.einsum("ni,ni->n", way, way), NARROW**2))
    return bool((loads < LOADED).all())


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
