"""Reach cones on plain floats: a limb that has left its cone is turned back to the nearest direction in it.

The polygons are those of `wholebody.figures.reach_cones` (Wilhelms and Van Gelder 2001). The paper projects a limb that
has left its cone to the nearest direction inside; the joints of the ball joint then turn, each to its best, until the
limb points there. If the limb is still outside, bisection moves it back towards the last values inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.figures.reach_cones import ReachCone
from wholebody.methods.ccd.limbs import Limbs, Placement, floats, rotated, seen_from
from wholebody.methods.ccd.sweep import Aims, sweep

Direction = tuple[float, float, float]

SWEEPS = 12  # over the joints of a ball joint: more than two are needed only near a singularity
INWARD = 1e-6  # margin inside the cone, as a share of the distance to its middle; larger than rounding
HALVINGS = 20  # of the motion back to the last values inside, to a millionth of it


class Polygon:
    """A reach cone on plain floats: the test of a direction, and the nearest direction inside."""

    def __init__(self, cone: ReachCone) -> None:
        """Copy the planes of the cone."""
        following = np.roll(cone.vertices, -1, axis=0)
        slices = np.cross(cone.visible, cone.vertices)
        self._middle: Direction = _three(cone.visible)
        self._wedges = [
            (_three(slice_), _three(after), _three(edge))
            for slice_, after, edge in zip(slices, np.roll(slices, -1, axis=0), cone.boundaries, strict=True)
        ]
        self._edges = [
            (_three(normal), _three(start), _three(end), _three(np.cross(normal, start)), _three(np.cross(end, normal)))
            for normal, start, end in zip(cone.boundaries, cone.vertices, following, strict=True)
        ]

    def contains(self, direction: Direction) -> bool:
        """Whether a unit direction is inside: find the wedge that contains it, then test the wedge's edge."""
        x, y, z = direction
        for (a, b, c), (d, e, f), (g, h, i) in self._wedges:
            if a * x + b * y + c * z >= 0.0 > d * x + e * y + f * z:
                return g * x + h * y + i * z >= 0.0
        g, h, i = self._wedges[0][2]
        return g * x + h * y + i * z >= 0.0

    def nearest(self, direction: Direction) -> Direction:
        """The nearest direction inside to a unit direction outside, a little inside of the edge."""
        x, y, z = direction
        best, found = -2.0, direction
        for (a, b, c), start, end, (d, e, f), (g, h, i) in self._edges:
            height = a * x + b * y + c * z
            px, py, pz = x - height * a, y - height * b, z - height * c
            length = (px * px + py * py + pz * pz) ** 0.5
            within = d * px + e * py + f * pz >= 0.0 and g * px + h * py + i * pz >= 0.0
            candidates: Sequence[Direction] = (start, end)
            if within and length > INWARD:
                candidates = ((px / length, py / length, pz / length),)
            for candidate in candidates:
                cosine = candidate[0] * x + candidate[1] * y + candidate[2] * z
                if cosine > best:
                    best, found = cosine, candidate
        mx, my, mz = self._middle
        px, py, pz = found[0] + INWARD * mx, found[1] + INWARD * my, found[2] + INWARD * mz
        length = (px * px + py * py + pz * pz) ** 0.5
        return px / length, py / length, pz / length


