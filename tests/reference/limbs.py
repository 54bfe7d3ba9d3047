"""Plain floats for the kinematics and sweeps of cyclic coordinate descent: what the compiled loops must compute."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import atan2, ceil, cos, floor, hypot, inf, pi, sin
from typing import Any

from wholebody.methods.ccd.limbs import Limbs

TURN = 2.0 * pi
FLAT = 1e-12  # m^2

Vector = tuple[float, float, float]
Step = tuple[int, tuple[int, ...], int]


def forward(limbs: Limbs) -> tuple[list[Any], list[Any]]:
    """Frames and lines as `Limbs.forward` writes them."""
    frames, lines, values = (
        [tuple(frame) for frame in limbs.frames.tolist()],
        [tuple(line) for line in limbs.lines.tolist()],
        limbs.values.tolist(),
    )
    for k, (parent, turn, px, py, pz, slides, (u, v, w)) in enumerate(_nodes(limbs)):
        a, b, c, d, e, f, g, h, i, x, y, z = frames[parent]
        x += a * px + b * py + c * pz
        y += d * px + e * py + f * pz
        z += g * px + h * py + i * pz
        A, B, C, D, E, F, G, H, J = turn
        a, b, c = a * A + b * D + c * G, a * B + b * E + c * H, a * C + b * F + c * J
        d, e, f = d * A + e * D + f * G, d * B + e * E + f * H, d * C + e * F + f * J
        g, h, i = g * A + h * D + i * G, g * B + h * E + i * H, g * C + h * F + i * J
        value = values[k]
        ux, uy, uz = a * u + b * v + c * w, d * u + e * v + f * w, g * u + h * v + i * w
        if slides:
            x, y, z = x + value * ux, y + value * uy, z + value * uz
        else:
            a, d, g = turned(ux, uy, uz, cos(value), sin(value), a, d, g)
            b, e, h = turned(ux, uy, uz, cos(value), sin(value), b, e, h)
            c, f, i = turned(ux, uy, uz, cos(value), sin(value), c, f, i)
        frames[k] = (a, b, c, d, e, f, g, h, i, x, y, z)
        lines[k] = (ux, uy, uz, x, y, z)
    return frames, lines


def _nodes(limbs: Limbs) -> Iterator[tuple[Any, ...]]:
    """Parent, turn, translation, whether it slides and axis of every node."""
    for parent, place, slides, axis in zip(limbs.parents, limbs.places, limbs.slides, limbs.axes, strict=True):
        yield (int(parent), place[:9].tolist(), *place[9:].tolist(), bool(slides), axis.tolist())


def sweep(
    limbs: Limbs,
    values: list[float],
    here: list[Vector],
    there: list[Vector],
    weights: list[float],
    steps: Sequence[Step],
) -> float:
    """What `wholebody.methods.ccd.sweep.sweep` returns; `values` and `here` are changed in place."""
    lines, lower, upper = limbs.lines.tolist(), limbs.lower.tolist(), limbs.upper.tolist()
    largest = 0.0
    for node, mine, points in steps:
        ux, uy, uz, ox, oy, oz = lines[node]
        if limbs.slides[node]:
            change = _slide(limbs, values, here, there, weights, node, mine, points)
            largest = max(largest, abs(change))
            continue
        cosine = sine = size = 0.0
        for n, k in enumerate(mine):
            x, y, z = here[k]
            tx, ty, tz = there[k]
            if n < points:
                x -= ox
                y -= oy
                z -= oz
                tx -= ox
                ty -= oy
                tz -= oz
            weight = weights[k]
            cosine += weight * (x * tx + y * ty + z * tz - (ux * x + uy * y + uz * z) * (ux * tx + uy * ty + uz * tz))
            sine += weight * (tx * (uy * z - uz * y) + ty * (uz * x - ux * z) + tz * (ux * y - uy * x))
            size += weight
        if hypot(cosine, sine) <= FLAT * size:
            continue
        old = values[node]
        new = old + atan2(sine, cosine)
        if not lower[node] <= new <= upper[node]:
            new = within(new, lower[node], upper[node])
        change = new - old
        if change == 0.0:
            continue
        values[node] = new
        largest = max(largest, abs(change))
        co, si = cos(change), sin(change)
        for n, k in enumerate(mine):
            x, y, z = here[k]
            if n < points:
                x -= ox
                y -= oy
                z -= oz
            along = (1.0 - co) * (ux * x + uy * y + uz * z)
            px = co * x + si * (uy * z - uz * y) + along * ux
            py = co * y + si * (uz * x - ux * z) + along * uy
            pz = co * z + si * (ux * y - uy * x) + along * uz
            here[k] = (px + ox, py + oy, pz + oz) if n < points else (px, py, pz)
    return largest


def within(best: float, lower: float, upper: float) -> float:
    """The allowed angle nearest to the best one on the circle: the same after whole turns, or the nearer limit.

    The objective is A cos + B sin of the angle, so it falls with the distance on the circle from the best.
    """
    turns = ceil((lower - best) / TURN) if lower > -inf else floor((upper - best) / TURN)
    angle = best + TURN * turns
    if lower <= angle <= upper:
        return angle
    return lower if cos(lower - best) >= cos(upper - best) else upper


def _slide(
    limbs: Limbs,
    values: list[float],
    here: list[Vector],
    there: list[Vector],
    weights: list[float],
    node: int,
    mine: tuple[int, ...],
    points: int,
) -> float:
    """The best displacement of a sliding joint is the mean distance of its points from their targets, along it."""
    ux, uy, uz, _, _, _ = limbs.lines[node].tolist()
    total = weight = 0.0
    for k in mine[:points]:
        (x, y, z), (tx, ty, tz) = here[k], there[k]
        total += weights[k] * (ux * (tx - x) + uy * (ty - y) + uz * (tz - z))
        weight += weights[k]
    old = values[node]
    new = min(max(old + total / weight, limbs.lower[node]), limbs.upper[node])
    values[node] = new
    change = new - old
    for k in mine[:points]:
        x, y, z = here[k]
        here[k] = (x + change * ux, y + change * uy, z + change * uz)
    return change


def turned(
    ux: float, uy: float, uz: float, co: float, si: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """A vector turned about a unit axis u (Rodrigues)."""
    along = (1.0 - co) * (ux * x + uy * y + uz * z)
    return (
        co * x + si * (uy * z - uz * y) + along * ux,
        co * y + si * (uz * x - ux * z) + along * uy,
        co * z + si * (ux * y - uy * x) + along * uz,
    )
