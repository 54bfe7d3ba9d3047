"""Kinematics of some joints of a figure on plain floats.

Cyclic coordinate descent turns one joint at a time, so arrays would not make its inner loop faster: on vectors of
three, a call into numpy costs more than all the arithmetic. Joints are nodes of a tree, in the model's order (a chain
is a tree without branches); a fixed transform between two nodes is part of the later node's placement.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import atan2, cos, inf, sin
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array

Placement = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
Line = tuple[float, float, float, float, float, float]

WORLD: Placement = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
X, Y, Z, OBLIQUE, SLIDE = range(5)
"""Kinds of joints: revolute about an axis of their own frame, revolute about another axis, or prismatic."""

SAME = 1e-12  # an axis or a rotation nearer than this to a simple one is replaced by the simple one


class Node(NamedTuple):
    """One joint.

    Attributes:
        parent: index of its parent node; -1 is the world.
        turn: rotation from the parent, row by row, or None for the identity.
        x, y, z: translation from the parent, metres.
        kind: X, Y, Z, OBLIQUE or SLIDE.
        sign: -1 if the joint turns about the negative axis.
        axis: unit axis in the joint's own frame.
    """

    parent: int
    turn: tuple[float, ...] | None
    x: float
    y: float
    z: float
    kind: int
    sign: float
    axis: tuple[float, float, float]


class Limbs:
    """Joints with one degree of freedom: their values, limits and placements.

    Attributes:
        joints: Pinocchio's index of each node's joint, ascending.
        values: radians or metres, one a node; change them and call `forward`.
        lower, upper: limits of each node; infinite for no limit.
        frames: after `forward`: placement of each node in the world, rotation row by row, then translation; the last
            entry is the world itself.
        lines: after `forward`: unit axis and origin of each node in the world.
        paths: for each node, the nodes that move it, including itself, from the tip inwards.
    """

    def __init__(self, model: pin.Model, joints: Iterable[int]) -> None:
        """Find the tree of the joints; `read` then reads their values.

        Args:
            model: Pinocchio's model.
            joints: indices of joints with one degree of freedom; see `movable`.
        """
        self.model = model
        self.joints = tuple(sorted(set(joints)))
        self.node_of = {joint: node for node, joint in enumerate(self.joints)}
        count = len(self.joints)
        self.values = [0.0] * count
        self.lower, self.upper = [-inf] * count, [inf] * count
        self.frames: list[Placement] = [WORLD] * (count + 1)
        self.lines: list[Line] = [(0.0, 0.0, 1.0, 0.0, 0.0, 0.0)] * count
        parents = [self.carrier(model.parents[joint]) for joint in self.joints]
        self.paths: list[tuple[int, ...]] = []
        for node, parent in enumerate(parents):
            self.paths.append((node, *self.paths[parent]) if parent >= 0 else (node,))
        self._nodes: list[Node] = []
        self._loose: list[int] = []
        for node, joint in enumerate(self.joints):
            kind, sign, axis = _kind(model.joints[joint])
            self._nodes.append(_placed(Node(parents[node], None, 0.0, 0.0, 0.0, kind, sign, axis), WORLD))
            place, parent = model.joints[joint], self.joints[parents[node]] if parents[node] >= 0 else 0
            if place.nq == 1:
                self.lower[node] = float(model.lowerPositionLimit[place.idx_q])
                self.upper[node] = float(model.upperPositionLimit[place.idx_q])
            if parent and parent == model.parents[joint]:
                self._nodes[node] = _placed(self._nodes[node], floats(model.jointPlacements[joint]))
            else:
                self._loose.append(node)

    def carrier(self, joint: int) -> int:
        """Node that moves a joint of the model: its own, or the nearest towards the root; -1 if none does."""
        while joint > 0:
            if joint in self.node_of:
                return self.node_of[joint]
            joint = int(self.model.parents[joint])
        return -1

    def read(self, q: Array, data: Any) -> None:
        """Read values from a posture q (nq,), and placements of other joints from `data` at the same posture."""
        for node, joint in enumerate(self.joints):
            place = self.model.joints[joint]
            first = place.idx_q
            self.values[node] = float(q[first]) if place.nq == 1 else atan2(float(q[first + 1]), float(q[first]))
        for node in self._loose:
            joint, parent = self.joints[node], self._nodes[node].parent
            base = data.oMi[int(self.model.parents[joint])] * self.model.jointPlacements[joint]
            if parent >= 0:
                base = data.oMi[self.joints[parent]].actInv(base)
            self._nodes[node] = _placed(self._nodes[node], floats(base))

    def write(self, q: Array) -> None:
        """Write the values into a posture q (nq,), in place."""
        for node, joint in enumerate(self.joints):
            place = self.model.joints[joint]
            value = self.values[node]
            if place.nq == 1:
                q[place.idx_q] = value
            else:
                q[place.idx_q], q[place.idx_q + 1] = cos(value), sin(value)

    def forward(self) -> None:
        """Compute `frames` and `lines` from `values`."""
        frames, lines, values = self.frames, self.lines, self.values
        for k, (parent, turn, px, py, pz, kind, sign, axis) in enumerate(self._nodes):
            a, b, c, d, e, f, g, h, i, x, y, z = frames[parent]
            x += a * px + b * py + c * pz
            y += d * px + e * py + f * pz
            z += g * px + h * py + i * pz
            if turn is not None:
                A, B, C, D, E, F, G, H, J = turn
                a, b, c = a * A + b * D + c * G, a * B + b * E + c * H, a * C + b * F + c * J
                d, e, f = d * A + e * D + f * G, d * B + e * E + f * H, d * C + e * F + f * J
                g, h, i = g * A + h * D + i * G, g * B + h * E + i * H, g * C + h * F + i * J
            value = sign * values[k]
            if kind == Y:
                co, si = cos(value), sin(value)
                lines[k] = (sign * b, sign * e, sign * h, x, y, z)
                frames[k] = (
                    co * a - si * c, b, si * a + co * c, co * d - si * f, e, si * d + co * f,
                    co * g - si * i, h, si * g + co * i, x, y, z,
                )  # fmt: skip
            elif kind == X:
                co, si = cos(value), sin(value)
                lines[k] = (sign * a, sign * d, sign * g, x, y, z)
                frames[k] = (
                    a, co * b + si * c, co * c - si * b, d, co * e + si * f, co * f - si * e,
                    g, co * h + si * i, co * i - si * h, x, y, z,
                )  # fmt: skip
            elif kind == Z:
                co, si = cos(value), sin(value)
                lines[k] = (sign * c, sign * f, sign * i, x, y, z)
                frames[k] = (
                    co * a + si * b, co * b - si * a, c, co * d + si * e, co * e - si * d, f,
                    co * g + si * h, co * h - si * g, i, x, y, z,
                )  # fmt: skip
            else:
                u, v, w = axis
                ux, uy, uz = a * u + b * v + c * w, d * u + e * v + f * w, g * u + h * v + i * w
                if kind == SLIDE:
                    x, y, z = x + value * ux, y + value * uy, z + value * uz
                    frames[k] = (a, b, c, d, e, f, g, h, i, x, y, z)
                else:
                    a, d, g = turned(ux, uy, uz, cos(value), sin(value), a, d, g)
                    b, e, h = turned(ux, uy, uz, cos(value), sin(value), b, e, h)
                    c, f, i = turned(ux, uy, uz, cos(value), sin(value), c, f, i)
                    frames[k] = (a, b, c, d, e, f, g, h, i, x, y, z)
                lines[k] = (ux, uy, uz, x, y, z)

    def slides(self, node: int) -> bool:
        """Whether a node is prismatic."""
        return self._nodes[node].kind == SLIDE


def movable(model: pin.Model, joint: int) -> bool:
    """Whether a joint can be a node: it is revolute or prismatic with one axis."""
    made = model.joints[joint]
    if made.nv != 1 or made.nq > 2:
        return False
    subspace = np.abs(np.asarray(made.createData().S).ravel())
    return bool(subspace[:3].max() < SAME or subspace[3:].max() < SAME)


def floats(placement: Any) -> Placement:
    """Twelve floats of a pin.SE3: the rotation row by row, then the translation."""
    return (*placement.rotation.ravel().tolist(), *placement.translation.tolist())


def moved(frame: Placement, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The world's coordinates of a point of a frame."""
    a, b, c, d, e, f, g, h, i, tx, ty, tz = frame
    return a * x + b * y + c * z + tx, d * x + e * y + f * z + ty, g * x + h * y + i * z + tz


