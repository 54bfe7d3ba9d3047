"""Constraint: ball joints within their reach cones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Mask
from wholebody.base.checks import known
from wholebody.base.errors import InputError
from wholebody.base.fields import Names
from wholebody.figures.state import State
from wholebody.tasks import inputs
from wholebody.tasks.base import Constraint, Surroundings, filled


class Limb(NamedTuple):
    """One reach cone on a figure.

    Attributes:
        cone: the spherical polygon.
        reference: the frame to which the cone is fixed.
        limb: the frame that turns within the cone.
        axis: (3,) the limb's direction in its frame, a unit vector.
    """

    cone: Any
    reference: inputs.Place
    limb: inputs.Place
    axis: Array


@dataclass(frozen=True, eq=False)
class ReachCones(Constraint):
    """Keep the direction of limbs inside the spherical polygons that bound the range of their joints.

    Limits of three revolute joints in a row allow directions that a shoulder or a hip does not (Wilhelms and Van Gelder
    2001, "Fast and Easy Reach-Cone Joint Limits", Journal of Graphics Tools 6(2)). The value is the signed angle from
    the limb's direction to the nearest edge of its polygon, positive inside [rad].

    Attributes:
        names: names of the figure's cones; None for all of them.
        limbs: each cone with its frames and joints, once resolved.

    Raises:
        InputError: names is no list.
    """

    names: Annotated[Sequence[str], Names("['left_shoulder']", least=0)] | None = None
    limbs: tuple[Limb, ...] = field(init=False, repr=False)
    _joints: NDArray[np.intp] = field(init=False, repr=False)
    _against: NDArray[np.intp] = field(init=False, repr=False)

    def resolve(self, scene: Surroundings, start: Array) -> ReachCones:
        """Find the cones and their frames.

        Raises:
            UnknownNameError: a name is unknown.
            InputError: the figure has no cones.
        """
        cones = scene.figure.cones
        if not cones:
            raise InputError("ReachCones: this figure has no reach cones; leave the constraint out")
        limbs = []
        for name in cones if self.names is None else self.names:
            cone = cones[known(name, cones, "reach cone", "ReachCones")]
            reference = inputs.find_place(scene, cone.reference, "ReachCones")
            limb = inputs.find_place(scene, cone.limb, "ReachCones")
            limbs.append(Limb(cone.cone, reference, limb, inputs.direction(cone.axis, f"ReachCones: axis of {name}")))
        return filled(
            self,
            limbs=tuple(limbs),
            _joints=np.array([limb.limb.joint for limb in limbs], dtype=np.intp),
            _against=np.array([limb.reference.joint for limb in limbs], dtype=np.intp),
        )

    @property
    def lower(self) -> Array:
        """(m,) zeros."""
        return np.zeros(len(self.limbs))

    @property
    def upper(self) -> Array:
        """(m,) inf."""
        return np.full(len(self.limbs), np.inf)

    @property
    def angular(self) -> Mask:
        """(m,) all rows are in radians."""
        return np.ones(len(self.limbs), dtype=bool)

    def value(self, state: State) -> Array:
        """(m,) signed angle to the edge of each cone, positive inside [rad]."""
        result = np.empty(len(self.limbs))
        for row, limb in enumerate(self.limbs):
            turn = state.frame(limb.reference.frame).rotation
            result[row] = limb.cone.signed_angle((state.frame(limb.limb.frame).rotation @ limb.axis) @ turn)[0]
        return result

    def jacobian(self, state: State) -> Array:
        """(m, nv)."""
        wrenches = np.zeros((len(self.limbs), 6))
        for row, limb in enumerate(self.limbs):
            turn = state.frame(limb.reference.frame).rotation
            direction = state.frame(limb.limb.frame).rotation @ limb.axis
            # The direction turns as w x d, so the angle changes by g . (w x d) = w . (d x g).
            x, y, z = direction.tolist()
            a, b, c = (turn @ limb.cone.signed_angle(direction @ turn)[1]).tolist()
            wrenches[row, 3:] = (y * c - z * b, z * a - x * c, x * b - y * a)
        return state.rows(wrenches, self._joints, self._against)
