"""The goals of an assembly, each of which may be moved without a new analysis."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.methods.newton.batches import Role
from wholebody.methods.newton.equations import EquationSet
from wholebody.tasks.inputs import point, target_placement


@dataclass(frozen=True)
class AssemblyGoal:
    """A point or a frame of a body, and where in the world it is to be.

    Attributes:
        label: its name in messages.
        index: of the body.
        local: placement of the point or the frame in the body (pin.SE3).
        target: pin.SE3; of a point's only the translation counts.
        whole: whether the orientation counts.
    """

    label: str
    index: int
    local: Any
    target: Any
    whole: bool

    def moved(self, target: Any) -> AssemblyGoal:
        """The same goal at another position, or placement.

        Raises:
            InputError: the target is not one.
        """
        return replace(self, target=to_target(target, self.whole, self.label))

    def error(self, body: Any) -> Array:
        """(6,) metres and radians in the world, from where it is to the target; `body` is the body's placement."""
        here = body * self.local
        turn = pin.log3(self.target.rotation @ here.rotation.T) if self.whole else np.zeros(3)
        return np.concatenate([self.target.translation - here.translation, turn])

    def between(self, body: Any, share: float) -> AssemblyGoal:
        """The goal at a share of the way from where it is now to the target."""
        error, here = self.error(body), body * self.local
        turned = pin.exp3(share * error[3:]) @ here.rotation
        return replace(self, target=pin.SE3(turned, here.translation + share * error[:3]))

    def enter(self, equations: EquationSet) -> None:
        """Add the goal's equations."""
        local, target = self.local, self.target
        ends = np.array(local.translation), np.array(target.translation)
        equations.coincide(self.index, -1, self.label, *ends, Role(weight=1.0))
        if self.whole:
            turns = pin.Quaternion(local.rotation), pin.Quaternion(target.rotation)
            equations.turn(self.index, -1, self.label, *turns, 3, Role(weight=1.0))


def to_target(target: Any, whole: bool, where: str) -> Any:
    """A target as pin.SE3: a position, or a placement if the goal is a whole frame.

    Raises:
        InputError: it is none.
    """
    return target_placement(target, where) if whole else pin.SE3(np.eye(3), point(target, f"{where}: target"))
