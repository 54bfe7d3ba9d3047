"""The tangent displacement of a posture as a function of bodies, and its rows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask, cross
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.batches import OBJECTIVE, Batch


class Chart:
    """Which bodies each degree of freedom of a model is a function of, one body a joint, and its derivative by them.

    Attributes:
        bodies: (n,) their numbers.
        pattern: (nv, 7 n) the variables that each degree of freedom depends on.
    """

    def __init__(self, model: pin.Model, first: int = 0) -> None:
        """Find the bodies (2, nv) and the axes (2, nv, 3) of each degree of freedom; `first` is Pinocchio's joint 1."""
        self._ends: Indices = np.zeros((2, model.nv), dtype=np.intp)
        self._axes = np.zeros((2, model.nv, 3))  # translation, rotation
        for joint in range(1, model.njoints):
            kind, parent = model.joints[joint], int(model.parents[joint])
            place = slice(kind.idx_v, kind.idx_v + kind.nv)
            self._ends[:, place] = [[first + joint - 1], [first + parent - 1 if parent else -1]]
            self._axes[:, place] = np.array(kind.createData().S).reshape(2, 3, -1).transpose(0, 2, 1)
        columns = (7 * (self._ends.T[:, :, None] - first) + np.arange(7)).reshape(model.nv, 14)
        sliding = self._axes[0].any(axis=1)[:, None]
        self._reads: Mask = (columns >= 0) & (sliding | (np.arange(14) % 7 >= 3))  # nothing of the world
        self._entries = np.nonzero(self._reads)[0], columns[self._reads]
        self.bodies: Indices = first + np.arange(model.njoints - 1)
        self._seen: tuple[Array, Array] = np.zeros(0), np.zeros(0)
        self.pattern: Mask = np.zeros((model.nv, 7 * (model.njoints - 1)), dtype=bool)
        self.pattern[self._entries] = True

    def rows(self, x: Array) -> Array:
        """Derivative (nv, 7 n) at bodies x (n + 1, 7), done once."""
        if self._seen[0] is not x:
            self._seen = x, self._rows(x)
        return self._seen[1]

    def _rows(self, x: Array) -> Array:
        """The velocity of each child relative to its parent, along the axes of the joint between them."""
        (child, parent), (slides, turns) = self._ends, self._axes
        first, second = x[child], x[parent]
        along, about = (quat.rotate(first[:, 3:], axes) for axes in (slides, turns))  # in the world
        lever = about + cross(first[:, :3] - second[:, :3], along)
        spins = quat.spin(first[:, 3:]), quat.spin(second[:, 3:])
        ours = np.hstack([along, np.einsum("ki,kij->kj", about, spins[0])])
        theirs = -np.hstack([along, np.einsum("ki,kij->kj", lever, spins[1])])
        result = np.zeros(self.pattern.shape)
        result[self._entries] = np.hstack([ours, theirs])[self._reads]
        return result


class DisplacementRows(Batch):
    """The displacement of a posture from another one, in its tangent, less a target: a row for each freedom."""

    role = OBJECTIVE

    def __init__(self, model: pin.Model, chart: Chart, posture: Callable[[Array], Array]) -> None:
        """Take what gives the posture (nq,) at bodies (n + 1, 7); `anchor` says from where it moves."""
        super().__init__(chart.bodies[None], ["the measures"])
        self.size, self.pattern = model.nv, chart.pattern
        self._model, self._chart, self._posture = model, chart, posture
        self.anchor(pin.neutral(model), np.zeros(model.nv))

    def anchor(self, q: Array, target: Array) -> None:
        """Count from the posture q (nq,), towards a displacement (nv,)."""
        self._from, self._target = q, target

    def residual(self, x: Array) -> Array:  # noqa: D102
        result: Array = pin.difference(self._model, self._from, self._posture(x)) - self._target
        return result[None]

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        return self._chart.rows(x)[None]
