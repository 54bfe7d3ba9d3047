"""Rigid bodies that move by themselves: motion, impacts, resting contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wholebody.base.imports import exported

if TYPE_CHECKING:
    from wholebody.dynamics.coupling import Spring
    from wholebody.scene.matter.body import BallJoint, Hinge
    from wholebody.scene.matter.materials import Material

__all__ = ["BallJoint", "Hinge", "Material", "Spring"]

__getattr__, __dir__ = exported(
    __name__,
    {
        "wholebody.dynamics.coupling": "Spring",
        "wholebody.scene.matter.body": "BallJoint Hinge",
        "wholebody.scene.matter.materials": "Material",
    },
)
