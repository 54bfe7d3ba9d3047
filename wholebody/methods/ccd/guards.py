"""Guards: joints that have left a reach cone or a range of motion are brought back, or else stay at their last values.

Cones and ranges that share joints, those of a shoulder or of a leg, are kept together. The cones are those of
`wholebody.figures.reach_cones`, the ranges those of `ranges`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.figures.reach_cones import ReachCone
from wholebody.methods.ccd.limbs import Limbs, Vector, rotated, three
from wholebody.methods.ccd.ranges import LimbGuard, RangeGuard, range_guards
from wholebody.methods.ccd.sweep import Aims


class Kept(NamedTuple):
    """What descents keep."""

    fixed: frozenset[int] = frozenset()  # Pinocchio's indices of joints that must not move, not even to resolve overlap
    cones: tuple[str, ...] | None = None  # names of the reach cones; None for all of the figure's
    ranges: tuple[str, ...] = ()  # names of the ranges of motion


NOTHING_FIXED = Kept()


class Polygon:
    """A reach cone: the test of a direction, on plain floats, and the nearest direction inside."""

    def __init__(self, cone: ReachCone) -> None:
        self._cone, slices = cone, np.cross(cone.visible, cone.vertices)
        self._wedges = [
            (three(slice_), three(after), three(edge))
            for slice_, after, edge in zip(slices, np.roll(slices, -1, axis=0), cone.boundaries, strict=True)
        ]

    def contains(self, direction: Vector) -> bool:
        """Whether a unit direction is inside: find the wedge that contains it, then test the wedge's edge."""
        x, y, z = direction
        for (a, b, c), (d, e, f), (g, h, i) in self._wedges:
            if a * x + b * y + c * z >= 0.0 > d * x + e * y + f * z:
                return g * x + h * y + i * z >= 0.0
        g, h, i = self._wedges[0][2]
        return g * x + h * y + i * z >= 0.0

    def nearest(self, direction: Vector) -> Vector:
        """The nearest direction inside to a unit direction outside, a little inside of the edge."""
        angle, inward = self._cone.signed_angle(direction)
        # a share of the way to the middle; larger than rounding
        found = np.cos(angle) * np.array(direction) - np.sin(angle) * inward + 1e-6 * self._cone.visible
        return three(found / np.linalg.norm(found))


class ConeGuard(LimbGuard):
    """Keeps one limb in its cone while the nodes of some limbs move.

    A limb that has left its cone is projected to the nearest direction inside (Wilhelms and Van Gelder 2001): the
    joints of the ball joint turn, each to its best, until the limb points there.
    """

    def __init__(self, figure: Figure, limbs: Limbs, name: str) -> None:
        cone = figure.cones[name]
        super().__init__(figure, limbs, cone.limb, cone.reference)
        self._polygon, self._axis = Polygon(cone.cone), np.asarray(cone.axis, dtype=float)

    def holds(self, data: Any) -> bool:
        """Whether the limb is in its cone at the joint placements of Pinocchio's data."""
        return self._polygon.contains(three((self._limb.rotation(data) @ self._axis) @ self._base.rotation(data)))

    def inside(self) -> bool:
        """Whether the limb is in its cone, after `limbs.forward`."""
        return self._polygon.contains(self._base.seen(*self._limb.direction(*self._axis)))

    def turn_back(self) -> None:
        """Turn the joints of the limb to the nearest direction of its cone, and call `limbs.forward`."""
        nearest = self._polygon.nearest(self._base.seen(*self._limb.direction(*self._axis)))
        target, local = self._base.direction(*nearest), rotated(self._limb.placement, *self._axis)
        Aims(self._limbs, [self._limb.node], [local], [target], [False]).sweep_until(self.nodes, self.inside)


Part = ConeGuard | RangeGuard
"""What is kept: `read` it at a posture, ask whether it is `inside`, and `turn_back` its `nodes`."""


class Guard:
    """Keeps cones and ranges that share nodes."""

    def __init__(self, limbs: Limbs, parts: Sequence[Part]) -> None:
        self.parts, self._limbs = tuple(parts), limbs
        self._rows = np.array(sorted({node for part in parts for node in part.nodes}), dtype=np.intp)
        self._last: Array | None = None

    def read(self, q: Array, data: Any) -> None:
        """Begin at the posture q (nq,) with its placements in `data`, after `limbs.read` and `limbs.forward`."""
        self._last = None
        for part in self.parts:
            part.read(q, data)
        self._remember()

    def keep(self) -> bool:
        """Bring the nodes back inside, after `limbs.forward`, and call it; true if they are inside then."""
        if self._remember():
            return True
        for _ in range(2):  # to bring a limb back into one may take it out of another
            for part in self.parts:
                if not part.inside():
                    part.turn_back()
            if self._remember():
                return True
        if self._last is not None:
            self._retreat(self._last)
        return self._remember()

    def _inside(self) -> bool:
        return all(part.inside() for part in self.parts)

    def _remember(self) -> bool:
        if not self._inside():
            return False
        self._last = self._limbs.values[self._rows]
        return True

    def _retreat(self, last: Array) -> None:
        """Move from the last values inside as far towards the present ones as all parts allow."""
        wanted = self._limbs.values[self._rows]
        inside, outside = 0.0, 1.0
        for _ in range(20):  # to a millionth of the motion
            middle = 0.5 * (inside + outside)
            self._blend(last, wanted, middle)
            if self._inside():
                inside = middle
            else:
                outside = middle
        self._blend(last, wanted, inside)

    def _blend(self, first: Array, second: Array, share: float) -> None:
        self._limbs.values[self._rows] = first + share * (second - first)
        self._limbs.forward()


def guards(figure: Figure, limbs: Limbs, kept: Kept) -> list[Guard]:
    """Guards of the kept cones and ranges that these limbs can leave."""
    groups: list[list[Part]] = []
    for part in (*cone_guards(figure, limbs, kept), *range_guards(figure, limbs, kept.ranges)):
        sharing = [group for group in groups if any(set(part.nodes) & set(other.nodes) for other in group)]
        groups = [group for group in groups if group not in sharing]
        groups.append([*(other for group in sharing for other in group), part])
    return [Guard(limbs, group) for group in groups]


def cone_guards(figure: Figure, limbs: Limbs, kept: Kept) -> list[ConeGuard]:
    """The kept cones that these limbs can leave."""
    made = [ConeGuard(figure, limbs, name) for name in (figure.cones if kept.cones is None else kept.cones)]
    return [guard for guard in made if guard.nodes]
