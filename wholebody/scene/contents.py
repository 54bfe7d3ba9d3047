"""What a scene contains: a figure, the things that it carries, the things around it, and the geometry model of all."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from threading import RLock
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.joining import welded
from wholebody.figures.loading import join
from wholebody.geometry.placement import placement as to_placement
from wholebody.geometry.proximity import PairTable
from wholebody.geometry.shapes import Box, Capsule, Cylinder, Ellipsoid, Hull, Mesh, Shape, Sphere
from wholebody.scene.geometry_model import Motion, SceneGeometry, SceneObject, assemble
from wholebody.scene.matter.body import DEFAULT, Body, Material, mass_properties
from wholebody.scene.matter.body import material as to_material

if TYPE_CHECKING:
    from typing_extensions import Self

DIVIDE = "divide millimetres by 1000, centimetres by 100"
SHAPES = "give wb.Box, wb.Sphere, wb.Mesh or another"


class SceneContents(checks.FixedAttributes):
    """A figure and its things, which can be added, moved and removed.

    The geometry model is built when it is first needed, and again after things were added or removed. Moving a thing
    keeps it.
    """

    _correction = "make another with wb.Scene(figure), or change its things by add, move and remove"

    def __init__(self, figure: Figure | Mapping[str, Any]) -> None:
        """Make a scene with a figure alone, or with several by name; see `figures.join` for those.

        Raises:
            InputError: no figure, or several that cannot be joined.
        """
        if isinstance(figure, Mapping):
            figure = join(figure)
        if not isinstance(getattr(figure, "model", None), pin.Model):
            raise InputError(f"Scene takes a figure, not {checks.shown(figure)}; load one with wb.load('human')")
        self.figure = figure
        self._objects: dict[str, SceneObject] = {}
        self._excluded: dict[tuple[str, str], str] = {}
        self._built: SceneGeometry | None = None
        self._lock = RLock()  # while things are added, removed or moved, and while the geometry model is built
        self._revision = 0

    @classmethod
    def of_parts(cls, figure: Figure, objects: Iterable[SceneObject], built: SceneGeometry, revision: int = 0) -> Self:
        """A scene with a given geometry model and its own pairs; rebuilt after things were added or removed."""
        scene = cls(figure)
        scene._revision = revision
        scene._objects = {thing.name: thing for thing in objects}
        scene._built = built
        return scene

    def __repr__(self) -> str:
        carried = [name for name, thing in self._objects.items() if thing.segment is not None]
        around = [name for name, thing in self._objects.items() if thing.segment is None]
        things = f"things around it: {checks.some(around) or 'none'}\n  carried: {checks.some(carried) or 'nothing'}"
        return f"Scene of {self.figure!r}\n  {things}"

    @property
    def revision(self) -> int:
        """How often things were added or removed."""
        return self._revision

    @property
    def model(self) -> pin.Model:
        """Pinocchio's model of the figure."""
        return self.figure.model

    @property
    def geometry(self) -> pin.GeometryModel:
        """Pinocchio's geometry model: pieces of the figure, of carried things, of things around; all pairs.

        Of more than 2,000 pieces it has no table of pair numbers: do not call `addCollisionPair`, `findCollisionPair`
        or `existCollisionPair` on it then.
        """
        return self.built.geometry

    @property
    def objects(self) -> Mapping[str, SceneObject]:
        """Things by name, carried ones included."""
        return MappingProxyType(self._objects)

    @property
    def piece_names(self) -> tuple[str, ...]:
        """Name of every piece, in the order of the geometry model."""
        return tuple(piece.name for piece in self.geometry.geometryObjects)

    @property
    def piece_owner(self) -> tuple[str, ...]:
        """The segment or object that every piece is part of, in the order of the geometry model."""
        return self.built.owners

    @property
    def excluded_pairs(self) -> Mapping[tuple[str, str], str]:
        """Pairs of owners that are not tested because of the scene, with the reason."""
        _ = self.built
        return MappingProxyType(self._excluded)

    @property
    def pair_table(self) -> PairTable:
        """Pieces and pairs as arrays; ``pair_table.pairs`` has the two pieces of each collision pair."""
        return self.built.table

    @property
    def built(self) -> SceneGeometry:
        """The geometry model of the present things, with its indices."""
        built = self._built
        if built is None:
            with self._lock:
                built = self._built
                if built is None:
                    self._excluded = {}
                    built = self._built = assemble(self.figure, self._objects.values(), self._excluded)
        return built

    def frame_id(self, name: str) -> int:
        """Index of a frame of the figure."""
        return int(self.figure.frame_id(name))

    # ---- changes

    def add_figure(self, figure: Figure, *, name: str, at: Any = (0.0, 0.0, 0.0), root: str | None = None) -> Self:
        """Add a figure to a scene of figures that have names, and return the scene.

        `scene.figure` is another one then: postures (nq,) become longer by those of the new figure, which come last.

        Args:
            figure: one figure.
            name: its name, which comes before the names of its parts: "anna/right_palm".
            at: where its world is; see `figures.join`.
            root: "fixed" to fix a free root as in its first posture; None to leave it as it is.

        Raises:
            InputError: the scene was made of one figure without a name, or the figure, its name, root or placement
                cannot be used.
        """
        checks.text(name, "add_figure: name")
        checks.instance(figure, Figure, "add_figure: figure", "load one with wb.load('human')")
        if not self.figure.members:
            raise InputError(
                f"add_figure: the scene's figure has no name; make it with wb.Scene({{'anna': figure, {name!r}: ...}})"
            )
        if name in self.figure.members:
            raise InputError(f"add_figure: the scene has a figure {name!r} already; give this one another name")
        if root is not None:
            checks.choice(root, ("fixed",), "add_figure: root")
        known = {other: (member.figure, member.at) for other, member in self.figure.members.items()}
        made = join({**known, name: (figure if root is None else welded(figure), at)})
        with self._lock:
            if taken := next((thing for thing in self._objects if thing == name or thing in made.segments), None):
                raise InputError(f"add_figure: the scene has a thing {taken!r} already; give the figure another name")
            object.__setattr__(self, "figure", made)
            self._changed()
        return self

    def add(
        self,
        shape: Shape,
        *,
        name: str,
        at: Any = (0.0, 0.0, 0.0),
        color: Sequence[float] | str | None = None,
        body: Body | None = None,
        material: Material | str | None = None,
    ) -> Self:
        """Add a thing to the world, and return the scene.

        Args:
            shape: a `wholebody.geometry.shapes.Shape`.
            name: a name that nothing else in the scene has.
            at: (x, y, z), (x, y, z, qx, qy, qz, qw), a 4x4 matrix or a pin.SE3.
            color: red, green, blue and, if wanted, alpha, each from 0 to 1; a name such as "steelblue", or "#rrggbb".
            body: its mass, material and velocity, if it moves by itself.
            material: of a thing that does not; wood if none is given.

        Raises:
            InputError: the name exists already, the shape, placement or color is invalid, or a half-space has a body.
            UnknownNameError: there is no such material.
        """
        name = self._new_name(name)
        if body is not None:
            checks.instance(body, Body, f"{name!r}: body", "give wb.Body(density=700)")
            if material is not None:
                raise InputError(f"{name!r} has a body and a material; give the body's: wb.Body(material=...)")
            mass_properties(checks.instance(shape, Shape, repr(name), SHAPES), body, name)
            made_of = body.resolved_material
        else:
            made_of = DEFAULT if material is None else to_material(material, f"{name!r}: material")
        return self._put(name, shape, at, color, body=body, material=made_of)

    def attach(
        self,
        shape: Shape,
        *,
        to: str,
        name: str,
        at: Any = (0.0, 0.0, 0.0),
        rests_on: Iterable[str] = (),
        color: Sequence[float] | str | None = None,
    ) -> Self:
        """Attach a thing to the figure: it moves with a segment, at `at` in the segment's frame.

        It is not tested against its own segment. It is not tested against neighbours of this segment (segments that the
        figure itself does not test against each other) that it touches in the figure's first posture; `excluded_pairs`
        lists those. It is tested against all others: a box in the hand does not pass through the thighs.

        Args:
            shape: as for `add`.
            to: the segment or frame that carries it.
            name: as for `add`.
            at: its placement in that frame; as for `add`.
            rests_on: more segments, and carried things, that it is not tested against.
            color: as for `add`.

        Raises:
            InputError: the name exists already, or the shape, placement or color is invalid.
            UnknownNameError: there is no such frame or segment.
        """
        self.frame_id(to)
        name = self._new_name(name)
        where = f"attach {name!r}: rests_on"
        rests = tuple(checks.listed(rests_on, where, "['thorax']"))
        carried = [thing.name for thing in self._objects.values() if thing.segment is not None]
        for other in rests:
            checks.known(other, {*self.figure.segments, *carried}, "segment or carried thing", where)
        return self._put(name, shape, at, color, segment=to, rests_on=rests)

    def move(self, name: str, *, at: Any, over: float | None = None) -> Self:
        """Move a thing to a new placement in the world, or in its segment's frame; as for `add`.

        With `over` it moves there from where it is, during the next frame of a tracker, a drag or a frame loop, in so
        many seconds: its centre goes straight, and it turns about its centre. Contacts on its path count. Without
        `over` it is put there, whatever is in between. If it is moved more than once before that frame, the frame sees
        one motion, from where the frame before saw it to where it is.

        Raises:
            UnknownNameError: there is no such object.
            InputError: the placement cannot be read, or the time is not positive and finite.
        """
        place = to_placement(at, f"{checks.shown(name)}: at")
        seconds = None if over is None else checks.time_step(over, f"move {checks.shown(name)}: over")
        with self._lock:
            thing = self._object(name)
            if thing.body is None:  # what falls in a world may be anywhere
                _warn_of_units(name, place)
            motion = None if seconds is None else Motion(thing.placement, seconds)
            self._objects[name] = replace(thing, placement=place, motion=motion)
            if self._built is not None:
                base = place if thing.segment is None else self.figure.place_of(thing.segment).placement * place
                self._built.place(name, base, moving=motion is not None)
        return self

    def remove(self, name: str) -> Self:
        """Remove a thing; an UnknownNameError if there is none of that name."""
        with self._lock:
            self._object(name)
            del self._objects[name]
            self._changed()
        return self

    def _put(self, name: str, shape: Shape, at: Any, color: Any, **more: Any) -> Self:
        """Add a thing with `more` fields of a `SceneObject`."""
        checks.instance(shape, Shape, repr(name), SHAPES)
        place = to_placement(at, f"{name!r}: at")
        _warn_of_units(name, place, shape)
        painted = None if color is None else checks.color(color, f"{name!r}: color")
        with self._lock:
            thing = SceneObject(name, shape, place, color=painted, **more)
            self._objects[self._new_name(name)] = thing
            self._changed()
        return self

    def _changed(self) -> None:
        self._built = None
        self._revision += 1

    def _object(self, name: str) -> SceneObject:
        if isinstance(name, str) and name in self.figure.members:
            raise InputError(f"{name!r} is a figure, which stays in its scene where it is; make another scene")
        return self._objects[checks.known(name, self._objects, "object")]

    def _new_name(self, name: str) -> str:
        checks.text(name, "the name of an object")
        if name in self._objects or name in self.figure.segments or name in self.figure.members:
            raise InputError(f"the scene already has {name!r}; give the new object another name, or move() the old one")
        return name

    # ---- copies

    def __copy__(self) -> Self:
        built = self._built
        kind = type(self)
        scene = kind.of_parts(self.figure, self._objects.values(), built.copied()) if built else kind(self.figure)
        scene._objects, scene._excluded = dict(self._objects), dict(self._excluded)
        return scene

    def __getstate__(self) -> dict[str, Any]:
        """Return everything but the lock."""
        return {name: value for name, value in self.__dict__.items() if name != "_lock"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._lock = RLock()


def _warn_of_units(name: str, place: pin.SE3, shape: Shape | None = None) -> None:
    """Warn of a place and a size that are hardly metres."""
    # m: a thing farther than this from the origin is probably placed in millimetres
    if (far := max(map(abs, place.translation.tolist()))) > 100.0:
        checks.warn(f"{name!r} is {far:.4g} m away; lengths are in metres, so {DIVIDE}")
    extent = _extent(shape)
    if max(extent) > 100.0 and min(extent) > 2.0:  # m: probably in a smaller unit; a thin floor may be as wide
        size = " x ".join(f"{length:.4g}" for length in extent)
        correction = "wb.Mesh(..., scale=0.001) reads millimetres" if isinstance(shape, Mesh) else DIVIDE
        checks.warn(f"{name!r} measures {size} m; lengths are in metres: {correction}")


def _extent(shape: Shape | None) -> tuple[float, ...]:
    """Full lengths along the axes of a shape, metres; zero for one of which they are not known or endless."""
    match shape:
        case Box():
            return shape.size
        case Sphere():
            return (2.0 * shape.radius,)
        case Capsule() | Cylinder():
            return 2.0 * shape.radius, shape.length
        case Ellipsoid():
            return tuple(2.0 * length for length in shape.semi_axes)
        case Mesh() | Hull():
            points = shape.vertices if isinstance(shape, Mesh) else shape.points
            return tuple(np.ptp(points, axis=0).tolist())
    return (0.0,)
