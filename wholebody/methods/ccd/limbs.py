"""Kinematics of a tree of joints of one degree of freedom each, as compiled loops."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from math import atan2, cos, inf, sin
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled, with_loops

Vector = tuple[float, float, float]
Placement = tuple[float, ...]
"""Twelve floats: the rotation row by row, then the translation."""

WORLD: Placement = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
SAME = 1e-12  # part of a joint's motion that is rounding


class Limbs:
    """Joints with one degree of freedom: their values, limits and placements.

    Attributes:
        joints: Pinocchio's index of each node's joint, ascending.
        values: (n,) radians or metres, one a node; change them and call `forward`.
        limits: (2, n) of each node, `lower` and `upper`; infinite for no limit.
        frames: (n + 1, 12) after `forward`: placement of each node in the world, rotation row by row, then translation;
            the last row is the world itself.
        lines: (n, 6) after `forward`: unit axis and origin of each node in the world.
        parents: (n,) parent node of each; -1 is the world.
        places: (n, 12) placement of each in its parent's frame before it moves, as in `frames`.
        slides: (n,) whether a node is prismatic; others turn.
        axes: (n, 3) unit axis in the joint's own frame.
        paths: for each node, the nodes that move it, including itself, from the tip inwards.
        plans: of sweeps, by what is carried and which nodes move.
    """

    def __init__(self, model: pin.Model, joints: Iterable[int]) -> None:
        """Find the tree of joints with one degree of freedom, see `movable`; `read` then reads their values."""
        self.model = model
        self.joints = tuple(sorted(set(joints)))
        self.node_of = {joint: node for node, joint in enumerate(self.joints)}
        count = len(self.joints)
        self._kernel = compiled_kernel()
        self.values, self.limits = np.zeros(count), np.array([np.full(count, -inf), np.full(count, inf)])
        self.lower, self.upper = self.limits
        self.frames, self.lines = np.tile(np.array(WORLD), (count + 1, 1)), np.zeros((count, 6))
        self.parents = np.array([self.carrier(model.parents[joint]) for joint in self.joints], dtype=np.intp)
        self.paths: list[tuple[int, ...]] = []
        self.plans: dict[Hashable, Any] = {}
        for node, parent in enumerate(self.parents.tolist()):
            self.paths.append((node, *self.paths[parent]) if parent >= 0 else (node,))
        motions = np.reshape([_motion(model.joints[joint]) for joint in self.joints], (-1, 2, 3))  # slide, turn
        self.slides: Mask = np.abs(motions[:, 0]).max(axis=1, initial=0.0) > 0.5
        self.axes = np.where(self.slides[:, None], motions[:, 0], motions[:, 1])
        self.places = np.tile(np.array(WORLD), (count, 1))
        self._first = np.array([model.joints[joint].idx_q for joint in self.joints], dtype=np.intp)
        wide = np.array([model.joints[joint].nq == 2 for joint in self.joints], dtype=bool)
        self._plain, self._wide = np.flatnonzero(~wide), np.flatnonzero(wide).tolist()  # one value, or cosine and sine
        self._plain_q = self._first[self._plain]
        self.lower[self._plain] = np.array(model.lowerPositionLimit)[self._plain_q]
        self.upper[self._plain] = np.array(model.upperPositionLimit)[self._plain_q]
        self._loose: list[tuple[int, int, int]] = []  # node, joint it hangs on, and that of its parent node or -1
        for node, joint in enumerate(self.joints):
            above, parent = int(model.parents[joint]), int(self.parents[node])
            if parent >= 0 and self.joints[parent] == above:
                self.places[node] = floats(model.jointPlacements[joint])
            else:
                self._loose.append((node, above, self.joints[parent] if parent >= 0 else -1))

    def carrier(self, joint: int) -> int:
        """Node that moves a joint of the model: its own, or the nearest towards the root; -1 if none does."""
        while joint > 0:
            if joint in self.node_of:
                return self.node_of[joint]
            joint = int(self.model.parents[joint])
        return -1

    def between(self, base: int, tip: int) -> tuple[int, ...]:
        """The nodes that move node `tip` relative to node `base`, from the tip inwards; -1 is the world."""
        under = self.paths[base] if base >= 0 else ()
        return tuple(node for node in (self.paths[tip] if tip >= 0 else ()) if node not in under)

    def read(self, q: Array, data: Any) -> None:
        """Read values from a posture q (nq,), and placements of other joints from `data` at the same posture."""
        self.values[self._plain] = q[self._plain_q]
        for node in self._wide:
            first = self._first[node]
            self.values[node] = atan2(float(q[first + 1]), float(q[first]))
        for node, above, parent in self._loose:
            base = data.oMi[above] * self.model.jointPlacements[self.joints[node]]
            if parent >= 0:
                base = data.oMi[parent].actInv(base)
            self.places[node] = floats(base)

    def write(self, q: Array) -> None:
        """Write the values into a posture q (nq,), in place."""
        q[self._plain_q] = self.values[self._plain]
        for node in self._wide:
            first, value = self._first[node], float(self.values[node])
            q[first], q[first + 1] = cos(value), sin(value)

    def forward(self) -> None:
        """Compute `frames` and `lines` from `values`."""
        self._kernel.forward(self.parents, self.places, self.slides, self.axes, self.values, self.frames, self.lines)

    @property
    def arrays(self) -> tuple[Any, ...]:
        """What `descend` takes of them."""
        return (
            self.parents, self.places, self.slides, self.axes, self.values, self.limits, self.frames, self.lines,
        )  # fmt: skip

    def frame(self, node: int) -> Placement:
        """Placement of a node after `forward`, -1 being the world, as twelve floats."""
        return tuple(self.frames[node].tolist())


class CarriedFrame:
    """A frame of the model, which these limbs may move.

    Attributes:
        node: the node that carries it; -1 if none does.
        placement: of the frame in that node's frame, or in the world; after `read`.
    """

    def __init__(self, limbs: Limbs, frame: int) -> None:
        described = limbs.model.frames[frame]
        self._limbs, self._joint, self._fixed = limbs, int(described.parentJoint), described.placement
        self.node = limbs.carrier(self._joint)
        self.placement = floats(self._fixed)

    def read(self, data: Any) -> bool:
        """Read what the limbs do not move from `data`, at the posture that `Limbs.read` has read; false for nothing."""
        joint = self._limbs.joints[self.node] if self.node >= 0 else 0
        if joint != self._joint:
            self.placement = floats(data.oMi[joint].actInv(data.oMi[self._joint] * self._fixed))
        return joint != self._joint

    def rotation(self, data: Any) -> Array:
        """(3, 3) rotation at the joint placements of Pinocchio's data."""
        return np.asarray(data.oMi[self._joint].rotation @ self._fixed.rotation)

    def direction(self, x: float, y: float, z: float) -> Vector:
        """The world's components of a direction of this frame, after `Limbs.forward`."""
        return rotated(self._limbs.frame(self.node), *rotated(self.placement, x, y, z))

    def seen(self, x: float, y: float, z: float) -> Vector:
        """A direction of the world in the components of this frame, after `Limbs.forward`."""
        return seen_from(self.placement, *seen_from(self._limbs.frame(self.node), x, y, z))


