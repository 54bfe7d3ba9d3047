"""What makes a thing in a scene a rigid body that moves by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wholebody.base import checks
from wholebody.base.errors import InputError
from wholebody.scene.matter.joints import BallJoint, joints
from wholebody.scene.matter.materials import DEFAULT, Material, material

LIGHTEST, HEAVIEST = 1e-9, 1e9  # kg
THINNEST, DENSEST = 1e-3, 1e6  # kg/m3: osmium has 2.3e4
FASTEST = 1e3  # m/s and rad/s
DENSITY = 700.0  # kg/m3: of oak


@dataclass(frozen=True)
class Body:
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

    density: float | None = None
    mass: float | None = None
    material: Material | str = DEFAULT
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angular_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    joints: Sequence[BallJoint] = ()

    def __post_init__(self) -> None:
        if self.density is not None and self.mass is not None:
            raise InputError("Body has both a density and a mass; give one of them")
        if self.mass is not None:
            mass = checks.number(self.mass, "Body mass", LIGHTEST, HEAVIEST, "kg")
            object.__setattr__(self, "mass", mass)
        else:
            density = DENSITY if self.density is None else self.density
            density = checks.number(density, "Body density", THINNEST, DENSEST, "kg/m3, such as 700 for wood")
            object.__setattr__(self, "density", density)
        object.__setattr__(self, "material", material(self.material, "Body material"))
        object.__setattr__(self, "joints", joints(self.joints))
        for name in ("velocity", "angular_velocity"):
            values = checks.numbers(getattr(self, name), (3,), f"Body {name}")
            if np.abs(values).max() > FASTEST or float((values**2).sum()) > FASTEST**2:
                raise InputError(f"Body {name} is {checks.shown(getattr(self, name))}; give at most {FASTEST:g}")
            object.__setattr__(self, name, tuple(float(x) for x in values))

    @property
    def resolved_material(self) -> Material:
        """The material itself, where it was given by name."""
        return material(self.material, "Body material")
