"""Equipment: what a figure wears on its segments, exact or as spheres, and ready-made pieces for people."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import coal
import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, brief
from wholebody.base.checks import choice, color, instance, known, listed, numbers, shown, text
from wholebody.base.errors import InputError
from wholebody.base.fields import Checked
from wholebody.base.files import is_file
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure
from wholebody.figures.postures import support
from wholebody.geometry.placement import PlacementLike, placement
from wholebody.geometry.shapes import Box, Mesh, Shape, Sphere
from wholebody.motion.sphere_filling import SphereFilling, fill_with_spheres
from wholebody.scene.scene import Scene

Side = Literal["front", "back", "left", "right"]


def _shape(value: Any, what: str) -> Shape:
    return instance(value, Shape, what, "give wb.Mesh('pack.obj'), wb.Box or another")


def _segments(value: Any, what: str) -> tuple[str, ...]:
    return tuple(text(name, what) for name in listed(value, what, "['thorax']"))


@dataclass(frozen=True, eq=False)
class Equipment(Checked):
    """A solid on a segment of a figure.

    `attach` puts it into a scene as it is: its exact shape moves with the segment and is tested against all others but
    those it rests on and neighbours of the segment that it touches in the figure's first posture. `filled` gives what a
    sphere-based test takes: spheres, which join the collision group of the segment and are tested across groups only.
    So a pouch of spheres on the thorax is not tested against the pelvis, and an exact one is, unless it rests on it.

    Attributes:
        name: a name that nothing else in the scene has.
        shape: the solid; a `Mesh` of several parts keeps its holes.
        to: the segment that carries it.
        at: its placement in the segment's frame; as for `Scene.add`.
        rests_on: segments that it is not tested against.
        color: red, green, blue and, if wanted, alpha, each from 0 to 1; a name such as "steelblue", or "#rrggbb".
        filling: the spheres that fill it, once `filled`.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> pack = wb.motion.Equipment("pack", wb.Box((0.15, 0.3, 0.4)), to="thorax", at=(-0.25, 0.0, 0.0))
    """

    name: Annotated[str, text]
    shape: Annotated[Shape, _shape]
    to: Annotated[str, text]
    at: Annotated[PlacementLike, placement] = (0.0, 0.0, 0.0)
    rests_on: Annotated[tuple[str, ...], _segments] = ()
    color: Annotated[tuple[float, float, float, float], color] | None = None
    filling: SphereFilling | None = field(default=None, init=False)

    __repr__ = brief

    @classmethod
    def worn(
        cls,
        shape: Shape,
        figure: Figure,
        *,
        name: str,
        to: str = "thorax",
        side: Side = "back",
        middle: tuple[float, float] = (0.0, 0.0),
        color: tuple[float, float, float, float] | None = None,
    ) -> Equipment:
        """Equipment against the surface of a segment: the nearest point of its bounding box touches it.

        It rests on all segments of the carrier's collision group, as straps hold a pack to the whole trunk.

        Args:
            shape: the solid, upright and facing forward in its own axes: x forward, y left, z up.
            figure: the figure that wears it.
            name: a name that nothing else in the scene has.
            to: the segment that carries it.
            side: of the segment in the figure's zero posture, in which x is forward and y left.
            middle: of the shape's bounding box: how far it is to the left of the segment's origin (on the left and
                right side: forward of it), and above it, metres.
            color: red, green, blue and, if wanted, alpha, each from 0 to 1; a name such as "steelblue", or "#rrggbb".

        Raises:
            UnknownNameError: the figure has no such segment, or there is no such side.
            InputError: a value of the wrong kind or range, or the segment has no pieces.
        """
        where = f"Equipment {text(name, 'Equipment: name')!r}"
        instance(figure, Figure, f"{where}: figure", "load one with wb.load('human')")
        _shape(shape, f"{where}: shape")
        known(to, figure.segments, "segment", f"{where}: to")
        outward = np.array(
            {"front": (1.0, 0.0, 0.0), "back": (-1.0, 0.0, 0.0), "left": (0.0, 1.0, 0.0), "right": (0.0, -1.0, 0.0)}[
                choice(side, get_args(Side), f"{where}: side")
            ]
        )
        along, above = numbers(middle, (2,), f"{where}: middle")
        if not max(abs(along), abs(above)) <= 1.0:
            raise InputError(f"{where}: middle is {shown(middle)}; give two numbers between -1 and 1 m")
        place = np.array([0.0, along, above] if side in ("front", "back") else [along, 0.0, above])
        low, high = bounds(shape)
        half = 0.5 * np.abs(outward) @ (high - low)
        at = place + outward * (_surface(figure, to, outward, where) + half) - 0.5 * (low + high)
        return cls(name, shape, to, tuple(at.tolist()), group_of(figure, to), color)

    def filled(self, count: int, *, envelope: bool = False) -> Equipment:
        """A copy of `count` spheres that fill the shape as it stands, or its convex envelope; `filling` says how well.

        Raises:
            InputError: the shape cannot be filled; see `wholebody.motion.sphere_filling.fill_with_spheres`.
        """
        filling = fill_with_spheres(self.shape, count, envelope=envelope)
        result = replace(self, shape=filling.shape)
        object.__setattr__(result, "filling", filling)
        return result

    def attach(self, scene: Scene) -> Scene:
        """Attach it to the figure of a scene.

        What is filled is not tested against the segments of the carrier's collision group, and not against equipment
        that the scene already has on those.

        Returns:
            The scene, so that calls can be chained.

        Raises:
            UnknownNameError: the figure has no such segment.
            InputError: the scene already has something of that name.
        """
        instance(scene, Scene, f"Equipment {self.name!r}: scene", "make one with wb.Scene(figure)")
        rests = self.rests_on
        if self.filling is not None:
            group = group_of(scene.figure, known(self.to, scene.figure.segments, "segment", f"Equipment {self.name!r}"))
            others = [thing.name for thing in scene.objects.values() if thing.segment in group]
            rests = tuple(dict.fromkeys((*rests, *group, *others)))
        return scene.attach(self.shape, to=self.to, name=self.name, at=self.at, rests_on=rests, color=self.color)


def group_of(figure: Figure, segment: str) -> tuple[str, ...]:
    """The segments of a segment's collision group; the segment alone where the figure has no groups."""
    groups = figure.collision_groups
    group = groups.get(segment)
    return (segment,) if group is None else tuple(name for name in figure.segments if groups.get(name) == group)