def rotated(frame: Placement, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The world's components of a direction of a frame."""
    a, b, c, d, e, f, g, h, i, _, _, _ = frame
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def seen_from(frame: Placement, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A direction of the world in the components of a frame: the inverse of `rotated`."""
    a, b, c, d, e, f, g, h, i, _, _, _ = frame
    return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z


def turned(
    ux: float, uy: float, uz: float, co: float, si: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """A vector turned about a unit axis u (Rodrigues)."""
    along = (1.0 - co) * (ux * x + uy * y + uz * z)
    return (
        co * x + si * (uy * z - uz * y) + along * ux,
        co * y + si * (uz * x - ux * z) + along * uy,
        co * z + si * (ux * y - uy * x) + along * uz,
    )


def _placed(node: Node, placement: Placement) -> Node:
    turn = placement[:9]
    near = max(abs(value - plain) for value, plain in zip(turn, WORLD[:9], strict=True)) < SAME
    return node._replace(turn=None if near else turn, x=placement[9], y=placement[10], z=placement[11])


def _kind(joint: Any) -> tuple[int, float, tuple[float, float, float]]:
    """Kind, sign and axis of a joint."""
    subspace = np.asarray(joint.createData().S).ravel().tolist()
    sliding = max(abs(value) for value in subspace[3:]) < SAME
    x, y, z = subspace[:3] if sliding else subspace[3:]
    if sliding:
        return SLIDE, 1.0, (x, y, z)
    for kind, value in ((X, x), (Y, y), (Z, z)):
        if abs(value) > 1.0 - SAME:
            return kind, 1.0 if value > 0.0 else -1.0, (x, y, z)
    return OBLIQUE, 1.0, (x, y, z)
