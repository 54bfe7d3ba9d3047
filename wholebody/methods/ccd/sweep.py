"""Sweeps of cyclic coordinate descent: each joint from the tip inwards takes its best value, in closed form.

A point at r from a joint of unit axis u has its projection onto the joint's plane, r' = r - (u . r) u (equation 4 of
Schmidl and Lin, with the joint's axis in both places), and so has its target t. Turned by phi, the squared distances
of all points, weighted by w, are a constant minus 2 (A cos phi + B sin phi) with

    A = sum w r' . t' = sum w (r . t - (u . r) (u . t)),        B = sum w u . (r x t),

so the best rotation is phi = atan2(B, A). For one point it is the signed angle between the two projections; equation 5
of the paper, an arc cosine, has no sign and holds for unit vectors only. Directions count like points at the origin:
with them a frame is rotated as well as moved (Wang and Chen 1991, A Combined Optimization Method for Solving the
Inverse Kinematics Problem of Mechanical Manipulators, IEEE Transactions on Robotics and Automation 7(4)).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from math import acos, atan2, ceil, cos, floor, inf, pi, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.methods.ccd.limbs import SLIDE, Limbs, turned

TURN = 2.0 * pi


class Plan(NamedTuple):
    """Which nodes (s,) have their turns in a sweep, in their order, and what each moves.

    It is moved[first[k] : first[k + 1]] of the aims, of which the first points[k] are points, the others directions.
    """

    nodes: Indices
    first: Indices
    moved: Indices
    points: Indices


class Aims:
    """Points and directions (m, 3) that nodes of some limbs carry: where they are, their targets, and factors (m,)."""

    def __init__(
        self, limbs: Limbs, nodes: Sequence[int], local: ArrayLike, there: ArrayLike, points: Sequence[bool],
        weights: ArrayLike | None = None,
    ) -> None:  # fmt: skip
        """Take what is carried, as it is after `limbs.forward`.

        Args:
            limbs: the limbs.
            nodes: (m,) that carry each; -1 is the world.
            local: (m, 3) each in its node's frame.
            there: (m, 3) targets in the world.
            points: (m,) which are points.
            weights: (m,) factors on the squared distances; None for all alike.
        """
        self._limbs, self._kernel = limbs, compiled_kernel()
        self._carriers, self._are_points = tuple(nodes), tuple(points)
        self._nodes, self._points = np.array(nodes, dtype=np.intp), np.array(points, dtype=bool)
        self._local = np.array(local, dtype=float).reshape(-1, 3)
        self.there: Array = np.array(there, dtype=float).reshape(-1, 3)
        self.weights: Array = np.ones(len(self._nodes)) if weights is None else np.array(weights, dtype=float)
        self.here: Array = np.zeros_like(self.there)
        self.carry()

    def carry(self) -> None:
        """Update where they are, after `limbs.forward`."""
        self._kernel.carry(self._limbs.frames, self._nodes, self._local, self._points, self.here)

    def plan(self, nodes: Iterable[int] | None = None) -> Plan:
        """Those of the nodes, or of all, that move an aim, from the tips inwards."""
        allowed = None if nodes is None else tuple(nodes)
        key = (self._carriers, self._are_points, allowed)
        if key not in self._limbs.plans:
            self._limbs.plans[key] = _plan(self._limbs, *key)
        plan: Plan = self._limbs.plans[key]
        return plan

    def sweep(self, plan: Plan) -> float:
        """Give each joint its best value, within its limits; returns the largest change of one, radians or metres.

        When a joint is processed, the joints farther out have moved, but its axis has not, so only the aims are
        updated: a sweep is linear in the number of joints. Call `limbs.forward` and `carry` before the next one.
        """
        limbs = self._limbs
        return float(
            self._kernel.sweep(
                limbs.lines, limbs.kinds, limbs.values, limbs.lower, limbs.upper,
                self.here, self.there, self.weights, *plan,
            )
        )  # fmt: skip

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
        return float(self._kernel.greatest_error(self.here, self.there, self._points))

    @property
    def distance(self) -> float:
        """Root of the weighted sum of squared remaining distances."""
        return float(self._kernel.distance(self.here, self.there, self.weights))


def _plan(limbs: Limbs, carriers: tuple[int, ...], points: tuple[bool, ...], nodes: tuple[int, ...] | None) -> Plan:
    steps: list[tuple[int, list[int], int]] = []
    for node in sorted(set(range(len(limbs.joints)) if nodes is None else nodes), reverse=True):
        mine = [k for k, tip in enumerate(carriers) if tip >= 0 and node in limbs.paths[tip]]
        places = [k for k in mine if points[k]]
        arrows = [k for k in mine if not points[k]]
        if places or (arrows and not limbs.slides(node)):
            steps.append((node, [*places, *arrows], len(places)))
    first = np.concatenate([[0], np.cumsum([len(mine) for _, mine, _ in steps])])
    parts = ([step[0] for step in steps], first, [k for step in steps for k in step[1]], [step[2] for step in steps])
    return Plan(*(np.array(part, dtype=np.intp) for part in parts))


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """This module, after its loops are compiled or loaded from the cache; called before a solve, not during it."""
    none, places, points = np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros(0, dtype=bool)
    three, six, twelve = np.zeros((0, 3)), np.zeros((0, 6)), np.zeros((0, 12))
    sweep(six, places, none, none, none, three, three, none, places, places, places, places)
    distance(three, three, none)
    carry(twelve, places, three, points, three)
    greatest_error(three, three, points)
    return sys.modules[__name__]


@compiled()
def sweep(
    lines: Array,
    kinds: Indices,
    values: Array,
    lower: Array,
    upper: Array,
    here: Array,
    there: Array,
    weights: Array,
    nodes: Indices,
    first: Indices,
    moved: Indices,
    points: Indices,
) -> float:
    """Give each joint its best value and carry the aims along; return the largest change.

    The arrays of limbs, aims and plan come one by one: a sweep of an arm takes some microseconds, and to unpack three
    records at every call would take a good part of that.

    Args:
        lines: (n, 6) unit axis and origin of each node.
        kinds: (n,) what each does.
        values: (n,) changed in place.
        lower: (n,) least values.
        upper: (n,) greatest values.
        here: (m, 3) points and directions, carried along in place.
        there: (m, 3) where they should be.
        weights: (m,) factor on each squared distance.
        nodes: (s,) nodes in the order of their turns.
        first: (s + 1,) where in `moved` each of them begins.
        moved: what each moves, points before directions.
        points: (s,) how many of these are points.
    """
    largest = 0.0
    for step in range(len(nodes)):
        node, old = nodes[step], values[nodes[step]]
        mine, places, line = moved[first[step] : first[step + 1]], points[step], lines[nodes[step]]
        if kinds[node] == SLIDE:
            new = min(max(old + _shift(line, here, there, weights, mine[:places]), lower[node]), upper[node])
            values[node] = new
            for k in mine[:places]:
                for axis in range(3):
                    here[k, axis] += (new - old) * line[axis]
            largest = max(largest, abs(new - old))
            continue
        turn = _turn(line, here, there, weights, mine, places)
        if turn == inf:
            continue
        new = old + turn
        if not lower[node] <= new <= upper[node]:
            new = within(new, lower[node], upper[node])
        change = new - old
        if change == 0.0:
            continue
        values[node] = new
        largest = max(largest, abs(change))
        co, si, ox, oy, oz = cos(change), sin(change), line[3], line[4], line[5]
        for n in range(len(mine)):
            k = mine[n]
            if n < places:
                x, y, z = turned(line, co, si, here[k, 0] - ox, here[k, 1] - oy, here[k, 2] - oz)
                here[k, 0], here[k, 1], here[k, 2] = x + ox, y + oy, z + oz
            else:
                here[k, 0], here[k, 1], here[k, 2] = turned(line, co, si, here[k, 0], here[k, 1], here[k, 2])
    return largest


@compiled(inner=True)
def _turn(line: Array, here: Array, there: Array, weights: Array, mine: Indices, points: int) -> float:
    """The best rotation about a line (6,) for what it moves, radians; infinite where it cannot change the distances."""
    ux, uy, uz, ox, oy, oz = line
    cosine, sine, size = 0.0, 0.0, 0.0
    for n in range(len(mine)):
        k = mine[n]
        x, y, z = here[k, 0], here[k, 1], here[k, 2]
        tx, ty, tz = there[k, 0], there[k, 1], there[k, 2]
        if n < points:
            x, y, z, tx, ty, tz = x - ox, y - oy, z - oz, tx - ox, ty - oy, tz - oz
        weight = weights[k]
        cosine += weight * (x * tx + y * ty + z * tz - (ux * x + uy * y + uz * z) * (ux * tx + uy * ty + uz * tz))
        sine += weight * (tx * (uy * z - uz * y) + ty * (uz * x - ux * z) + tz * (ux * y - uy * x))
        size += weight
    if (cosine * cosine + sine * sine) ** 0.5 <= 1e-12 * size:  # m^2: the angle would be that of rounding
        return inf
    return atan2(sine, cosine)


@compiled(inner=True)
def _shift(line: Array, here: Array, there: Array, weights: Array, mine: Indices) -> float:
    """The best displacement along a line (6,): the mean distance of its points from their targets, along it, metres."""
    total, weight = 0.0, 0.0
    for k in mine:
        for axis in range(3):
            total += weights[k] * line[axis] * (there[k, axis] - here[k, axis])
        weight += weights[k]
    return total / weight if weight > 0.0 else 0.0  # no slide moves axes alone


@compiled()
def within(best: float, lower: float, upper: float) -> float:
    """The allowed angle nearest to the best one on the circle: the same after whole turns, or the nearer limit.

    The objective is A cos + B sin of the angle, so it falls with the distance on the circle from the best.
    """
    turns = ceil((lower - best) / TURN) if lower > -inf else floor((upper - best) / TURN)
    angle = best + TURN * turns
    if lower <= angle <= upper:
        return angle
    return lower if cos(lower - best) >= cos(upper - best) else upper


@compiled()
def distance(here: Array, there: Array, weights: Array) -> float:
    """Root of the weighted sum of squared distances left."""
    total = 0.0
    for k in range(len(here)):
        for axis in range(3):
            total += weights[k] * (there[k, axis] - here[k, axis]) ** 2
    return float(total**0.5)


@compiled()
def carry(frames: Array, nodes: Indices, local: Array, points: Mask, here: Array) -> None:
    """Write where points and directions are now; arguments as of `Aims`."""
    for k in range(len(nodes)):
        frame = frames[nodes[k]]
        for row in range(3):
            here[k, row] = (
                frame[3 * row] * local[k, 0] + frame[3 * row + 1] * local[k, 1] + frame[3 * row + 2] * local[k, 2]
            )
            if points[k]:
                here[k, row] += frame[9 + row]


@compiled()
def greatest_error(here: Array, there: Array, points: Mask) -> float:
    """Largest distance of a point (m, 3) from its place, or angle of three directions, one after the other."""
    worst, k = 0.0, 0
    while k < len(here):
        square = 0.0
        for n in range(k, k + 1 if points[k] else k + 3):
            for axis in range(3):
                square += (here[n, axis] - there[n, axis]) ** 2
        if points[k]:
            worst = max(worst, square**0.5)
            k += 1
        else:  # the sum over the three axes is 4 (1 - cos angle) = 8 sin^2(angle / 2)
            worst = max(worst, acos(max(-1.0, 1.0 - square / 4.0)))
            k += 3
    return worst
