"""Balls that contain a piece in every posture within the limits, relative to another joint.

A ball with centre p and radius r on a revolute joint of angle a - h ... a + h stays within one ball: the arc of p, at
distance d from the axis, has the enclosing ball of radius d sin h about the point at distance d cos h from the axis (of
radius d about the axis itself from h = 90 degrees on), and r is added. A prismatic joint adds half its travel. Towards
the leaves the same holds with the inverse motion. So any joint, or a frame that a `Hold` keeps in the world, can be the
reference. Balls grow from joint to joint and cover every posture: the bound is safe, not tight.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.records import with_values


class Range(NamedTuple):
    """The motion of a joint with one degree of freedom: rotation or translation along an axis, between two values.

    Attributes:
        axis: (3,) unit vector in the joint's frame.
        turns: whether it rotates; otherwise it translates.
        low, high: least and greatest value, radians or metres; infinite without a limit.
    """

    axis: Array
    turns: bool
    low: float
    high: float


class Balls(NamedTuple):
    """Balls that contain pieces, in the frame of one joint.

    Attributes:
        center: (k, 3) metres.
        radius: (k,) metres; infinite for a piece without a bound.
        piece: (k,) indices of the pieces.
    """

    center: Array
    radius: Array
    piece: Indices


class Reach:
    """Bounds on the positions of the pieces of a model within its joint limits."""

    def __init__(self, model: pin.Model, start: Array, resting: Balls, joint: Indices, frozen: Iterable[int]) -> None:
        """Read the joints.

        Args:
            model: the model.
            start: (nq,) posture that counts as possible even if it is beyond a limit.
            resting: a ball around every piece in the frame of the joint that carries it, in the order of the pieces.
            joint: (n,) that joint.
            frozen: degrees of freedom (tangent indices) that stay as at the start.
        """
        self.model, self.start = model, start
        self._resting, self._joint = resting, joint
        self._frozen = set(frozen)
        self._ranges = {j: self._range(j) for j in range(1, model.njoints)}
        self._data = model.createData()
        pin.forwardKinematics(model, self._data, start)
        self._still = {j: self._placement_at_start(j) for j in range(1, model.njoints) if self._stays(j)}
        self._near: list[list[int]] = [[] for _ in range(model.njoints)]
        for j in range(1, model.njoints):
            self._near[j].append(model.parents[j])
            self._near[model.parents[j]].append(j)

    def seen_from(self, joint: int) -> Balls:
        """Balls of all pieces in the frame of a joint; 0 is the world."""
        order, toward = [joint], {joint: -1}
        for node in order:
            for other in self._near[node]:
                if other not in toward:
                    toward[other] = node
                    order.append(other)
        arrived: Mapping[int, list[Balls]] = {node: [self._own(node)] for node in order}
        for node in reversed(order[1:]):
            balls = _joined(arrived[node])
            if len(balls.piece):
                arrived[toward[node]].append(self._across(balls, node, toward[node]))
        return _joined(arrived[joint])

    def _own(self, joint: int) -> Balls:
        mine = np.flatnonzero(self._joint == joint)
        return Balls(self._resting.center[mine], self._resting.radius[mine], mine)

    def _across(self, balls: Balls, node: int, to: int) -> Balls:
        """Transform balls from the frame of one joint to that of a neighbour in the tree."""
        up = self.model.parents[node] == to
        joint = node if up else to
        place = self.model.jointPlacements[joint]
        if up:
            return placed(self._moved(balls, joint, 1.0), place)
        return self._moved(placed(balls, place.inverse()), joint, -1.0)

    def _moved(self, balls: Balls, joint: int, sign: float) -> Balls:
        """Balls after motion of the joint, or with sign -1 of its base relative to it."""
        if joint in self._still:
            still = self._still[joint]
            return placed(balls, still if sign > 0 else still.inverse())
        bound = self._ranges[joint]
        if bound is None:
            if self.model.joints[joint].shortname().startswith("JointModelSpherical"):
                return Balls(
                    np.zeros_like(balls.center), balls.radius + np.linalg.norm(balls.center, axis=1), balls.piece
                )
            return with_values(balls, radius=np.full_like(balls.radius, np.inf))
        half = 0.5 * (bound.high - bound.low)
        middle = 0.5 * sign * (bound.high + bound.low) if np.isfinite(half) else 0.0
        if not bound.turns:
            return with_values(balls, center=balls.center + middle * bound.axis, radius=balls.radius + half)
        along = np.outer(balls.center @ bound.axis, bound.axis)
        across = balls.center - along
        lever = np.linalg.norm(across, axis=1)
        if half >= 0.5 * np.pi:
            return with_values(balls, center=along, radius=balls.radius + lever)
        turned = np.cos(middle) * across + np.sin(middle) * across @ pin.skew(bound.axis).T
        return with_values(balls, center=along + np.cos(half) * turned, radius=balls.radius + np.sin(half) * lever)

    def _range(self, index: int) -> Range | None:
        """Range of a revolute or prismatic joint; None for any other."""
        joint = self.model.joints[index]
        if joint.nv != 1 or joint.nq > 2 or "Mimic" in joint.shortname() or "Composite" in joint.shortname():
            return None
        twist = np.asarray(joint.createData().S).reshape(6)
        slide, turn = twist[:3], twist[3:]
        if slide.any() and turn.any():
            return None
        if joint.nq == 2:
            return Range(turn, True, -np.inf, np.inf)
        value = float(self.start[joint.idx_q])
        low, high = self.model.lowerPositionLimit[joint.idx_q], self.model.upperPositionLimit[joint.idx_q]
        low, high = min(float(low), value), max(float(high), value)
        return Range(turn if turn.any() else slide, bool(turn.any()), low, high)

    def _stays(self, index: int) -> bool:
        joint = self.model.joints[index]
        return self._frozen.issuperset(range(joint.idx_v, joint.idx_v + joint.nv))

    def _placement_at_start(self, index: int) -> Any:
        return self.model.jointPlacements[index].actInv(self._data.liMi[index])


def about_point(balls: Balls, point: Array) -> Balls:
    """Balls after any rotation about a point."""
    radius = balls.radius + np.linalg.norm(balls.center - point, axis=1)
    return Balls(np.tile(point, (len(radius), 1)), radius, balls.piece)


def placed(balls: Balls, place: Any) -> Balls:
    """Balls in another frame, given the placement of the old frame in it."""
    return with_values(balls, center=balls.center @ place.rotation.T + place.translation)


def _joined(parts: list[Balls]) -> Balls:
    if len(parts) == 1:
        return parts[0]
    return Balls(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
