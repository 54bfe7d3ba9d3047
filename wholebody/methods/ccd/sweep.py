"""Sweeps of cyclic coordinate descent: each joint from the tip inwards takes its best value, in closed form.

docs/theory/ccd.md has the equations (equation 4 of Schmidl and Lin; Wang and Chen 1991 for directions).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import acos, atan2, ceil, cos, floor, inf, pi, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled, with_loops
from wholebody.methods.ccd.limbs import Limbs, turned

TURN = 2.0 * pi


class Plan(NamedTuple):
    """Which nodes have their turns in a sweep, and what each moves."""

    # (s, 4) node, where in `moved` it begins and ends, and how many of those are points, which come first
    turns: Indices
    moved: Indices  # aims that the nodes move


class Aims:
    """Points and directions (m, 3) that nodes of some limbs carry: where they are, their targets, and factors (m,)."""

    def __init__(
        self, limbs: Limbs, nodes: Sequence[int], local: ArrayLike, there: ArrayLike, points: Sequence[bool],
        weights: ArrayLike | None = None,
    ) -> None:  # fmt: skip
        """Take what nodes (m,) carry after `limbs.forward`, -1 the world: `local`, targets `there` (m, 3), points."""
        self._limbs, self._kernel = limbs, compiled_kernel()
        self._carriers, self._are_points = tuple(nodes), tuple(points)
        self._nodes = np.array(nodes, dtype=np.intp)
        self._rows = np.zeros((len(self._nodes), 11))  # where each is, target, factor, in its node's frame, is a point
        self.here, self.there, self.weights = self._rows[:, :3], self._rows[:, 3:6], self._rows[:, 6]
        self.there[:], self._rows[:, 7:10] = (np.reshape(part, (-1, 3)) for part in (there, local))
        self.weights[:], self._rows[:, 10] = 1.0 if weights is None else weights, points
        self.carry()

    @property
    def arrays(self) -> tuple[Array, Indices]:
        """(m, 11) where each is, target, factor, in its node's frame, is a point; and the nodes (m,)."""
        return self._rows, self._nodes

    def carry(self) -> None:
        """Update where they are, after `limbs.forward`."""
        self._kernel.carry(self._limbs.frames, self._nodes, self._rows)

    def plan(self, nodes: Iterable[int] | None = None) -> Plan:
        """Those of the nodes, or of all, that move an aim, from the tips inwards."""
        allowed = None if nodes is None else tuple(nodes)
        key = (self._carriers, self._are_points, allowed)
        if key not in self._limbs.plans:
            self._limbs.plans[key] = _plan(self._limbs, *key)
        plan: Plan = self._limbs.plans[key]
        return plan

    def sweep(self, plan: Plan) -> float:
        """Give each joint its best value within its limits; the largest change, radians or metres."""
        # Only aims are updated, not axes, so a sweep is linear. Call `limbs.forward` and `carry` before the next.
        limbs = self._limbs
        return float(
            self._kernel.sweep(
                limbs.lines, limbs.slides, limbs.values, limbs.limits, self._rows, plan.turns, plan.moved
            )
        )

    def sweep_until(self, nodes: Sequence[int], done: Callable[[], bool]) -> None:
        """Sweep with these nodes, and call `limbs.forward`, until `done` is true: mostly twice."""
        plan = self.plan(nodes)
        for _ in range(12):
            self.sweep(plan)
            self._limbs.forward()
            if done():
                return
            self.carry()

    @property
    def error(self) -> float:
        """Largest remaining distance of a point, or angle of three directions, one after the other."""
        return float(self._kernel.greatest_error(self._rows))

    @property
    def distance(self) -> float:
        """Root of the weighted sum of squared remaining distances."""
        return float(self._kernel.distance(self._rows))


def _plan(limbs: Limbs, carriers: tuple[int, ...], points: tuple[bool, ...], nodes: tuple[int, ...] | None) -> Plan:
    turns, moved = list[tuple[int, int, int, int]](), list[int]()
    for node in sorted(set(range(len(limbs.joints)) if nodes is None else nodes), reverse=True):
        mine = [k for k, tip in enumerate(carriers) if tip >= 0 and node in limbs.paths[tip]]
        places = [k for k in mine if points[k]]
        if places or (mine and not limbs.slides[node]):
            turns.append((node, len(moved), len(moved) + len(mine), len(places)))
            moved += [*places, *(k for k in mine if not points[k])]
    return Plan(np.array(turns, dtype=np.intp).reshape(-1, 4), np.array(moved, dtype=np.intp))


@with_loops(__name__)
def compiled_kernel(_: Any) -> None:
    """This module, after its loops are compiled or loaded from the cache; called before a solve, not during it."""
    places, six, rows = np.zeros(0, dtype=np.intp), np.zeros((0, 6)), np.zeros((0, 11))
    sweep(six, np.zeros(0, dtype=bool), np.zeros(0), np.zeros((2, 0)), rows, np.zeros((0, 4), dtype=np.intp), places)
    distance(rows)
    carry(np.zeros((0, 12)), places, rows)
    greatest_error(rows)


