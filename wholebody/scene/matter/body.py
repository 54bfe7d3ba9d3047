"""Materials, and what makes a thing in a scene a rigid body that moves by itself: mass, velocity, joints, inertia."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, brief
from wholebody.base.checks import settle
from wholebody.base.errors import InputError
from wholebody.base.fields import Checked, Range, Vector
from wholebody.geometry.placement import FARTHEST, unit_vector
from wholebody.geometry.shapes import (
    Box,
    Capsule,
    Compound,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Mesh,
    Shape,
    Sphere,
    Torus,
)


class Surface(NamedTuple):
    """What happens where two materials touch: restitution (share of the speed of approach), and Coulomb's friction."""

    restitution: float
    friction: float


def _surface(pair: object, what: str) -> Surface:
    restitution, friction = checks.numbers(pair, (2,), f"{what}: (restitution, friction)").tolist()
    # Greatest coefficient of friction; rubber on dry concrete has about 1.
    return Surface(
        checks.number(restitution, f"{what}: restitution", 0.0, 1.0),
        checks.number(friction, f"{what}: friction", 0.0, 10.0),
    )


def _surfaces(value: object, what: str) -> Mapping[str, Surface]:
    checks.instance(value, Mapping, what, "give a dictionary such as {'wood': (0.3, 0.3)}")
    found = {checks.text(name, f"{what}: a name"): _surface(pair, f"{what}: {name!r}") for name, pair in value.items()}  # type: ignore[attr-defined]
    return MappingProxyType(found)


@dataclass(frozen=True)
class Material(Checked):
    """A material by its name, and what happens where it touches others.

    Attributes:
        name: such as "wood".
        against: name of the other material, or its own, to (restitution, friction).
        others: the same against materials that are not named, if they do not name this one either.

    Raises:
        InputError: a name that is no text, a restitution out of 0 to 1, or a friction out of 0 to 10.

    Examples:
        >>> rubber = wb.dynamics.Material("rubber", others=(0.6, 0.9))  # restitution, friction
    """

    name: Annotated[str, checks.text]
    against: Annotated[Mapping[str, tuple[float, float]], _surfaces] = field(default_factory=dict)
    others: Annotated[tuple[float, float], _surface] | None = None

    def __reduce__(self) -> tuple[object, ...]:
        return Material, (self.name, {other: tuple(pair) for other, pair in self.against.items()}, self.others)


MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        material.name: material
        for material in (
            Material("wood", {"wood": (0.3, 0.3), "human": (0.2, 0.2), "metal": (0.2, 0.1)}),
            Material("human", {"human": (0.1, 0.1), "metal": (0.2, 0.1)}),
            Material("metal", {"metal": (0.3, 0.1)}),
        )
    }
)
"""The materials of table 1."""

DEFAULT = MATERIALS["wood"]  # of things that say nothing of theirs


def material(value: object, what: str) -> Material:
    """A material, or one of table 1 by its name."""
    if isinstance(value, Material):
        return value
    if not isinstance(value, str):
        raise InputError(f"{what} is {checks.shown(value)}; give 'wood', 'human', 'metal' or a wb.dynamics.Material")
    return MATERIALS[checks.known(value, MATERIALS, "material", what)]


def surface(first: Material, second: Material) -> Surface:
    """Restitution and friction of two materials; InputError if neither of them knows the other."""
    found = first.against.get(second.name, second.against.get(first.name))
    found = found or first.others or second.others
    if found is None:
        own = second.name if first.name in MATERIALS else first.name  # those of table 1 are not the user's
        raise InputError(
            f"neither material {first.name!r} nor {second.name!r} says how they touch each other; give for example "
            f"wb.dynamics.Material({own!r}, others=(0.3, 0.3)), restitution and friction"
        )
    return Surface(*found)


Three: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True)
class BallJoint(Checked):
    """One point of a thing stays at one point of another, or of the world; the thing turns about it.

    A point outside of the shape makes a pendulum on a stiff rod without mass.

    Attributes:
        at: (3,) the point in the thing's axes, metres; where it is at the start is where it stays.
        to: name of the thing that holds it; None for the world. The two do not collide with each other.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> lamp = wb.Body(mass=1.0, joints=[wb.dynamics.BallJoint(at=(0.0, 0.0, 0.5))])
    """

    at: Annotated[Three, Vector(3, Range(-FARTHEST, FARTHEST, "m"))] = (0.0, 0.0, 0.0)
    to: Annotated[str, checks.text] | None = None


@dataclass(frozen=True)
class Hinge(BallJoint):
    """A thing turns about one axis, as a door does; `at` is a point of it.

    Attributes:
        axis: (3,) direction of the axis in the thing's axes.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> door = wb.Body(mass=20.0, joints=[wb.dynamics.Hinge(at=(0.0, -0.45, 0.0), axis=(0.0, 0.0, 1.0))])
    """

    axis: Annotated[Three, unit_vector] = (0.0, 0.0, 1.0)


