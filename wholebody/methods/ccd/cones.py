"""Reach cones on plain floats: a limb that has left its cone is turned back to the nearest direction in it.

The polygons are those of `wholebody.figures.reach_cones` (Wilhelms and Van Gelder 2001). The paper projects a limb that
has left its cone to the nearest direction inside; the joints of the ball joint then turn, each to its best, until the
limb points there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.figures.reach_cones import ReachCone
from wholebody.methods.ccd.limbs import CarriedFrame, Limbs
from wholebody.methods.ccd.sweep import Aims, sweep

Direction = tuple[float, float, float]

SWEEPS = 12  # over the joints of a ball joint: more than two are needed only near a singularity
INWARD = 1e-6  # margin inside the cone, as a share of the distance to its middle; larger than rounding


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
        cone = figure.cones[name]
        self._polygon, self._axis, self._limbs = Polygon(cone.cone), np.asarray(cone.axis, dtype=float), limbs
        self._limb, self._base = (CarriedFrame(limbs, figure.frame_id(frame)) for frame in (cone.limb, cone.reference))
        self.nodes = limbs.between(self._base.node, self._limb.node)

    def holds(self, data: Any) -> bool:
        """Whether the limb is in its cone at the joint placements of Pinocchio's data."""
        return self._polygon.contains(_three((self._limb.rotation(data) @ self._axis) @ self._base.rotation(data)))

    def read(self, q: Array, data: Any) -> None:
        """Read what the limbs do not move from `data` at the posture q (nq,); call `limbs.read` first."""
        self._limb.read(data)
        self._base.read(data)

    def inside(self) -> bool:
        """Whether the limb is in its cone, after `limbs.forward`."""
        return self._polygon.contains(self._base.seen(*self._limb.direction(*self._axis)))

    def turn_back(self) -> None:
        """Turn the joints of the limb to the nearest direction of its cone, and call `limbs.forward`."""
        limbs = self._limbs
        nearest = self._polygon.nearest(self._base.seen(*self._limb.direction(*self._axis)))
        target = self._base.direction(*nearest)
        for _ in range(SWEEPS):
            aims = Aims()
            aims.add(self._limb.node, self._limb.direction(*self._axis), target, direction=True)
            sweep(limbs, aims, aims.plan(limbs, self.nodes))
            limbs.forward()
            if self.inside():
                return


def cone_guards(figure: Figure, limbs: Limbs, names: Sequence[str] | None = None) -> list[ConeGuard]:
    """The cones that these limbs can leave: all of the figure's, or only some."""
    made = [ConeGuard(figure, limbs, name) for name in (figure.cones if names is None else names)]
    return [guard for guard in made if guard.nodes]


def _three(vector: Any) -> Direction:
    x, y, z = vector.tolist()
    return x, y, z
