"""Guards bring joints back into reach cones and ranges of motion, those that share joints together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.figures.motion_ranges import CoupledRange, EllipticRange, ReachCone, TwistRange
from wholebody.methods.ccd.limbs import CarriedFrame, Limbs, Vector, compiled_kernel, rotated, three
from wholebody.methods.ccd.sweep import Aims


class Kept(NamedTuple):
    """What descents keep."""

    fixed: frozenset[int] = frozenset()  # Pinocchio's indices of joints that must not move, not even to resolve overlap
    cones: tuple[str, ...] | None = None  # names of the reach cones; None for all of the figure's
    ranges: tuple[str, ...] = ()  # names of the ranges of motion


NOTHING_FIXED = Kept()


class Polygon:
    """A reach cone: the test of a direction, and the nearest direction inside.

    Attributes:
        wedges: (k, 9) normals of the two sides of each wedge, and of its edge.
    """

    def __init__(self, cone: ReachCone) -> None:
        self._cone, slices = cone, np.cross(cone.visible, cone.vertices)
        self.wedges = np.ascontiguousarray(np.hstack([slices, np.roll(slices, -1, axis=0), cone.boundaries]))

    def contains(self, direction: Vector) -> bool:
        """Whether a unit direction is inside."""
        return bool(compiled_kernel().in_cone(self.wedges, *direction))

    def nearest(self, direction: Vector) -> Vector:
        """The nearest direction inside to a unit direction outside, a little inside of the edge."""
        angle, inward = self._cone.signed_angle(direction)
        # a share of the distance to the middle; larger than rounding
        found = np.cos(angle) * np.array(direction) - np.sin(angle) * inward + 1e-6 * self._cone.visible
        return three(found / np.linalg.norm(found))


INWARD = 1e-9  # margin inside a range, as a share of an ellipse and in radians of a twist; larger than rounding
ROUNDING = 1e-12  # rad
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class _Sum:
    """A weighted sum of joint angles, of which some are nodes and the others stay as they are."""

    def __init__(self, figure: Figure, limbs: Limbs, joints: dict[str, float]) -> None:
        ids = {figure.joint_id(name): factor for name, factor in joints.items()}
        self.nodes = tuple(limbs.node_of[joint] for joint in ids if joint in limbs.node_of)
        self.factors = np.array([factor for joint, factor in ids.items() if joint in limbs.node_of])
        self._others = [
            (figure.model.joints[joint].idx_q, factor) for joint, factor in ids.items() if joint not in limbs.node_of
        ]
        self._limbs, self._rows, self._rest = limbs, np.array(self.nodes, dtype=np.intp), 0.0

    def read(self, q: Array) -> None:
        """Read the joints that are no nodes from the posture q (nq,)."""
        self._rest = sum(factor * float(q[place]) for place, factor in self._others)

    @property
    def value(self) -> float:
        """The sum, radians."""
        return self._rest + float(self.factors @ self._limbs.values[self._rows])

    def lessen(self, excess: float) -> None:
        """Change the sum by -excess by the least change of the nodes; what a limit stops is left to the others."""
        limbs, left = self._limbs, list(range(len(self.nodes)))
        while left and abs(excess) > ROUNDING:
            square = float(sum(self.factors[k] ** 2 for k in left))
            gone = 0.0
            for k in tuple(left):
                node, factor = self.nodes[k], float(self.factors[k])
                value = float(limbs.values[node])
                wanted = value - factor * excess / square
                new = min(max(wanted, float(limbs.lower[node])), float(limbs.upper[node]))
                limbs.values[node] = new
                gone += factor * (value - new)
                if new != wanted:
                    left.remove(k)
            excess -= gone


class _SumsGuard:
    """Keeps sums of joint angles; `nodes` are those that change them."""

    def __init__(self, limbs: Limbs, sums: Sequence[_Sum]) -> None:
        self._limbs, self._sums = limbs, sums
        self.nodes = tuple(node for angle in sums for node in angle.nodes)

    def read(self, q: Array, data: Any) -> None:
        """Read what the limbs do not move at the posture q (nq,)."""
        for angle in self._sums:
            angle.read(q)


class CoupledGuard(_SumsGuard):
    """Keeps a weighted sum of joint values below its bound; see `CoupledRange`."""

    def __init__(self, figure: Figure, limbs: Limbs, part: CoupledRange) -> None:
        self._sum, self._bound = _Sum(figure, limbs, dict(part.joints)), part.bound
        super().__init__(limbs, [self._sum])

    def inside(self) -> bool:
        """Whether the sum is within its bound."""
        return self._sum.value <= self._bound + ROUNDING

    def turn_back(self) -> None:
        """Move the joints by the least that is needed, each within its limits, and call `limbs.forward`."""
        self._sum.lessen(self._sum.value - self._bound)
        self._limbs.forward()


class EllipticGuard(_SumsGuard):
    """Keeps angles on or in an ellipse; see `EllipticRange`."""

    def __init__(self, figure: Figure, limbs: Limbs, part: EllipticRange) -> None:
        super().__init__(limbs, [_Sum(figure, limbs, dict.fromkeys(axis.joints, 1.0)) for axis in part.axes])
        self._axes = list(zip(self._sums, part.axes, strict=True))

    def inside(self) -> bool:
        """Whether the angles are in the ellipse."""
        return self._square() <= 1.0

    def turn_back(self) -> None:
        """Scale the angles to the edge, each joint within its limits, and call `limbs.forward`."""
        less = 1.0 - (1.0 - INWARD) / self._square() ** 0.5
        for angle, axis in self._axes:
            angle.lessen(less * (axis.offset + angle.value))
        self._limbs.forward()

    def _square(self) -> float:
        """The sum of the squares of the angles, each as a share of its limit."""
        shares = []
        for angle, axis in self._axes:
            value = axis.offset + angle.value
            shares.append(value / (axis.upper if value > 0.0 else axis.lower))
        return sum(share * share for share in shares)


class LimbGuard:
    """Keeps the direction or the turn of a limb in a reference frame; `nodes` are those that turn it there."""

    def __init__(self, figure: Figure, limbs: Limbs, limb: str, reference: str) -> None:
        self._limbs, self._kernel = limbs, compiled_kernel()
        self._limb, self._base = (CarriedFrame(limbs, figure.frame_id(frame)) for frame in (limb, reference))
        self._ends = self._limb.node, self._base.node
        self.nodes = limbs.between(self._base.node, self._limb.node)
        self._turns()

    def read(self, q: Array, data: Any) -> None:
        """Read what the limbs do not move from `data` at the posture q (nq,); call `limbs.read` first."""
        if self._limb.read(data) | self._base.read(data):
            self._turns()

    def _turns(self) -> None:
        """Note the rotations (9,) of both frames in their nodes."""
        self._own, self._turn = (np.array(frame.placement[:9]) for frame in (self._limb, self._base))


class TwistGuard(LimbGuard):
    """Keeps the twist of a limb about its long axis within its bound; see `TwistRange`."""

    def __init__(self, figure: Figure, limbs: Limbs, part: TwistRange) -> None:
        self._part, self._slope = part, np.array(part.slope @ part.center)
        super().__init__(figure, limbs, part.limb, part.reference)

    def inside(self) -> bool:
        """Whether the twist is within its bound, after `limbs.forward`."""
        return self._excess() <= 0.0

    def turn_back(self) -> None:
        """Turn the limb about its long axis, whose direction decides the bound, and call `limbs.forward`."""
        limb = self._limb
        back = pin.exp3(np.array([0.0, 0.0, -self._part.sign * (self._excess() + INWARD)]))
        targets = [limb.direction(*column) for column in back.T.tolist()]
        local = [rotated(limb.placement, *axis) for axis in AXES]
        Aims(self._limbs, [limb.node] * 3, local, targets, [False] * 3).sweep_until(self.nodes, self.inside)

    def _turns(self) -> None:
        super()._turns()
        self._turn = (self._turn.reshape(3, 3) @ self._part.center).ravel()  # the central rotation

    def _excess(self) -> float:
        """The twist beyond its bound, radians; negative inside."""
        part = self._part
        return float(
            self._kernel.twist_beyond(
                self._limbs.frames, *self._ends, self._own, self._turn, self._slope, part.sign, part.bound
            )
        )


RangeGuard = CoupledGuard | EllipticGuard | TwistGuard


class ConeGuard(LimbGuard):
    """Keeps one limb in its cone while the nodes of some limbs move.

    A limb that has left its cone is projected to the nearest direction inside (Wilhelms and Van Gelder 2001): the
    joints of the ball joint turn, each to its best, until the limb points there.
    """

    def __init__(self, figure: Figure, limbs: Limbs, name: str) -> None:
        cone = figure.cones[name]
        self._polygon, self._axis = Polygon(cone.cone), np.asarray(cone.axis, dtype=float)
        super().__init__(figure, limbs, cone.limb, cone.reference)

    def _turns(self) -> None:
        super()._turns()
        self._local = self._own.reshape(3, 3) @ self._axis  # the axis in the node's frame

    def holds(self, data: Any) -> bool:
        """Whether the limb is in its cone at the joint placements of Pinocchio's data."""
        return self._polygon.contains(three((self._limb.rotation(data) @ self._axis) @ self._base.rotation(data)))

    def inside(self) -> bool:
        """Whether the limb is in its cone, after `limbs.forward`."""
        frames = self._limbs.frames
        return bool(self._kernel.limb_in_cone(self._polygon.wedges, frames, *self._ends, self._local, self._turn))

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
        self._seen = b""  # its bytes

    def read(self, q: Array, data: Any) -> None:
        """Begin at the posture q (nq,) with its placements in `data`, after `limbs.read` and `limbs.forward`."""
        self._last, self._seen = None, b""
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
            self._limbs.values[self._rows] = self._last
            self._limbs.forward()
        return self._remember()

    def _remember(self) -> bool:
        """Whether all parts are inside, which the nodes' values alone decide; the last ones inside are kept."""
        values = self._limbs.values[self._rows]
        seen = values.tobytes()  # numpy takes five times as long to compare so few
        if seen != self._seen:
            for part in self.parts:
                if not part.inside():
                    return False
            self._last, self._seen = values, seen
        return True


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


def range_guards(figure: Figure, limbs: Limbs, names: Sequence[str]) -> list[RangeGuard]:
    """The named ranges that these limbs can leave."""
    kinds: dict[type, Any] = {CoupledRange: CoupledGuard, EllipticRange: EllipticGuard, TwistRange: TwistGuard}
    made = [kinds[type(figure.ranges[name])](figure, limbs, figure.ranges[name]) for name in names]
    return [guard for guard in made if guard.nodes]
