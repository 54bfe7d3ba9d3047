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
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.methods.ccd.limbs import Limbs, compiled_kernel

Vector = Sequence[float]


class Plan(NamedTuple):
    """Which nodes have their turns in a sweep, and what each moves.

    Attributes:
        nodes: (s,) nodes in the order of their turns.
        first: (s + 1,) where in `moved` each of them begins.
        moved: aims that each moves, points before directions.
        points: (s,) how many of these are points.
    """

    nodes: Indices
    first: Indices
    moved: Indices
    points: Indices

    @classmethod
    def of(cls, steps: Sequence[tuple[int, Sequence[int], int]]) -> Plan:
        """From steps: (node, what it moves, how many of these are points)."""
        moved = [k for _, mine, _ in steps for k in mine]
        first = np.concatenate([[0], np.cumsum([len(mine) for _, mine, _ in steps])])
        parts = ([node for node, _, _ in steps], first, moved, [points for _, _, points in steps])
        return cls(*(np.array(part, dtype=np.intp) for part in parts))


@lru_cache(maxsize=256)
def moving_all(nodes: tuple[int, ...], aims: int, points: int) -> Plan:
    """The plan in which each of these nodes, in this order, moves all aims, of which the first are points."""
    return Plan.of([(node, range(aims), points) for node in nodes])


class Aims:
    """Points and directions carried by nodes, with their targets.

    Attributes:
        here: (m, 3) their present values.
        there: (m, 3) their targets.
        weights: (m,) factor on each squared distance.
    """

    def __init__(self) -> None:
        """Make an empty set."""
        self.here, self.there, self.weights = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)
        self._nodes: list[int] = []
        self._direction: list[bool] = []

    def add(self, node: int, here: Vector, there: Vector, *, weight: float = 1.0, direction: bool = False) -> None:
        """Add a point, or a direction, of a node with its target; both (3,) in the world."""
        self.here, self.there = np.vstack([self.here, here]), np.vstack([self.there, there])
        self.weights = np.append(self.weights, weight)
        self._nodes.append(node)
        self._direction.append(direction)

    def plan(self, limbs: Limbs, nodes: Iterable[int] | None = None) -> Plan:
        """Nodes that move an aim, from the tips inwards.

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
        return Plan.of(steps)

    @property
    def points(self) -> Mask:
        """(m,) which are points."""
        return ~np.array(self._direction, dtype=bool)

    def distance(self) -> float:
        """Root of the weighted sum of squared remaining distances."""
        return distance(self.here, self.there, self.weights)


def distance(here: Array, there: Array, weights: Array) -> float:
    """Root of the sum of squared distances between (m, 3) and (m, 3), with weights (m,)."""
    return float(compiled_kernel().distance(here, there, weights))


def sweep(limbs: Limbs, aims: Aims, plan: Plan) -> float:
    """Give each joint its best value, within its limits, and move the aims with it.

    When a joint is processed, the joints farther out have moved, but its axis has not, so only the aims are updated: a
    sweep is linear in the number of joints. Call `limbs.forward()` before the next one.

    Returns:
        The largest change of a joint, radians or metres.
    """
    return carried(limbs, aims.here, aims.there, aims.weights, plan)


def carried(limbs: Limbs, here: Array, there: Array, weights: Array, plan: Plan) -> float:
    """The same for aims as arrays: (m, 3), which is carried along in place, (m, 3) and (m,)."""
    return float(
        compiled_kernel().sweep(
            limbs.lines, limbs.kinds, limbs.values, limbs.lower, limbs.upper, here, there, weights, *plan
        )
    )
