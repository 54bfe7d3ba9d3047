"""One sweep of cyclic coordinate descent: each joint from the tip inwards takes its best value, in closed form.

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

from collections.abc import Iterable, Sequence
from math import atan2, ceil, cos, floor, hypot, inf, pi, sin

from wholebody.methods.ccd.limbs import Limbs

TURN = 2.0 * pi
FLAT = 1e-12  # m^2: below this a joint cannot change the distances, and the angle would be rounding error


class Aims:
    """Points and directions carried by nodes, with their targets.

    Attributes:
        here: their present values, three floats each.
        there: their targets.
        weights: factor on each squared distance.
    """

    def __init__(self) -> None:
        """Make an empty set."""
        self.here: list[tuple[float, float, float]] = []
        self.there: list[tuple[float, float, float]] = []
        self.weights: list[float] = []
        self._nodes: list[int] = []
        self._direction: list[bool] = []

    def add(
        self,
        node: int,
        here: tuple[float, float, float],
        there: tuple[float, float, float],
        *,
        weight: float = 1.0,
        direction: bool = False,
    ) -> None:
        """Add a point, or a direction, of a node with its target; both in the world."""
        self.here.append(here)
        self.there.append(there)
        self.weights.append(weight)
        self._nodes.append(node)
        self._direction.append(direction)

    def plan(self, limbs: Limbs, nodes: Iterable[int] | None = None) -> list[tuple[int, tuple[int, ...], int]]:
        """Nodes that move an aim, from the tips inwards: (node, aims that it moves, number of points among them).

        In the aims of a node, points come before directions.

        Args:
            limbs: the limbs of the nodes.
            nodes: the nodes that may move; None for all that move an aim.
        """
        allowed = range(len(limbs.joints)) if nodes is None else nodes
        steps = []
        for node in sorted(set(allowed), reverse=True):
            mine = [k for k, tip in enumerate(self._nodes) if tip >= 0 and node in limbs.paths[tip]]
            points = [k for k in mine if not self._direction[k]]
            arrows = [k for k in mine if self._direction[k]]
            if points or (arrows and not limbs.slides(node)):
                steps.append((node, (*points, *arrows), len(points)))
        return steps

    def distance(self) -> float:
        """Root of the weighted sum of squared remaining distances."""
        total = 0.0
        for (x, y, z), (tx, ty, tz), weight in zip(self.here, self.there, self.weights, strict=True):
            total += weight * ((tx - x) ** 2 + (ty - y) ** 2 + (tz - z) ** 2)
        return float(total**0.5)


def sweep(limbs: Limbs, aims: Aims, steps: Sequence[tuple[int, tuple[int, ...], int]]) -> float:
    """Give each joint its best value, within its limits, and move the aims with it.

    When a joint is processed, the joints farther out have moved, but its axis has not, so only the aims are updated: a
    sweep is linear in the number of joints. Call `limbs.forward()` before the next one.

    Returns:
        The largest change of a joint, radians or metres.
    """
    here, there, weights = aims.here, aims.there, aims.weights
    lines, values, lower, upper = limbs.lines, limbs.values, limbs.lower, limbs.upper
    largest = 0.0
    for node, mine, points in steps:
        ux, uy, uz, ox, oy, oz = lines[node]
        if limbs.slides(node):
            change = _slide(limbs, aims, node, mine, points)
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

    The objective A cos + B sin, which is maximised, decreases with the angular distance from the best angle.
    """
    turns = ceil((lower - best) / TURN) if lower > -inf else floor((upper - best) / TURN)
    angle = best + TURN * turns
    if lower <= angle <= upper:
        return angle
    return lower if cos(lower - best) >= cos(upper - best) else upper


def _slide(limbs: Limbs, aims: Aims, node: int, mine: tuple[int, ...], points: int) -> float:
    """The best displacement of a prismatic joint: the mean distance of its points from their targets along it."""
    ux, uy, uz, _, _, _ = limbs.lines[node]
    total = weight = 0.0
    for k in mine[:points]:
        (x, y, z), (tx, ty, tz) = aims.here[k], aims.there[k]
        total += aims.weights[k] * (ux * (tx - x) + uy * (ty - y) + uz * (tz - z))
        weight += aims.weights[k]
    old = limbs.values[node]
    new = min(max(old + total / weight, limbs.lower[node]), limbs.upper[node])
    limbs.values[node] = new
    change = new - old
    for k in mine[:points]:
        x, y, z = aims.here[k]
        aims.here[k] = (x + change * ux, y + change * uy, z + change * uz)
    return change
