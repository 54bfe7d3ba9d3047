"""Guards bring joints back into reach cones and ranges of motion, those that share joints together."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, with_values
from wholebody.figures.figure import Figure
from wholebody.figures.motion_ranges import CoupledRange, EllipseAxis, EllipticRange, ReachCone, TwistRange
from wholebody.methods.ccd.guard_kernel import CONE, ELLIPSE, ROW, SUM, TWIST, compiled_kernel
from wholebody.methods.ccd.limbs import CarriedFrame, Limbs, Vector, rotated, three
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


class Tables(NamedTuple):
    """Parts as arrays, see `guard_kernel`."""

    parts: Array  # (k, 28)
    wedges: Array  # (w, 9) of cones
    angles: Array  # (a, 5) first and last of its terms, what they do not change, lower and upper limit
    terms: Array  # (t, 2) node and factor


class Part:
    """What is kept: `read` it at a posture, ask whether it is `inside`, and `turn_back` its nodes.

    Attributes:
        nodes: those that can leave it.
        sums: the angles that it is about.
        wedges: (w, 9) of a cone.
    """

    def __init__(self, limbs: Limbs, nodes: tuple[int, ...], row: Array) -> None:
        self.nodes, self._limbs, self._row, self._kernel = nodes, limbs, row, compiled_kernel()
        self.sums: Sequence[_Sum] = ()
        self.wedges = np.zeros((0, 9))

    def place(self, tables: Tables, number: int) -> None:
        """Be the row of a number in tables from now on."""
        self._tables = with_values(tables, parts=tables.parts[number : number + 1])
        self._tables.parts[0] = self._row
        self._row = self._tables.parts[0]

    def inside(self) -> bool:
        """Whether it is kept, after `limbs.forward`."""
        return bool(self._kernel.outside(*self._tables, self._limbs.frames, self._limbs.values) < 0)

    @abstractmethod
    def read(self, q: Array, data: Any) -> None:
        """Read what the limbs do not move from `data` at the posture q (nq,); call `limbs.read` first."""

    @abstractmethod
    def turn_back(self) -> None:
        """Move the nodes, each within its limits, until it is kept, and call `limbs.forward`."""


class _Sum:
    """A weighted sum of joint angles, of which some are nodes and the others stay as they are."""

    def __init__(self, figure: Figure, limbs: Limbs, joints: dict[str, float], axis: EllipseAxis | None = None) -> None:
        ids = {figure.joint_id(name): factor for name, factor in joints.items()}
        self.nodes = tuple(limbs.node_of[joint] for joint in ids if joint in limbs.node_of)
        self.factors = np.array([factor for joint, factor in ids.items() if joint in limbs.node_of])
        self._others = [
            (figure.model.joints[joint].idx_q, factor) for joint, factor in ids.items() if joint not in limbs.node_of
        ]
        self._limbs, self._rows = limbs, np.array(self.nodes, dtype=np.intp)
        self._offset, *limits = (0.0, -np.inf, np.inf) if axis is None else (axis.offset, axis.lower, axis.upper)
        self.row = np.array([0.0, 0.0, self._offset, *limits])  # of `Tables.angles`

    def read(self, q: Array) -> None:
        """Read the joints that are no nodes from the posture q (nq,)."""
        self.row[2] = self._offset + sum(factor * float(q[place]) for place, factor in self._others)

    @property
    def value(self) -> float:
        """The sum, radians, with the offset of its axis."""
        return float(self.row[2] + self.factors @ self._limbs.values[self._rows])

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


class SumsGuard(Part):
    """Keeps sums of joint angles."""

    def __init__(self, limbs: Limbs, sums: Sequence[_Sum], kind: float, bound: float) -> None:
        row = np.zeros(ROW)
        row[0], row[27] = kind, bound
        super().__init__(limbs, tuple(node for angle in sums for node in angle.nodes), row)
        self.sums = sums

    def read(self, q: Array, data: Any) -> None:
        """See `Part.read`."""
        for angle in self.sums:
            angle.read(q)


class CoupledGuard(SumsGuard):
    """Keeps a weighted sum of joint values below its bound; see `CoupledRange`."""

    def __init__(self, figure: Figure, limbs: Limbs, part: CoupledRange) -> None:
        self._bound = part.bound
        super().__init__(limbs, [_Sum(figure, limbs, dict(part.joints))], SUM, part.bound + ROUNDING)

    def turn_back(self) -> None:
        """Move the joints by the least that is needed, each within its limits, and call `limbs.forward`."""
        self.sums[0].lessen(self.sums[0].value - self._bound)
        self._limbs.forward()


class EllipticGuard(SumsGuard):
    """Keeps angles on or in an ellipse; see `EllipticRange`."""

    def __init__(self, figure: Figure, limbs: Limbs, part: EllipticRange) -> None:
        sums = [_Sum(figure, limbs, dict.fromkeys(axis.joints, 1.0), axis) for axis in part.axes]
        super().__init__(limbs, sums, ELLIPSE, 1.0)

    def turn_back(self) -> None:
        """Scale the angles to the edge, each joint within its limits, and call `limbs.forward`."""
        tables = self._tables
        square = float(self._kernel.square(self._row, tables.angles, tables.terms, self._limbs.values))
        less = 1.0 - (1.0 - INWARD) / square**0.5
        for angle in self.sums:
            angle.lessen(less * angle.value)
        self._limbs.forward()


class LimbGuard(Part):
    """Keeps the direction or the turn of a limb in a reference frame; `nodes` are those that turn it there."""

    def __init__(self, figure: Figure, limbs: Limbs, limb: str, reference: str, kind: float) -> None:
        self._limb, self._base = (CarriedFrame(limbs, figure.frame_id(frame)) for frame in (limb, reference))
        row = np.zeros(ROW)
        row[:3] = kind, self._limb.node, self._base.node
        super().__init__(limbs, limbs.between(self._base.node, self._limb.node), row)
        self._turns()

    def read(self, q: Array, data: Any) -> None:
        """See `Part.read`."""
        if self._limb.read(data) | self._base.read(data):
            self._turns()

    def _turns(self) -> None:
        """Note the rotations (9,) of both frames in their nodes."""
        self._row[5:14], self._row[14:23] = (frame.placement[:9] for frame in (self._limb, self._base))


class TwistGuard(LimbGuard):
    """Keeps the twist of a limb about its long axis within its bound; see `TwistRange`."""

    def __init__(self, figure: Figure, limbs: Limbs, part: TwistRange) -> None:
        self._part = part
        super().__init__(figure, limbs, part.limb, part.reference, TWIST)
        self._row[23:] = *(part.slope @ part.center), part.sign, part.bound

    def turn_back(self) -> None:
        """Turn the limb about its long axis, whose direction decides the bound, and call `limbs.forward`."""
        limb = self._limb
        back = pin.exp3(np.array([0.0, 0.0, -self._part.sign * (self._excess() + INWARD)]))
        targets = [limb.direction(*column) for column in back.T.tolist()]
        local = [rotated(limb.placement, *axis) for axis in AXES]
        Aims(self._limbs, [limb.node] * 3, local, targets, [False] * 3).sweep_until(self.nodes, self.inside)

    def _turns(self) -> None:
        super()._turns()
        self._row[14:23] = (self._row[14:23].reshape(3, 3) @ self._part.center).ravel()  # the central rotation

    def _excess(self) -> float:
        """The twist beyond its bound, radians; negative inside."""
        return float(self._kernel.twist_beyond(self._row, self._limbs.frames))


class ConeGuard(LimbGuard):
    """Keeps one limb in its cone while the nodes of some limbs move.

    A limb that has left its cone is projected to the nearest direction inside (Wilhelms and Van Gelder 2001): the
    joints of the ball joint turn, each to its best, until the limb points there.
    """

    def __init__(self, figure: Figure, limbs: Limbs, name: str) -> None:
        cone = figure.cones[name]
        self._polygon, self._axis = Polygon(cone.cone), np.asarray(cone.axis, dtype=float)
        super().__init__(figure, limbs, cone.limb, cone.reference, CONE)
        self.wedges = self._polygon.wedges

    def _turns(self) -> None:
        super()._turns()
        self._row[5:8] = self._row[5:14].reshape(3, 3) @ self._axis  # the axis in the node's frame

    def holds(self, data: Any) -> bool:
        """Whether the limb is in its cone at the joint placements of Pinocchio's data."""
        return self._polygon.contains(three((self._limb.rotation(data) @ self._axis) @ self._base.rotation(data)))

    def turn_back(self) -> None:
        """Turn the joints of the limb to the nearest direction of its cone, and call `limbs.forward`."""
        nearest = self._polygon.nearest(self._base.seen(*self._limb.direction(*self._axis)))
        target, local = self._base.direction(*nearest), rotated(self._limb.placement, *self._axis)
        Aims(self._limbs, [self._limb.node], [local], [target], [False]).sweep_until(self.nodes, self.inside)


