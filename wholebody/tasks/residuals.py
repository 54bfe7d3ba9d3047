"""Differences between the placement of a frame and its target, and their exact derivatives.

A spatial velocity V = (v, w) has its linear part at the world's origin, so a point p has the rows ``[I, -skew(p)]``.
The rotation vector log3(R T') from a target T has the derivative Jlog3(R T')' w, in world axes (Chirikjian 2011,
"Stochastic Models, Information Theory, and Lie Groups", vol. 2, section 10.6).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.figures.state import State, Wrench
from wholebody.scene.scene import Scene
from wholebody.tasks.inputs import WORLD, Place

_FORCES: Array = np.eye(3, 6)


def point_rows(point: Array) -> Array:
    """Wrenches (3, 6) of a moving point's velocity; written out, as numpy's cross product costs 20 times as much."""
    rows: Array = _FORCES.copy()
    fill_point_rows(rows, point)
    return rows


def fill_point_rows(rows: Array, point: Array) -> None:
    """Write -skew(point) into columns 3 to 5 of the first three rows, whose diagonal there is already zero."""
    x, y, z = point.tolist()
    rows[0, 4] = z
    rows[0, 5] = -y
    rows[1, 3] = -z
    rows[1, 5] = x
    rows[2, 3] = y
    rows[2, 4] = -x


_angular = np.repeat((False, True), 3)
_angular.flags.writeable = False


class PlacementResidual(NamedTuple):
    """Placement of a frame relative to another less its target: position [m], then rotation vector [rad]."""

    place: Place  # the frame that moves
    placement: Any  # pin.SE3, its target in the base
    base: Place = WORLD  # the reference frame
    position: bool = True  # whether the residual has the position
    orientation: bool = True  # whether it has the rotation

    @property
    def angular(self) -> Mask:
        """(m,) whether each row is in radians."""
        return _angular[3 * (not self.position) : 3 + 3 * self.orientation]

    def value(self, state: State) -> Array:
        """(m,) the difference."""
        place = state.frame(self.place.frame)
        if self.base.frame:
            place = state.frame(self.base.frame).actInv(place)
        if not self.orientation:
            return np.asarray(place.translation - self.placement.translation)
        if not self.position:
            return np.asarray(pin.log3(self._turn(place)))
        result = np.empty(6)
        np.subtract(place.translation, self.placement.translation, out=result[:3])
        result[3:] = pin.log3(self._turn(place))
        return result

    def _turn(self, place: Any) -> Array:
        """(3, 3) from the orientation of the target to that of a placement."""
        turn: Array = place.rotation @ self.placement.rotation.T
        return turn

    def wrench(self, state: State) -> Wrench:
        """Derivative of `value`: m rows between the two joints."""
        place = state.frame(self.place.frame)
        if self.base.frame:
            rows = self._relative_rows(place, state.frame(self.base.frame))
        else:
            rows = np.zeros((3 * (self.position + self.orientation), 6))
            if self.position:
                rows[0, 0] = rows[1, 1] = rows[2, 2] = 1.0
                fill_point_rows(rows, place.translation)
            if self.orientation:
                rows[-3:, 3:] = pin.Jlog3(self._turn(place)).T
        return Wrench(rows, self.place.joint, self.base.joint)

    def _relative_rows(self, place: Any, base: Any) -> Array:
        """Rows on the velocity of the frame minus that of the base, both at the world's origin, in the base's axes."""
        turn = base.rotation.T
        blocks = []
        if self.position:
            blocks.append(turn @ point_rows(place.translation))
        if self.orientation:
            rows = np.zeros((3, 6))
            rows[:, 3:] = pin.Jlog3(self._turn(base.actInv(place))).T @ turn
            blocks.append(rows)
        return np.concatenate(blocks)


def placement_between(scene: Scene, q: Array, frame: str, base: str | None) -> Any:
    """Placement (pin.SE3) of one frame in another, or in the world, at the posture q (nq,)."""
    place = scene.figure.placement(q, frame)
    return place if base is None else scene.figure.placement(q, base).actInv(place)