def bounds(shape: Shape) -> tuple[Array, Array]:
    """Least and greatest corner (3,) of a shape's bounding box, metres; `InputError` for a half-space."""
    axes, pieces = np.vstack([np.eye(3), -np.eye(3)]), shape.pieces()
    if any(isinstance(piece.geometry, coal.Halfspace) for piece in pieces):
        raise InputError(f"a {type(shape).__name__} has no bounds; equipment is a solid of finite size")
    most = np.array([max(support(piece.geometry, piece.placement, axis) for piece in pieces) for axis in axes])
    return -most[3:], most[:3]


def _surface(figure: Figure, segment: str, outward: Array, where: str) -> float:
    """How far the pieces of a segment reach from its origin in a direction of its frame, metres."""
    frame = figure.model.frames[figure.frame_id(segment)]
    back = frame.placement.inverse()
    found = [
        support(piece.geometry, back * piece.placement, outward)
        for piece in figure.geometry.geometryObjects
        if figure.model.frames[piece.parentFrame].name == segment
    ]
    if not found:
        raise InputError(f"{where}: {segment!r} has no pieces to wear something on; choose another segment")
    return max(found)


NOTHING = "nothing"  # in place of equipment: nothing is worn


def torus_mesh(radius: float, tube: float) -> tuple[Array, NDArray[np.int64]]:
    """A torus about z of convex closed sections: vertices and triangles; radii of its circle and its tube, metres."""
    sections, corners = 16, 12  # convex sections, and corners of each
    turn = 2.0 * np.pi * np.arange(corners) / corners
    ring = np.stack([radius + tube * np.cos(turn), np.zeros(corners), tube * np.sin(turn)], axis=1)
    sides = [(k, (k + 1) % corners) for k in range(corners)]
    section = [[a, b + corners, b] for a, b in sides] + [[a, a + corners, b + corners] for a, b in sides]
    section += [[0, k, k + 1] for k in range(1, corners - 1)]
    section += [[corners, corners + k + 1, corners + k] for k in range(1, corners - 1)]
    vertices, faces = [], []
    for k in range(sections):
        # rad: between two sections, so that they stay separate parts, each convex
        for angle in (2.0 * np.pi * k / sections + 1e-4, 2.0 * np.pi * (k + 1) / sections):
            c, s = np.cos(angle), np.sin(angle)
            vertices.append(ring @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))
        faces.append(np.array(section, dtype=np.int64) + 2 * corners * k)
    return np.vstack(vertices), np.vstack(faces)