@compiled()
def sweep(
    lines: Array, slides: Mask, values: Array, limits: Array, aims: Array, turns: Indices, moved: Indices
) -> float:  # fmt: skip
    """Give each joint its best value and carry the aims along; return the largest change.

    Arrays one by one, as unpacking records takes long: lines (n, 6) axis and origin, slides (n,), values (n,) in place,
    limits (2, n), aims (m, 11) in place, turns (s, 4) and `moved` of the plan.
    """
    largest = 0.0
    for node, first, last, places in turns:
        old, lower, upper, mine, line = values[node], limits[0, node], limits[1, node], moved[first:last], lines[node]
        if slides[node]:
            new = min(max(old + _shift(line, aims, mine[:places]), lower), upper)
            values[node] = new
            for k in mine[:places]:
                for axis in range(3):
                    aims[k, axis] += (new - old) * line[axis]
            largest = max(largest, abs(new - old))
            continue
        turn = _turn(line, aims, mine, places)
        if turn == inf:
            continue
        new = old + turn
        if not lower <= new <= upper:
            new = within(new, lower, upper)
        change = new - old
        if change == 0.0:
            continue
        values[node] = new
        largest = max(largest, abs(change))
        co, si, ox, oy, oz = cos(change), sin(change), line[3], line[4], line[5]
        for n in range(len(mine)):
            k = mine[n]
            if n < places:
                x, y, z = turned(line, co, si, aims[k, 0] - ox, aims[k, 1] - oy, aims[k, 2] - oz)
                aims[k, 0], aims[k, 1], aims[k, 2] = x + ox, y + oy, z + oz
            else:
                aims[k, 0], aims[k, 1], aims[k, 2] = turned(line, co, si, aims[k, 0], aims[k, 1], aims[k, 2])
    return largest


@compiled(inner=True)
def _turn(line: Array, aims: Array, mine: Indices, points: int) -> float:
    """The best rotation about a line (6,) for what it moves, radians; infinite where it cannot change the distances."""
    ux, uy, uz, ox, oy, oz = line
    cosine, sine, size = 0.0, 0.0, 0.0
    for n in range(len(mine)):
        k = mine[n]
        x, y, z = aims[k, 0], aims[k, 1], aims[k, 2]
        tx, ty, tz = aims[k, 3], aims[k, 4], aims[k, 5]
        if n < points:
            x, y, z, tx, ty, tz = x - ox, y - oy, z - oz, tx - ox, ty - oy, tz - oz
        weight = aims[k, 6]
        cosine += weight * (x * tx + y * ty + z * tz - (ux * x + uy * y + uz * z) * (ux * tx + uy * ty + uz * tz))
        sine += weight * (tx * (uy * z - uz * y) + ty * (uz * x - ux * z) + tz * (ux * y - uy * x))
        size += weight
    if (cosine * cosine + sine * sine) ** 0.5 <= 1e-12 * size:  # m^2: the angle would be that of rounding
        return inf
    return atan2(sine, cosine)


@compiled(inner=True)
def _shift(line: Array, aims: Array, mine: Indices) -> float:
    """The best displacement along a line (6,): the mean distance of its points from their targets, along it, metres."""
    total, weight = 0.0, 0.0
    for k in mine:
        for axis in range(3):
            total += aims[k, 6] * line[axis] * (aims[k, 3 + axis] - aims[k, axis])
        weight += aims[k, 6]
    return total / weight if weight > 0.0 else 0.0  # no slide moves axes alone


@compiled()
def within(best: float, lower: float, upper: float) -> float:
    """The allowed angle nearest to the best one on the circle, as A cos + B sin falls with that distance."""
    turns = ceil((lower - best) / TURN) if lower > -inf else floor((upper - best) / TURN)
    angle = best + TURN * turns
    if lower <= angle <= upper:
        return angle
    return lower if cos(lower - best) >= cos(upper - best) else upper


@compiled()
def distance(aims: Array) -> float:
    """Root of the weighted sum of squared distances left."""
    total = 0.0
    for k in range(len(aims)):
        for axis in range(3):
            total += aims[k, 6] * (aims[k, 3 + axis] - aims[k, axis]) ** 2
    return float(total**0.5)


@compiled()
def carry(frames: Array, nodes: Indices, aims: Array) -> None:
    """Write where points and directions, which nodes (m,) carry, are now."""
    for k in range(len(nodes)):
        frame, x, y, z = frames[nodes[k]], aims[k, 7], aims[k, 8], aims[k, 9]
        for row in range(3):
            aims[k, row] = frame[3 * row] * x + frame[3 * row + 1] * y + frame[3 * row + 2] * z
            if aims[k, 10] > 0.0:
                aims[k, row] += frame[9 + row]


@compiled()
def greatest_error(aims: Array) -> float:
    """Largest distance of a point from its target, or angle of three directions, one after the other."""
    worst, k = 0.0, 0
    while k < len(aims):
        square, point = 0.0, aims[k, 10] > 0.0
        for n in range(k, k + 1 if point else k + 3):
            for axis in range(3):
                square += (aims[n, axis] - aims[n, 3 + axis]) ** 2
        if point:
            worst = max(worst, square**0.5)
            k += 1
        else:  # the sum over the three axes is 4 (1 - cos angle) = 8 sin^2(angle / 2)
            worst = max(worst, acos(max(-1.0, 1.0 - square / 4.0)))
            k += 3
    return worst