class ConeGuard:
    """Keeps one limb in its cone while the nodes of some limbs move.

    Attributes:
        nodes: the nodes that turn the limb in its cone; none if these limbs do not turn it.
    """

    def __init__(self, figure: Figure, limbs: Limbs, name: str) -> None:
        """Find the nodes between the cone's reference frame and the limb."""
        cone, model = figure.cones[name], figure.model
        limb, base = model.frames[figure.frame_id(cone.limb)], model.frames[figure.frame_id(cone.reference)]
        self._polygon = Polygon(cone.cone)
        self._limbs = limbs
        self._limb, self._base = limbs.carrier(int(limb.parentJoint)), limbs.carrier(int(base.parentJoint))
        self._limb_joint, self._base_joint = int(limb.parentJoint), int(base.parentJoint)
        self._base_placement = base.placement
        self._axis = _three(limb.placement.rotation @ cone.axis)
        under = limbs.paths[self._base] if self._base >= 0 else ()
        path = limbs.paths[self._limb] if self._limb >= 0 else ()
        self.nodes = tuple(node for node in path if node not in under)
        self._local: Direction = self._axis
        self._stand: Placement = floats(self._base_placement)
        self._stands = self._base >= 0 and limbs.joints[self._base] == self._base_joint  # the cone, in a node's frame
        self._last: Array | None = None
        self._rows = np.array(self.nodes, dtype=np.intp)

    def holds(self, data: Any) -> bool:
        """Whether the limb is in its cone at the joint placements of Pinocchio's data."""
        base = data.oMi[self._base_joint].rotation @ self._base_placement.rotation
        return self._polygon.contains(_three((data.oMi[self._limb_joint].rotation @ self._axis) @ base))

    def read(self, data: Any) -> None:
        """Read the placements that the nodes do not change; call `limbs.read` and `limbs.forward` first."""
        if not self.nodes:
            return
        own = self._limbs.joints[self._limb]
        if own != self._limb_joint:  # else the limb stands in its node's frame, always
            self._local = rotated(floats(data.oMi[own].actInv(data.oMi[self._limb_joint])), *self._axis)
        if not self._stands:
            base = data.oMi[self._base_joint] * self._base_placement
            if self._base >= 0:
                base = data.oMi[self._limbs.joints[self._base]].actInv(base)
            self._stand = floats(base)
        self._last = None
        self._remember()

    def keep(self) -> bool:
        """Turn the limb back into its cone if it has left it; true if it is inside then.

        Call it after `limbs.forward()`; if it moves something, it calls `limbs.forward()` itself.
        """
        if not self.nodes or self._remember():
            return True
        self._turn_back()
        if not self._remember() and self._last is not None:
            self._retreat(self._last)
        return self._remember()

    def _direction(self) -> Direction:
        """The limb's direction in the cone's reference frame."""
        limbs = self._limbs
        world = rotated(limbs.frame(self._limb), *self._local)
        return seen_from(self._stand, *seen_from(limbs.frame(self._base), *world))

    def _remember(self) -> bool:
        if not self._polygon.contains(self._direction()):
            return False
        self._last = self._limbs.values[self._rows]
        return True

    def _turn_back(self) -> None:
        """Turn the joints of the limb until it points to the nearest direction of its cone."""
        limbs = self._limbs
        wanted = rotated(self._stand, *self._polygon.nearest(self._direction()))
        target = rotated(limbs.frame(self._base), *wanted)
        for _ in range(SWEEPS):
            aims = Aims()
            aims.add(self._limb, rotated(limbs.frame(self._limb), *self._local), target, direction=True)
            sweep(limbs, aims, aims.plan(limbs, self.nodes))
            limbs.forward()
            if self._polygon.contains(self._direction()):
                return

    def _retreat(self, last: Array) -> None:
        """Move from the last values inside as far towards the present ones as the cone allows."""
        wanted = self._limbs.values[self._rows]
        inside, outside = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (inside + outside)
            self._blend(last, wanted, middle)
            if self._polygon.contains(self._direction()):
                inside = middle
            else:
                outside = middle
        self._blend(last, wanted, inside)

    def _blend(self, first: Array, second: Array, share: float) -> None:
        self._limbs.values[self._rows] = first + share * (second - first)
        self._limbs.forward()


def guards(figure: Figure, limbs: Limbs, names: Sequence[str] | None = None) -> list[ConeGuard]:
    """The cones that these limbs can leave: all of the figure's, or only some."""
    made = [ConeGuard(figure, limbs, name) for name in (figure.cones if names is None else names)]
    return [guard for guard in made if guard.nodes]


def _three(vector: Any) -> Direction:
    x, y, z = vector.tolist()
    return x, y, z
