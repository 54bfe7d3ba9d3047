"""What a person sees, cones about the line of sight and what is in between; and `Look`, which turns the head."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from math import pi, radians, sqrt
from typing import Annotated, Any, TypeAlias

import coal
import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, Mask, brief, cross
from wholebody.base.errors import InputError
from wholebody.base.fields import Checked, Range
from wholebody.figures.state import State, Wrench
from wholebody.geometry.flesh import flesh_of
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import Constraint, filled

EYES = "gaze"  # frame between the eyes; its x axis points ahead
RAY = 1e-3  # m: radius of a line of sight
NEAR = 0.02  # m: at both ends of a line of sight that is not looked at: the thing that is seen hides nothing
TINY = 1e-12  # m^2, m^3: no direction is straight up or down exactly
BLURRED = 0.05  # m: nearer points are not seen

BORDER = 1e-3  # share by which a point may be beyond a field's border, which who turns the head meets to a tolerance
NEAREST = 1e-3  # m: a nearer point has no direction from the eyes


@dataclass(frozen=True)
class FieldOfView(Checked):
    """An elliptical cone about the normal line of sight.

    Attributes:
        horizontal: to either side, radians.
        up: above the normal line of sight, radians.
        down: below it, radians.
        declination: of the normal line of sight below the head's own axis ahead, radians.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> narrow = wb.ergonomics.FieldOfView(horizontal=0.26)
    """

    horizontal: Annotated[float, Range(1e-3, pi, "rad")] = radians(35.0)
    up: Annotated[float, Range(1e-3, pi, "rad")] = radians(40.0)
    down: Annotated[float, Range(1e-3, pi, "rad")] = radians(20.0)
    declination: Annotated[float, Range(-pi / 2, pi / 2, "rad")] = radians(15.0)

    def off(self, direction: Array) -> float:
        """How far a direction (3,) in the eyes' axes is off the line of sight: 1 at the border of the cone.

        Raises:
            InputError: it is no direction.
        """
        return float(np.sqrt(self.squared(checks.numbers(direction, (3,), "off: direction"))[0]))

    def squared(self, direction: Array) -> tuple[float, Array]:
        """The square of `off` of a direction (3,) in the eyes' axes, and its derivative (3,)."""
        sine, cosine = np.sin(self.declination), np.cos(self.declination)
        turned = np.array(((cosine, 0.0, -sine), (0.0, 1.0, 0.0), (sine, 0.0, cosine)))
        x, y, z = (turned @ direction).tolist()
        level = float(np.hypot(x, y))
        side, height = np.arctan2(y, x) / self.horizontal, np.arctan2(z, level)
        bound = self.up if height > 0.0 else self.down
        d_side = np.array((-y, x, 0.0)) / max(level**2, TINY) / self.horizontal
        d_height = np.array((-z * x, -z * y, level**2)) / max(level * (level**2 + z**2), TINY) / bound
        slope = 2.0 * (side * d_side + height / bound * d_height)
        return float(side**2 + (height / bound) ** 2), slope @ turned


def _field(value: object, where: str) -> FieldOfView:
    return checks.instance(value, FieldOfView, where, "give one such as wb.ergonomics.FieldOfView()")


FieldOfViewGiven: TypeAlias = Annotated[FieldOfView, _field]

COMFORTABLE = FieldOfView(radians(15.0), radians(15.0), radians(15.0))
"""Easy eye movement: 15 degrees to each side, up and down (MIL-STD-1472G, figure of the visual field: optimum eye
rotation about the normal line of sight, which is 15 degrees below the horizontal)."""

LARGEST = FieldOfView()
"""Largest eye movement: 35 degrees to each side, 40 up, 20 down (same source, maximum eye rotation)."""


@dataclass(frozen=True, repr=False)
class Sight:
    """What is known of seeing a point.

    Attributes:
        off: of the line of sight in shares of the largest eye movement; up to 1 the eyes reach it.
        comfortable: whether easy eye movement reaches it.
        distance: from the eyes, metres.
        hidden_by: name of the thing or segment that is in between; "" for none.

    Examples:
        >>> wb.ergonomics.sight(scene, standing, (2.0, 0.0, 1.5)).comfortable
        True
    """

    off: float
    comfortable: bool
    distance: float
    hidden_by: str

    __repr__ = brief

    @property
    def seen(self) -> bool:
        """Whether the point is seen without turning the head."""
        return self.off <= 1.0 + BORDER and not self.hidden_by and self.distance >= BLURRED


def sight(scene: Scene, q: Array, point: Array, *, eyes: str = EYES) -> Sight:
    """Whether a person in a posture sees a point, without turning the head.

    A thing that the point is in, or on the surface of, is what is looked at and hides nothing.

    Args:
        scene: with a figure that has the frame "gaze".
        q: (nq,) posture.
        point: (3,) metres.
        eyes: the frame between the eyes of the person who looks, such as "anna/gaze" of one of several figures.

    Raises:
        InputError: a value of the wrong kind, or a figure without eyes.

    Examples:
        >>> wb.ergonomics.sight(scene, standing, (2.0, 0.0, 1.5)).hidden_by
        ''
    """
    checks.instance(scene, Scene, "sight: scene", "make one with wb.Scene(figure)")
    q = checks.posture(q, scene.model.nq, "sight: q")
    scene.figure.warn_of_angles(q, "sight: q")
    target = inputs.point(point, "sight: point")
    if eyes not in scene.figure.frames:
        raise InputError(f"sight: {scene.figure.name} has no frame {eyes!r} between its eyes; load a person")
    between = scene.figure.placement(q, eyes)
    local = between.actInv(target)
    distance = float(np.linalg.norm(local))
    if distance < BLURRED:
        return Sight(0.0, False, distance, "")
    own = tuple(eyes.removesuffix(EYES) + part for part in ("head", "neck"))  # which do not hide anything from them
    hidden = _between(scene, q, np.asarray(between.translation), target, own)
    return Sight(LARGEST.off(local), COMFORTABLE.off(local) <= 1.0 + BORDER, distance, hidden)