class Guards:
    """Keeps cones and ranges of some limbs.

    Attributes:
        inside: (n,) the last values of all nodes that left nothing, NaN where there were none.
        tables: the parts as arrays, those that share nodes one after the other.
    """

    def __init__(self, limbs: Limbs, groups: Sequence[Sequence[Part]]) -> None:
        """Take the parts in groups that share no nodes."""
        self._limbs, self._kernel, self._groups = limbs, compiled_kernel(), groups
        self.inside = np.full(len(limbs.values), np.nan)
        self._rows = [
            np.array(sorted({node for part in group for node in part.nodes}), dtype=np.intp) for group in groups
        ]
        self._parts = [part for group in groups for part in group]
        sums = [angle for part in self._parts for angle in part.sums]
        terms = [(node, factor) for angle in sums for node, factor in zip(angle.nodes, angle.factors, strict=True)]
        wedges = np.vstack([np.zeros((0, 9)), *(part.wedges for part in self._parts)])
        self.tables = Tables(
            np.zeros((len(self._parts), ROW)),
            wedges,
            np.zeros((len(sums), 5)),
            np.reshape(terms, (-1, 2)).astype(float),
        )
        terms_before = wedges_before = sums_before = 0
        for number, part in enumerate(self._parts):
            counted = (wedges_before, len(part.wedges)) if len(part.wedges) else (sums_before, len(part.sums))
            part.place(self.tables, number)
            self.tables.parts[number, 3:5] = counted[0], sum(counted)
            for place, angle in enumerate(part.sums, sums_before):
                angle.row[:2] = terms_before, terms_before + len(angle.nodes)
                self.tables.angles[place] = angle.row
                angle.row, terms_before = self.tables.angles[place], terms_before + len(angle.nodes)
            wedges_before, sums_before = wedges_before + len(part.wedges), sums_before + len(part.sums)

    def read(self, q: Array, data: Any) -> None:
        """Begin at the posture q (nq,) with its placements in `data`, after `limbs.read` and `limbs.forward`."""
        for part in self._parts:
            part.read(q, data)
        self.inside.fill(np.nan)
        for group, rows in zip(self._groups, self._rows, strict=True):
            if all(part.inside() for part in group):
                self.inside[rows] = self._limbs.values[rows]

    def keep(self) -> None:
        """Bring the nodes back inside, or to where they last were, after `limbs.forward`, and call it."""
        if not self.kept():
            for group, rows in zip(self._groups, self._rows, strict=True):
                self._keep(group, rows)

    def kept(self) -> bool:
        """Whether nothing is left, after `limbs.forward`; `inside` has these values then."""
        limbs = self._limbs
        if self._kernel.outside(*self.tables, limbs.frames, limbs.values) >= 0:
            return False
        self.inside[:] = limbs.values
        return True

    def _keep(self, group: Sequence[Part], rows: Indices) -> None:
        for _ in range(2):  # to bring a limb back into one may take it out of another
            for part in group:
                if not part.inside():
                    part.turn_back()
            if all(part.inside() for part in group):
                self.inside[rows] = self._limbs.values[rows]
                return
        if not np.isnan(self.inside[rows]).any():
            self._limbs.values[rows] = self.inside[rows]
            self._limbs.forward()