def joints(value: object, what: str) -> tuple[BallJoint, ...]:
    """The joints of a body, checked."""
    given = [value] if isinstance(value, BallJoint) else checks.listed(value, what, "[wb.dynamics.Hinge((0, 0.4, 0))]")
    for joint in given:
        checks.instance(joint, BallJoint, what, "give wb.dynamics.Hinge(...) or wb.dynamics.BallJoint(...)")
    return tuple(given)


MASS = Range(1e-9, 1e9, "kg")


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

    Examples:
        >>> ball = wb.Sphere(0.05), wb.Body(mass=0.2, velocity=(1.0, 0.0, 0.0))
        >>> play = wb.Scene(wb.load("hand")).add(ball[0], name="ball", at=(0.4, 0.0, 0.0), body=ball[1])
    """

    density: Annotated[float, Range(1e-3, 1e6, "kg/m3")] | None = None  # osmium has 2.3e4
    mass: Annotated[float, MASS] | None = None
    material: Annotated[Material | str, material] = DEFAULT
    velocity: Annotated[Three, Vector(3, Range(-1e3, 1e3, "m/s"))] = (0.0, 0.0, 0.0)
    angular_velocity: Annotated[Three, Vector(3, Range(-1e3, 1e3, "rad/s"))] = (0.0, 0.0, 0.0)
    joints: Annotated[Sequence[BallJoint], joints] = ()

    __repr__ = brief

    def __post_init__(self) -> None:
        if self.density is not None and self.mass is not None:
            raise InputError("Body has both a density and a mass; give one of them")
        super().__post_init__()
        if self.mass is None and self.density is None:
            settle(self, "density", 700.0)  # kg/m³ of oak

    @property
    def resolved_material(self) -> Material:
        """The material itself, where it was given by name."""
        return material(self.material, "Body: material")


class MassProperties(NamedTuple):
    """What a rigid body is to dynamics."""

    mass: float  # kg
    centre: Array  # (3,) centre of mass in the shape's axes, metres
    inertia: Array  # (3, 3) about the centre, along the shape's axes, kg m2
    note: str = ""  # what was assumed about a shape that is no closed surface; empty if nothing


def mass_properties(shape: Shape, body: Body, name: str = "a body") -> MassProperties:
    """Mass, centre and inertia of a shape with the density or the mass of a body; of an open mesh its pieces count."""
    unit, note = _of_density_one(shape, name)
    density = body.density if body.mass is None else body.mass / unit.mass
    mass = float(unit.mass * density)
    MASS(mass, f"{name!r}: mass")
    return MassProperties(mass, np.array(unit.lever), np.array(unit.inertia) * (mass / unit.mass), note)


def _of_density_one(shape: Shape, name: str) -> tuple[pin.Inertia, str]:
    if isinstance(shape, HalfSpace):
        raise InputError(f"{name!r} is a half-space, which has no finite mass and cannot move; leave its body out")
    if isinstance(shape, Cylinder):  # whose piece is a prism
        volume = np.pi * shape.radius**2 * shape.length
        return pin.Inertia.FromCylinder(volume, shape.radius, shape.length), ""
    if isinstance(shape, Torus):
        return _of_torus(shape), ""
    if isinstance(shape, Compound):
        made = [(at.act(found), note) for part, at in shape.parts for found, note in (_of_density_one(part, name),)]
        return sum((found for found, _ in made), pin.Inertia.Zero()), next((note for _, note in made if note), "")
    if isinstance(shape, Mesh):
        import trimesh

        mesh = trimesh.Trimesh(shape.vertices, shape.faces, process=True)
        if mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0.0:
            found = mesh.mass_properties
            return pin.Inertia(float(found["mass"]), np.array(found["center_mass"]), np.array(found["inertia"])), ""
    total, exact = pin.Inertia.Zero(), isinstance(shape, (Box, Capsule, Ellipsoid, Hull, Sphere))
    for solid, placement, volume in shape.pieces():
        if not np.isfinite(volume):
            raise InputError(f"{name!r} has a piece without a finite volume and cannot move; leave its body out")
        centre, inertia = np.array(solid.computeCOM()), np.array(solid.computeMomentofInertiaRelatedToCOM())
        total = total + placement.act(pin.Inertia(volume, centre, inertia))
    return total, "" if exact else f"{name!r} is no closed mesh: its mass is that of its convex pieces"


def _of_torus(shape: Torus) -> pin.Inertia:
    """Of a ring with the radii R and r: I_z = m (R^2 + 3/4 r^2), I_x = I_y = m (R^2 / 2 + 5/8 r^2)."""
    big, small = shape.radius**2, shape.tube**2
    mass = 2.0 * np.pi**2 * shape.radius * small
    moments = (0.5 * big + 0.625 * small, 0.5 * big + 0.625 * small, big + 0.75 * small)
    return pin.Inertia(mass, np.zeros(3), mass * np.diag(moments))