READY: dict[str, tuple[Callable[[], Shape], str, tuple[Side, ...], float, float]] = {
    "side_sphere": (lambda: Sphere(0.075), "lower_thorax", ("left",), -0.05, 0.0),
    "pouches": (lambda: Box((0.17, 0.05, 0.20)), "lower_thorax", ("left", "right"), -0.15, 0.1),
    "vest_plate": (lambda: Box((0.025, 0.24, 0.32)), "thorax", ("front",), 0.0, 0.0),
    "pack": (lambda: Box((0.20, 0.32, 0.50)), "thorax", ("back",), -0.08, 0.0),
    "torus": (lambda: Mesh(torus_mesh(0.13, 0.03)), "lower_thorax", ("left",), -0.11, 0.0),
}
"""Shape, segment, sides, height and sideways, metres: a ball half inside of the torso; double magazine pouches; a plate
of body armour; a day pack of 30 litres; a ring whose hole is wide enough for a forearm."""


def equipment(name: str, figure: Figure) -> tuple[Equipment, ...]:
    """Ready-made equipment, at its place on a person.

    Args:
        name: "side_sphere", "pouches", "vest_plate", "pack" or "torus".
        figure: the person or avatar that wears it.

    Raises:
        UnknownNameError: there is no such equipment.
        InputError: not a person.

    Examples:
        >>> [piece.to for piece in wb.motion.equipment("pack", human)]
        ['thorax']
    """
    known(name, READY, "equipment", "equipment")
    instance(figure, Figure, "equipment: figure", "load one with wb.load('human')")
    one_figure(figure, f"equipment {name!r} fits one person, and the figure")
    if not {"lower_thorax", "thorax"} <= set(figure.segments):
        raise InputError(
            f"equipment {name!r} fits a person, and {figure.name!r} lacks lower_thorax, thorax; "
            "put it on with wb.motion.Equipment(name, shape, to=..., at=...)"
        )
    make, to, sides, height, sideways = READY[name]
    shape, found = make(), list[Equipment]()
    for side in sides:
        called = name if len(sides) == 1 else f"{side}_pouch"
        one = Equipment.worn(
            shape, figure, name=called, to=to, side=side, middle=(sideways, height), color=(0.35, 0.38, 0.28, 1.0)
        )
        if isinstance(shape, Sphere):  # half inside
            at = placement(one.at, name)
            one = replace(one, at=at.translation - np.array([0.0, shape.radius, 0.0]))
        found.append(one)
    return tuple(found)


Worn = str | Equipment | tuple["str | Equipment", ...]
"""What is worn: "nothing"; names of equipment, joined by "+"; the path of a mesh, which is put on the back; equipment;
or several of these."""


def dressed(figure: Figure, worn: Worn) -> Scene:
    """The scene of a figure that wears something; see `put_on`."""
    return put_on(Scene(figure), worn)


def put_on(scene: Scene, worn: Worn) -> Scene:
    """The scene, which is changed, with something attached to its figure."""
    if isinstance(worn, tuple):
        for one in worn:
            put_on(scene, one)
        return scene
    pieces = [worn] if isinstance(worn, Equipment) else list[Equipment]()
    for name in () if isinstance(worn, Equipment) else _names(worn):
        if name not in READY and Path(name).suffix:
            pieces.append(Equipment.worn(Mesh(name), scene.figure, name=Path(name).stem))
        elif name != NOTHING:
            pieces.extend(equipment(name, scene.figure))
    for piece in pieces:
        piece.attach(scene)
    return scene


def label(worn: Worn) -> str:
    """Name of what is worn, for tables and files."""
    if isinstance(worn, tuple) and worn:
        return "+".join(label(one) for one in worn)
    if isinstance(worn, Equipment):
        return worn.name
    return "+".join(Path(name).stem if Path(name).suffix else name for name in _names(worn))


def _names(worn: object) -> list[str]:
    names = text(worn, "equipment")
    return [names] if is_file(names) else names.split("+")
