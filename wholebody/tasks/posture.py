"""Goal: joints at their values in a known posture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, Mask
from wholebody.base.checks import array, listed, numbers
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.figures.state import State
from wholebody.geometry.placement import ROUNDING
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import Goal, filled


@dataclass(frozen=True, eq=False)
class Posture(Goal):
    """Move all joints, or some, to their values in a posture.

    The error is the tangent vector from that posture to the present one [rad; m for the root's position and for
    prismatic joints].

    Attributes:
        target: name of one of the figure's postures, or a posture (nq,).
        joints: names of the joints and groups that the goal moves; None for all, including the root.
        weight: factor on the squared error [1/rad^2 and 1/m^2].

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a posture, joint or group that the figure does not have.

    Examples:
        >>> arms = wb.Posture("t_pose", joints=["left_arm", "right_arm"])
    """

    target: str | ArrayLike
    _: KW_ONLY
    joints: Sequence[str] | None = None
    weight: inputs.Weight = 1.0
    resolved_target: Array = field(init=False, repr=False)  # (nq,) the posture
    dofs: Array = field(init=False, repr=False)  # (m,) indices of these joints in the tangent vector
    _angular: Mask = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the values."""
        super().__post_init__()
        if not isinstance(self.target, str):
            array(self.target, "Posture: target", "the name of a posture, or its numbers")
        if self.joints is not None and not isinstance(self.joints, str):
            object.__setattr__(self, "joints", tuple(listed(self.joints, "Posture: joints", "['left_arm']")))

    def resolve(self, scene: Scene, start: Array) -> Posture:
        """Look up the posture and the joints."""
        model = scene.model
        dofs = np.arange(model.nv) if self.joints is None else inputs.find_dofs(scene, self.joints, "Posture")
        return filled(self, resolved_target=self._find(scene), dofs=dofs, _angular=inputs.angular_dofs(scene)[dofs])

    @property
    def angular(self) -> Mask:
        """(m,) true for all rows except those of the root's position and of prismatic joints."""
        return self._angular

    def error(self, state: State) -> Array:
        """(m,) from the posture to the present one."""
        return np.asarray(pin.difference(state.model, self.resolved_target, state.q)[self.dofs])

    def jacobian(self, state: State) -> Array:
        """(m, nv)."""
        return np.asarray(pin.dDifference(state.model, self.resolved_target, state.q, pin.ARG1)[self.dofs])

    def _find(self, scene: Scene) -> Array:
        if isinstance(self.target, str):
            try:
                return np.asarray(scene.figure.posture(self.target), dtype=float)
            except UnknownNameError as error:
                raise UnknownNameError(error.kind, error.name, error.known, "Posture") from None
        q = numbers(self.target, (scene.model.nq,), "Posture: target")
        scene.figure.warn_of_angles(q, "Posture: target")
        normal = np.asarray(pin.normalize(scene.model, q))
        if np.abs(normal - q).max(initial=0.0) > ROUNDING:
            raise InputError("Posture: target holds a quaternion that is not of unit length; use pin.normalize")
        return normal
