"""A scene: one figure, what it carries, what stands around it, and which pairs can touch."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody import checks
from wholebody.errors import InputError
from wholebody.figures.state import State
from wholebody.geometry.contact_rows import ContactRowBuilder
from wholebody.geometry.placement import FARTHEST
from wholebody.geometry.placement import placement as to_placement
from wholebody.geometry.proximity import Contacts, Proximity
from wholebody.geometry.shapes import Shape
from wholebody.scene_geometry import SceneGeometry, SceneObject, assemble

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure
    from wholebody.geometry.penetration import ObjectPenetration
    from wholebody.geometry.sweep import FirstContact, Sweep
    from wholebody.problem import Problem
    from wholebody.simplification.simplified import Simplified

Array = NDArray[np.float64]


class Scene:
    """A figure among things.

    The geometry model is built when it is first needed and again after objects come or go. Moving an object keeps it.
    """

    def __init__(self, figure: Figure) -> None:
        """Begin with the figure alone.

        Raises:
            InputError: it is no figure.
        """
        if not isinstance(getattr(figure, "model", None), pin.Model):
            raise InputError(f"Scene takes a figure, not {checks.shown(figure)}; load one with wb.load('human')")
        self.figure = figure
        self._objects: dict[str, SceneObject] = {}
        self._excluded: dict[tuple[str, str], str] = {}
        self._built: SceneGeometry | None = None
        self._state: State | None = None
        self.revision = 0

    @classmethod
    def of_parts(cls, figure: Figure, objects: Iterable[SceneObject], built: SceneGeometry) -> Scene:
        """A scene whose geometry is made already, with pairs of its own; made anew once things come or go."""
        scene = cls(figure)
        scene._objects = {thing.name: thing for thing in objects}
        scene._built = built
        return scene

    # ---- what is there

    @property
    def model(self) -> pin.Model:
        """Pinocchio's model of the figure."""
        return self.figure.model

    @property
    def geometry(self) -> pin.GeometryModel:
        """Pinocchio's geometry model: pieces of the figure, of what it carries, of what stands around; all pairs."""
        return self._build().geometry

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
        return self._build().owners

    @property
    def excluded_pairs(self) -> Mapping[tuple[str, str], str]:
        """Pairs of owners that are not tested because of the scene, with the reason."""
        self._build()
        return MappingProxyType(self._excluded)

    @property
    def proximity(self) -> Proximity:
        """The distances of this scene's pairs, re-used from posture to posture."""
        return self._build().proximity

    @property
    def row_builder(self) -> ContactRowBuilder:
        """The contact rows of this scene's pairs."""
        return self._build().rows

    @property
    def sweeper(self) -> Sweep:
        """The continuous collision detection of this scene, re-used from motion to motion."""
        built = self._build()
        if built.sweep is None:
            from wholebody.geometry.sweep import Sweep

            built.sweep = Sweep(self.model, built.geometry)
        return built.sweep

    def frame_id(self, name: str) -> int:
        """Index of a frame of the figure.

        Raises:
            UnknownNameError: there is none of that name.
        """
        return int(self.figure.frame_id(name))

    # ---- changing it

    def add(
        self,
        shape: Shape,
        *,
        name: str,
        at: Any = (0.0, 0.0, 0.0),
        color: Sequence[float] | None = None,
    ) -> Scene:
        """Put a thing into the world.

        Args:
            shape: a `wholebody.geometry.shapes.Shape`.
            name: a name that nothing else in the scene has.
            at: (x, y, z), (x, y, z, qx, qy, qz, qw), a 4x4 matrix or a pin.SE3.
            color: red, green, blue and, if wanted, alpha, each from 0 to 1.

        Returns:
            The scene, so that calls can be chained.

        Raises:
            InputError: the name is taken, or the shape, placement or color is none.
        """
        return self._put(self._new_name(name), shape, at, color)

    def attach(
        self,
        shape: Shape,
        *,
        to: str,
        name: str,
        at: Any = (0.0, 0.0, 0.0),
        rests_on: Iterable[str] = (),
        color: Sequence[float] | None = None,
    ) -> Scene:
        """Give the figure a thing to carry: it moves with a segment, at `at` in the segment's frame.

        It is not tested against its own segment, nor against neighbours of it (segments that the figure itself does not
        test against each other) that it leans on in the figure's first posture; `excluded_pairs` lists those. All
        others are tested: a box in the hand does not pass through the thighs.

        Args:
            shape: a `wholebody.geometry.shapes.Shape`.
            to: the segment or frame that carries it.
            name: a name that nothing else in the scene has.
            at: where, in that frame; as for `add`.
            rests_on: more segments that it is not tested against.
            color: red, green, blue and, if wanted, alpha, each from 0 to 1.

        Raises:
            InputError: the name is taken, or the shape, placement or color is none.
            UnknownNameError: there is no such frame or segment.
        """
        self.frame_id(to)
        name = self._new_name(name)
        rests = tuple(checks.listed(rests_on, f"attach {name!r}: rests_on", "['thorax']"))
        for segment in rests:
            checks.known(segment, self.figure.segments, "segment", f"attach {name!r}: rests_on")
        return self._put(name, shape, at, color, to, rests)

    def move(self, name: str, *, at: Any) -> Scene:
        """Place a thing anew: in the world, or in its segment's frame.

        Raises:
            UnknownNameError: there is no such object.
            InputError: the placement cannot be read.
        """
        old = self._object(name)
        moved = replace(old, placement=to_placement(at, f"{name!r}: at"))
        self._objects[name] = moved
        if self._built is not None:
            base = moved.placement
            if moved.segment is not None:
                base = self.model.frames[self.frame_id(moved.segment)].placement * base
            for index, local in self._built.pieces_of[name]:
                self._built.geometry.geometryObjects[index].placement = base * local
        return self

    def remove(self, name: str) -> Scene:
        """Take a thing out.

        Raises:
            UnknownNameError: there is no such object.
        """
        self._object(name)
        del self._objects[name]
        self._changed()
        return self

    def _put(
        self, name: str, shape: Shape, at: Any, color: Any, to: str | None = None, rests_on: tuple[str, ...] = ()
    ) -> Scene:
        checks.instance(shape, Shape, repr(name), "give wb.Box, wb.Sphere, wb.Mesh or another")
        place = to_placement(at, f"{name!r}: at")
        painted = None if color is None else checks.color(color, f"{name!r}: color")
        self._objects[name] = SceneObject(name, shape, place, to, painted, rests_on)
        self._changed()
        return self

    def _changed(self) -> None:
        self._built = None
        self.revision += 1

    def _object(self, name: str) -> SceneObject:
        return self._objects[checks.known(name, self._objects, "object")]

    def _new_name(self, name: str) -> str:
        checks.text(name, "the name of an object")
        if name in self._objects or name in self.figure.segments:
            raise InputError(
                f"the scene already has a {name!r}; give the new object another name, or move() the old one"
            )
        return name

    # ---- asking it

    def state(self, q: Array) -> State:
        """One kinematic pass at q, shape (nq,); the pieces are moved there too. Re-used by the next call."""
        if self._state is None:
            self._state = State(self.model)
        self._state.update(q)
        self.proximity.place(self._state.data)
        return self._state

    def contacts(self, q: Array, within: float = 0.05) -> Contacts:
        """Every pair nearer than `within` metres at the posture q, shape (nq,), nearest first.

        Raises:
            InputError: q has the wrong shape or is not finite, or `within` is not a finite number.
        """
        within = checks.number(within, "within", -FARTHEST, FARTHEST, "m")
        near = self.proximity.near(self.state(q).data, within)
        order = np.argsort(near.distance, kind="stable")
        return Contacts(
            near.pair[order], near.distance[order], near.normal[order], near.point_a[order], near.point_b[order],
            near.number[order],
        )  # fmt: skip

    def penetration(self, q: Array) -> list[ObjectPenetration]:
        """How deep owners (segments, objects) are in each other at q: PD_g and the least separating translation.

        The deepest first; empty where nothing overlaps. See `wholebody.geometry.penetration`.
        """
        from wholebody.geometry.penetration import object_penetrations

        contacts = self.contacts(q, within=0.0)
        built = self._build()
        return object_penetrations(self.geometry, built.proximity.results, built.owners, contacts.pair)

    def sweep(self, q0: Array, q1: Array) -> FirstContact | None:
        """First contact on the way from q0 to q1, both (nq,), along pin.interpolate; None where there is none.

        Continuous: no object is too thin to be seen. See `wholebody.geometry.sweep`.

        Raises:
            InputError: a posture has the wrong shape, is not finite, or its quaternion is not of unit length.
        """
        nq = self.model.nq
        return self.sweeper.first_contact(checks.posture(q0, nq, "q0"), checks.posture(q1, nq, "q1"))

    def simplified(self, problem: Problem, *, lock: bool = True) -> Simplified:
        """A smaller problem whose answers are answers of this one: the joints, pairs and corners that matter.

        Args:
            problem: about this scene.
            lock: whether joints that take no part stay as they start; False keeps all that are not frozen.

        Returns:
            The smaller problem, the way back to the whole figure, and what was left out with what that can change.

        Raises:
            InputError: the problem is about another scene, or objects came or left after it was stated.
        """
        from wholebody.simplification.simplify import Parts, simplify

        checks.flag(lock, "lock")
        if getattr(problem, "scene", None) is self:
            return simplify(problem, Parts(lock=lock))
        raise InputError("the problem is about another scene; call problem.scene.simplified(problem)")

    def _build(self) -> SceneGeometry:
        if self._built is None:
            self._excluded.clear()
            self._built = assemble(self.figure, self._objects.values(), self._excluded)
        return self._built
