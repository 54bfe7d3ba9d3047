"""Checks of the arguments of terms, and lookup of the frames that they name."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Hashable, Sequence
from typing import Annotated, Any, TypeAlias, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.checks import array, numbers, shown
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.base.fields import Range
from wholebody.figures.description import Place as Place
from wholebody.figures.state import State
from wholebody.geometry.placement import PlacementLike, placement, unit_vector
from wholebody.scene.scene import Scene

T = TypeVar("T")

FARTHEST = 100.0  # Distance [m] beyond which a position is refused as a wrong unit: 100 mm are a tenth of a metre

WEIGHT = Range(1e-12, 1e12, wanted="a positive number such as 1, or leave it out")
"""Weights of terms: beyond this range the squares of weights make other terms vanish in rounding."""


WORLD = Place(0, 0, pin.SE3.Identity())  # The world: Pinocchio's frame and joint 0


def once(scene: Scene, key: Hashable, make: Callable[[], T]) -> T:
    """What follows from figure and things, where they are, and a key alone: made once, and read-only."""
    found: T = scene.built.known((key, scene.built.moves), make)
    return found


def find_place(scene: Scene, name: str, where: str) -> Place:
    """Look up a frame, or the joint of that name."""
    if not isinstance(name, str):
        raise InputError(f"{where} takes the name of a frame, not {shown(name)}")
    try:
        return scene.figure.place_of(name)
    except UnknownNameError as error:
        raise UnknownNameError(error.kind, error.name, error.known, where) from None


def find_feet(scene: Scene, feet: Sequence[str], where: str) -> list[Place]:
    """Look up the segments that a figure stands on; those of one figure among several have its name too."""
    exists = scene.model.existFrame
    owners = [body for body in scene.figure.bodies if body and all(exists(f"{body}{foot}") for foot in feet)]
    if owners and not any(map(exists, feet)):
        named = ", or ".join(str([f"{body}{foot}" for foot in feet]) for body in owners)
        raise InputError(f"{where}: the scene has several figures; name the feet of one, feet={named}")
    return [find_place(scene, foot, f"{where}, feet={[*feet]}") for foot in feet]


def find_base(scene: Scene, name: str | None, moved: str, where: str) -> Place:
    """Look up the reference frame of another frame; None is the world."""
    if name is None:
        return WORLD
    base = find_place(scene, name, where)
    if base.joint == find_place(scene, moved, where).joint:
        raise InputError(f"{where}: {moved!r} cannot move relative to {name!r}; name frames with a joint between them")
    return base


def body_of(scene: Scene, frames: Sequence[str]) -> str | None:
    """What the names of the figure begin with that all these frames belong to; None if they are of several."""
    found = {body for body in scene.figure.bodies for frame in frames if str(frame).startswith(body)}
    return found.pop() if len(found) == 1 else None


def root_of(scene: Scene, place: Place) -> int:
    """Index of the joint of the free root that carries a frame; 0, the world, for one of a fixed figure."""
    roots = set(scene.figure.roots.values())
    return next((int(joint) for joint in scene.model.supports[place.joint] if joint in roots), 0)


def find_dofs(scene: Scene, names: Sequence[str], where: str) -> Indices:
    """Tangent indices (k,) of joints and groups."""
    try:
        return np.asarray(scene.figure.dofs(names), dtype=np.intp)
    except UnknownNameError as error:
        raise UnknownNameError(error.kind, error.name, error.known, where) from None
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def angular_dofs(scene: Scene) -> Mask:
    """(nv,) whether each degree of freedom is in radians, which holds for rotations."""

    def found() -> Mask:
        state = State(scene.model)
        return np.asarray(state.folded(np.abs(state.jacobian[3:])).max(axis=0) > 0.5)

    return once(scene, "angular", found)


def point(value: object, where: str) -> Array:
    """Position (3,), metres."""
    place = numbers(value, (3,), where)
    check_reachable(place, where)
    return place


def check_reachable(place: Array, where: str) -> None:
    """Refuse a position that cannot be in metres."""
    distance = math.hypot(*place.tolist())  # the square of a large one is no number
    if distance <= 30.0:  # m: farther is hardly meant
        return
    if distance > FARTHEST:
        raise InputError(
            f"{where} is {distance:.4g} m away; lengths are in metres: divide millimetres by 1000, centimetres by 100"
        )
    warnings.warn(f"{where} is {distance:.3g} m away; lengths are in metres: divide centimetres by 100", stacklevel=3)


def direction(value: object, where: str) -> Array:
    """Unit vector (3,) along the given one."""
    unit = np.array(unit_vector(value, where))
    unit.flags.writeable = False
    return unit


def target_placement(at: PlacementLike, where: str) -> Any:
    """Placement (pin.SE3) from any of the forms of `wholebody.geometry.placement.placement`."""
    result = placement(at, where)
    check_reachable(result.translation, where)
    return result


def target_rotation(value: ArrayLike, where: str) -> Any:
    """Rotation, as a pin.SE3 without translation, from a quaternion (x, y, z, w) or a matrix (3, 3)."""
    given = array(value, where, "a quaternion (x, y, z, w) or a matrix (3, 3)")
    if given.shape == (4,):
        return target_placement((0.0, 0.0, 0.0, *numbers(given, (4,), where).tolist()), where)
    if given.shape == (3, 3):
        matrix = np.eye(4)
        matrix[:3, :3] = numbers(given, (3, 3), where)
        return target_placement(matrix, where)
    raise InputError(f"{where} takes a quaternion (x, y, z, w) or a matrix (3, 3), not shape {given.shape}")


def name(value: object, what: str) -> str:
    """The name of a segment, a piece or a thing."""
    if not isinstance(value, str) or not value:
        raise InputError(f"{what} is {shown(value)}; give the name of a segment or a thing")
    return value


Weight: TypeAlias = Annotated[float, WEIGHT]
Position: TypeAlias = Annotated[ArrayLike, point]
Direction: TypeAlias = Annotated[ArrayLike, direction]
Target: TypeAlias = Annotated[PlacementLike, target_placement]
Name: TypeAlias = Annotated[str, name]


def joints_with_mass(scene: Scene, where: str, frames: Sequence[str] = ()) -> range | None:
    """The joints whose mass counts: None for all, or those of the one figure that has these frames."""
    figure, joints = scene.figure, None
    if frames and len(figure.bodies) > 1:
        body = body_of(scene, frames)
        if body is None:
            raise InputError(f"{where}: {', '.join(frames)} are of several figures; state one {where} for each")
        joints = figure.bodies[body]
    masses = once(scene, "masses", lambda: [inertia.mass for inertia in scene.model.inertias])
    if not any(masses[k] > 0.0 for k in joints or range(1, len(masses))):
        raise InputError(f"{where}: nothing of {figure.name} that moves has mass; leave it out")
    return joints