def guards(figure: Figure, limbs: Limbs, kept: Kept) -> Guards:
    """Guards of the kept cones and ranges that these limbs can leave."""
    groups: list[list[Part]] = []
    for part in (*cone_guards(figure, limbs, kept), *range_guards(figure, limbs, kept.ranges)):
        sharing = [group for group in groups if any(set(part.nodes) & set(other.nodes) for other in group)]
        groups = [group for group in groups if group not in sharing]
        groups.append([*(other for group in sharing for other in group), part])
    return Guards(limbs, groups)


def cone_guards(figure: Figure, limbs: Limbs, kept: Kept) -> list[ConeGuard]:
    """The kept cones that these limbs can leave."""
    made = [ConeGuard(figure, limbs, name) for name in (figure.cones if kept.cones is None else kept.cones)]
    return [guard for guard in made if guard.nodes]


def range_guards(figure: Figure, limbs: Limbs, names: Sequence[str]) -> list[Part]:
    """The named ranges that these limbs can leave."""
    kinds: dict[type, Any] = {CoupledRange: CoupledGuard, EllipticRange: EllipticGuard, TwistRange: TwistGuard}
    made = [kinds[type(figure.ranges[name])](figure, limbs, figure.ranges[name]) for name in names]
    return [guard for guard in made if guard.nodes]