@with_loops(__name__)
def compiled_kernel(_: Any) -> None:
    """This module, after its loops are compiled or loaded from the cache; called before a solve, not during it."""
    none, slides, places = np.zeros(0), np.zeros(0, dtype=bool), np.zeros((0, 12))
    forward(np.zeros(0, dtype=np.intp), places, slides, np.zeros((0, 3)), none, places, np.zeros((0, 6)))


def three(vector: Any) -> Vector:
    """A vector (3,) as floats."""
    x, y, z = vector.tolist()
    return x, y, z


def movable(model: pin.Model, joint: int) -> bool:
    """Whether a joint can be a node: it is revolute or prismatic with one axis."""
    made = model.joints[joint]
    if made.nv != 1 or made.nq > 2:
        return False
    return bool((np.abs(_motion(made)).max(axis=1) < SAME).any())


def floats(placement: Any) -> Placement:
    """Twelve floats of a pin.SE3: the rotation row by row, then the translation."""
    return (*placement.rotation.ravel().tolist(), *placement.translation.tolist())


def moved(frame: Placement, x: float, y: float, z: float) -> Vector:
    """The world's coordinates of a point of a frame."""
    a, b, c, d, e, f, g, h, i, tx, ty, tz = frame
    return a * x + b * y + c * z + tx, d * x + e * y + f * z + ty, g * x + h * y + i * z + tz


def rotated(frame: Placement, x: float, y: float, z: float) -> Vector:
    """The world's components of a direction of a frame."""
    a, b, c, d, e, f, g, h, i, _, _, _ = frame
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def seen_from(frame: Placement, x: float, y: float, z: float) -> Vector:
    """A direction of the world in the components of a frame: the inverse of `rotated`."""
    a, b, c, d, e, f, g, h, i, _, _, _ = frame
    return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z


def _motion(joint: Any) -> Array:
    """(2, 3) how a joint of one degree of freedom moves: along an axis, and about one."""
    return np.asarray(joint.createData().S, dtype=float).reshape(2, 3)


@compiled()
def forward(
    parents: Indices, places: Array, slides: Mask, axes: Array, values: Array, frames: Array, lines: Array
) -> None:  # fmt: skip
    """Write frames (n + 1, 12) and lines (n, 6) from values; arguments as the attributes of `Limbs`."""
    for k in range(len(parents)):
        base, place, frame, line = frames[parents[k]], places[k], frames[k], lines[k]
        for row in range(3):
            a, b, c = base[3 * row], base[3 * row + 1], base[3 * row + 2]
            for column in range(3):
                frame[3 * row + column] = a * place[column] + b * place[3 + column] + c * place[6 + column]
            frame[9 + row] = base[9 + row] + (a * place[9] + b * place[10] + c * place[11])
            line[row] = 0.0
            for column in range(3):
                line[row] += frame[3 * row + column] * axes[k, column]
        if slides[k]:
            for row in range(3):
                frame[9 + row] += values[k] * line[row]
        else:
            co, si = cos(values[k]), sin(values[k])
            for column in range(3):
                x, y, z = turned(line, co, si, frame[column], frame[3 + column], frame[6 + column])
                frame[column], frame[3 + column], frame[6 + column] = x, y, z
        for row in range(3):
            line[3 + row] = frame[9 + row]


@compiled(inner=True)
def turned(line: Array, co: float, si: float, x: float, y: float, z: float) -> Vector:
    """A vector turned about a line's unit axis (Rodrigues)."""
    ux, uy, uz = line[0], line[1], line[2]
    along = (1.0 - co) * (ux * x + uy * y + uz * z)
    return (
        co * x + si * (uy * z - uz * y) + along * ux,
        co * y + si * (uz * x - ux * z) + along * uy,
        co * z + si * (ux * y - uy * x) + along * uz,
    )
