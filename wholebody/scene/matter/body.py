"""What makes a thing in a scene a rigid body that moves by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from wholebody.base.checks import settle
from wholebody.base.errors import InputError
from wholebody.base.fields import Checked, Range, Vector
from wholebody.scene.matter.joints import BallJoint, joints
from wholebody.scene.matter.materials import DEFAULT, Material, material

MASS = Range(1e-9, 1e9, "kg")
DENSITY = 700.0  # kg/m3: of oak

Three: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True)
class Body(Checked):
    """Mass, material and velocity of a thing that moves by itself.

    Attributes:
        density: kg/m3, the same everywhere in the shape; 700, as oak has, if neither it nor a mass is given.
        mass: kg, in place of a density.
        material: "wood", "human", "metal", or a `Material` of your own.
        velocity: (3,) of the centre of mass at the start, m/s.
        angular_velocity: (3,) at the start about the world's axes, rad/s.
        joints: `wb.dynamics.Hinge` and `wb.dynamics.BallJoint` that hold it to other things or to the world.

    Raises:
        InputError: both a density and a mass, or a value that is not finite or out of range.
        UnknownNameError: there is no such material.
    """

    density: Annotated[float, Range(1e-3, 1e6, "kg/m3")] | None = None  # osmium has 2.3e4
    mass: Annotated[float, MASS] | None = None
    material: Annotated[Material | str, material] = DEFAULT
    velocity: Annotated[Three, Vector(3, Range(-1e3, 1e3, "m/s"))] = (0.0, 0.0, 0.0)
    angular_velocity: Annotated[Three, Vector(3, Range(-1e3, 1e3, "rad/s"))] = (0.0, 0.0, 0.0)
    joints: Annotated[Sequence[BallJoint], joints] = ()

    def __post_init__(self) -> None:
        if self.density is not None and self.mass is not None:
            raise InputError("Body has both a density and a mass; give one of them")
        super().__post_init__()
        if self.mass is None and self.density is None:
            settle(self, "density", DENSITY)

    @property
    def resolved_material(self) -> Material:
        """The material itself, where it was given by name."""
        return material(self.material, "Body: material")