def _between(scene: Scene, q: Array, eyes: Array, target: Array, own: tuple[str, ...]) -> str:
    """The piece that a thin capsule from the eyes to the point meets first, by its owner; "" for none of others."""
    distance = float(np.linalg.norm(target - eyes))
    length = distance - 2.0 * NEAR
    if length <= 0.0:
        return ""
    data = scene.model.createData()
    placed = pin.GeometryData(scene.geometry)
    pin.updateGeometryPlacements(scene.model, data, scene.geometry, placed, q)
    for one in flesh_of(scene.geometry):
        placed.oMg[one.piece] = one.placed(scene.geometry, data.oMi)
    ahead = (target - eyes) / distance
    turn = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), ahead).matrix()

    def meets(shape: Any, there: coal.Transform3s, reach: float) -> bool:
        """Whether the first `reach` metres of the line of sight meet a piece."""
        at = coal.Transform3s(turn, eyes + (NEAR + 0.5 * reach) * ahead)
        return _meet(shape, there, coal.Capsule(RAY, reach), at)

    spot, found, nearest = coal.Transform3s(np.eye(3), target), "", length
    pieces = [
        (piece.geometry, owner, coal.Transform3s(place.rotation, place.translation))
        for piece, owner, place in zip(scene.geometry.geometryObjects, scene.piece_owner, placed.oMg, strict=True)
        if owner not in own
    ]
    looked_at = {owner for shape, owner, there in pieces if _meet(shape, there, coal.Sphere(RAY), spot)}
    for shape, owner, there in pieces:
        if owner in looked_at or not meets(shape, there, nearest):
            continue
        free = 0.0
        for _ in range(16):  # halvings of a line of sight, to find where it meets a piece first: 0.2 mm of ten metres
            middle = 0.5 * (free + nearest)
            free, nearest = (free, middle) if meets(shape, there, middle) else (middle, nearest)
        found = owner
    return found


def _meet(first: Any, there: coal.Transform3s, second: Any, at: coal.Transform3s) -> bool:
    return bool(coal.collide(first, there, second, at, coal.CollisionRequest(), coal.CollisionResult()))


@dataclass(frozen=True, eq=False)
class Look(Constraint):
    """Keep a point within the field of view: eyes take their share of a gaze, and the head turns by the rest.

    Let r be how far the point is off the normal line of sight, 1 on the field's elliptical border
    (`FieldOfView.off`), and A the field's width to a side. The row is A (1 - r) outside and A (1 - r^2) / 2 inside
    [rad]: smooth, and nearly straight far off. `Axis("gaze", (1, 0, 0), toward=at)` turns the head all the way.

    Attributes:
        at: (3,) the point in the world [m].
        view: the field; by default that of easy eye movement, 15 degrees about a line 15 degrees below the head's axis.
        eyes: the frame between the eyes, such as "anna/gaze" of one of several figures.
        place: that frame and its joint; once resolved.

    Raises:
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> screen = wb.ergonomics.Look((0.6, 0.0, 1.2))
    """

    at: inputs.Position
    _: KW_ONLY
    view: FieldOfViewGiven = COMFORTABLE
    eyes: inputs.Name = EYES
    place: inputs.Place = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> Look:
        """Find the eyes."""
        return filled(self, place=inputs.find_place(scene, self.eyes, "Look"))

    @property
    def angular(self) -> Mask:
        """The row is in radians."""
        return np.ones((), dtype=bool)

    def value(self, state: State) -> Array:
        """(1,) the angle left within the field [rad]; negative outside."""
        squared = self.view.squared(self._local(state))[0]
        left = 1.0 - sqrt(squared) if squared > 1.0 else 0.5 * (1.0 - squared)
        return np.array([self.view.horizontal * left])

    def jacobian(self, state: State) -> Wrench:
        """One row. In the eyes' axes the point moves by -v + p x w as they move by v and turn by w."""
        local, frame = self._local(state), state.frame(self.place.frame)
        squared, slope = self.view.squared(local)
        slope = slope * (0.5 * self.view.horizontal / max(1.0, sqrt(squared)))
        force, moment = frame.rotation @ slope, frame.rotation @ cross(local, slope)
        return Wrench(np.hstack([force, moment + cross(frame.translation, force)])[None], self.place.joint)

    def _local(self, state: State) -> Array:
        """The point in the eyes' axes (3,), at least `NEAREST` away [m]."""
        local = np.asarray(state.frame(self.place.frame).actInv(np.asarray(self.at)))
        return local if local @ local > NEAREST**2 else np.array((NEAREST, 0.0, 0.0))
