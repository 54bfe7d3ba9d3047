"""The bodies of an assembly, figures among them, their shapes, and the things around."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import color as checked_color
from wholebody.base.checks import instance, known, numbers, shown, text
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure, stood
from wholebody.figures.state import UNIT_TOLERANCE
from wholebody.geometry.placement import PlacementLike, placement
from wholebody.geometry.shapes import LENGTH, Shape
from wholebody.methods.newton.assembly_geometry import (
    AssemblyFigure,
    LooseBodies,
    Owner,
    ShapeLike,
    Solid,
    body_owner,
    figure_owners,
    figure_pairs,
    rim,
    solids,
)  # fmt: skip
from wholebody.methods.newton.system import unit
from wholebody.problem import CLEARANCE, Problem
from wholebody.scene.geometry_model import SceneObject, assemble
from wholebody.scene.scene import Scene
from wholebody.tasks.base import Bound, Constraint
from wholebody.tasks.inputs import target_placement

if TYPE_CHECKING:
    from typing_extensions import Self

    Color = tuple[float, float, float, float]

WORLD = "world"


class AssemblyBodies:
    """Bodies, figures and things of an assembly; `wholebody.Assembly` adds joints, goals and solving."""

    def __init__(self, clearance: float = 0.0) -> None:
        self._clearance = CLEARANCE(clearance, "Assembly: clearance")
        self._names: dict[str, int] = {}
        self._places: list[Array] = []
        self._sizes: list[Array] = []  # (7,) weights of each body's variables in the least motion
        self._frames: dict[str, tuple[int, Any]] = {}
        self._solids: dict[str, tuple[Solid, ...]] = {}
        self._colors: dict[str, Color] = {}
        self._figures: dict[str, AssemblyFigure] = {}
        self._things: dict[str, SceneObject] = {}
        self._parts: list[str] = []  # names of bodies and figures, in the order of their bodies
        self._apart: set[frozenset[str]] = set()
        self._joined: set[frozenset[int]] = set()
        self._fixed_pairs: list[tuple[int, int]] = []
        self._scene: Scene | None = None
        self.revision = 0

    @property
    def clearance(self) -> float:
        """Least distance of every tested pair, metres."""
        return self._clearance

    # ---- bodies

    def body(
        self,
        name: str,
        at: PlacementLike = (0.0, 0.0, 0.0),
        *,
        shape: ShapeLike | None = None,
        size: float | None = None,
        color: Sequence[float] | str | None = None,
    ) -> Self:
        """Add a body.

        Bodies with shapes do not penetrate each other and the things around, except bodies that a joint connects.

        Args:
            name: one that no other body has.
            at: (x, y, z), (x, y, z, qx, qy, qz, qw), a 4x4 matrix or a pin.SE3.
            shape: a shape at the body's origin, or a list of shapes and of (shape, placement in the body); None for a
                body that touches nothing.
            size: metres from its origin to its rim, 0.3 by default for a body without shape and otherwise read from it;
                a rotation of the body counts as the motion of the rim.
            color: red, green, blue and, if wanted, alpha, each from 0 to 1; a name such as "steelblue", or "#rrggbb".
        """
        self._check_new(text(name, "the name of a body"), "body")
        where = f"body {name!r}"
        given = solids(shape, where)
        length = rim(given, 0.3) if size is None else LENGTH(size, f"{where}: size")
        placed = pin.SE3ToXYZQUAT(target_placement(at, where))
        painted = None if color is None else checked_color(color, f"{where}: color")
        self._parts.append(name)
        self._frames[name] = len(self._places), pin.SE3.Identity()
        self._names[name] = len(self._places)
        self._places.append(np.array(placed))
        self._sizes.append(np.array([1.0] * 3 + [(2.0 * length) ** 2] * 4))
        if given:
            self._solids[name] = given
        if painted is not None:
            self._colors[name] = painted
        return self._changed()

    def figure(
        self,
        name: str,
        figure: Figure,
        start: Any = None,
        *,
        at: PlacementLike | None = None,
        constraints: Iterable[Constraint | Bound] = (),
        color: Sequence[float] | str | None = None,
    ) -> Self:
        """Add a figure: its joints become bodies, with its joint limits, its shapes and the pairs that it tests.

        Its frames, such as "anna/left_palm", stand wherever a body is named, its segments wherever things with shapes
        are. Its placements follow its joints exactly, and limits always hold.

        Args:
            name: one that no body and no other figure has.
            figure: such as `wb.load("human")`.
            start: (nq,) posture, or the name of one of the figure's; None for its first posture.
            at: where its world is, as of `wb.Scene`: that places a fixed root, and a named posture of a free one.
            constraints: of it, such as `wb.Hold("left_foot")` and `wb.Balance()`, or of a class of your own.
            color: of its pieces.

        Raises:
            UnsupportedTermError: a joint or a constraint has no equations.
        """
        self._check_new(text(name, "the name of a figure"), "figure")
        one_figure(figure, f"figure {name!r}")
        painted = None if color is None else checked_color(color, f"figure {name!r}: color")
        if at is not None:
            figure, start = stood(figure, placement(at, f"figure {name!r}: at"), start)
        # The other bodies may carry it, so it is not taken for one that stands.
        problem = Problem(Scene(figure), start, constraints=constraints, range_of_motion=False, balance=False)
        part = AssemblyFigure(name, problem, len(self._places))
        self._parts.append(name)
        self._figures[name] = part
        for frame in part.model.frames:
            if frame.parentJoint:
                placed = part.index(int(frame.parentJoint)), pin.SE3(frame.placement)
                self._frames.setdefault(f"{name}/{frame.name}", placed)
        for joint, index in zip(part.names, range(part.first, part.first + part.count), strict=True):
            self._names[f"{name}/{joint}"] = index
            self._frames[f"{name}/{joint}"] = index, pin.SE3.Identity()
        self._places += list(part.variables(part.problem.start).reshape(-1, 7))
        self._sizes += list(part.weight.reshape(-1, 7))
        if painted is not None:
            self._colors[name] = painted
        return self._changed()

    @property
    def bodies(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self._names)

    @property
    def has_shapes(self) -> bool:
        """Whether any body has a shape."""
        return bool(self._solids or self._figures)

    @property
    def colors(self) -> Mapping[str, tuple[float, float, float, float]]:
        """Colors that were given, by body and figure."""
        return dict(self._colors)

    @property
    def figures(self) -> Mapping[str, Figure]:
        """The figures by name."""
        return {name: part.problem.scene.figure for name, part in self._figures.items()}

    def placement(self, name: str) -> Any:
        """Placement (pin.SE3) of a body, or of a frame of a figure."""
        index, local = self._frame(name, "placement")
        return self._placed(index) * local

    def posture(self, name: str) -> Array:
        """The posture (nq,) of a figure."""
        return self._figures[known(name, self._figures, "figure", "posture")].posture(self.variables())

    def variables(self) -> Array:
        """(7 n,) the placements of the bodies."""
        return np.concatenate(self._places) if self._places else np.zeros(0)

    @property
    def q(self) -> Array:
        """(nq,) the present posture of `scene`: seven numbers for each body, and the posture of each figure."""
        return self._to_scene(self.variables())

    def _to_scene(self, variables: Array) -> Array:
        """The posture (nq,) of `scene` at variables (7 n,); the same numbers if there are no figures."""
        if not self._figures:
            return variables
        parts = [
            self._figures[name].posture(variables)
            if name in self._figures
            else variables[7 * self._names[name] : 7 * self._names[name] + 7]
            for name in self._parts
        ]
        return np.concatenate(parts)

    def place(self, variables: Any) -> Self:
        """Set the placements of the bodies to (7 n,) numbers as `variables` returns them."""
        bodies = numbers(variables, (7 * len(self._places),), "place: variables").reshape(-1, 7)
        if (np.abs(np.linalg.norm(bodies[:, 3:], axis=1) - 1.0) > UNIT_TOLERANCE).any():
            raise InputError("place: variables holds a quaternion that is not of unit length; divide it by its length")
        self._places = list(unit(bodies).reshape(-1, 7))
        return self

    # ---- things around

    def add(
        self,
        shape: Shape,
        *,
        name: str,
        at: PlacementLike = (0.0, 0.0, 0.0),
        color: Sequence[float] | str | None = None,
    ) -> Self:
        """Add a thing to the world: it stands still, and no body penetrates it.

        Args:
            shape: a `wholebody.geometry.shapes.Shape`.
            name: one that nothing else has.
            at: its placement.
            color: red, green, blue and, if wanted, alpha, each from 0 to 1; a name such as "steelblue", or "#rrggbb".
        """
        self._check_new(text(name, "the name of a thing"), "thing")
        instance(shape, Shape, repr(name), "give wb.Box, wb.Sphere, wb.Mesh or another")
        place = placement(at, f"{name!r}: at")
        painted = None if color is None else checked_color(color, f"{name!r}: color")
        self._things[name] = SceneObject(name, shape, place, color=painted)
        return self._changed()

    def add_things(self, scene: Scene) -> Self:
        """Add the things that stand in a scene; what its figure carries is left out."""
        things = instance(scene, Scene, "add_things: scene", "make one with wb.Scene(figure)").objects.values()
        for thing in things:
            if thing.segment is None:
                self.add(thing.shape, name=thing.name, at=thing.placement, color=thing.color)
        return self

    def move(self, name: str, *, at: PlacementLike, over: float | None = None) -> Self:
        """Move a thing; the next solve sees it there, and nothing is analysed anew.

        Args:
            name: of the thing.
            at: its new placement.
            over: seconds that the motion takes: in the next frame of a drag it goes there from where it is, and pushes
                bodies or collides with them; None for a thing that is put there, whatever is in between.
        """
        known(name, self._things, "thing")
        self.scene.move(name, at=at, over=over)
        self._things[name] = self.scene.objects[name]
        return self

    def ignore(self, first: str, second: str) -> Self:
        """Do not test two owners of shapes against each other; a figure's name stands for all its segments."""
        owners = {owner.name: owner for owner in self._owners()}
        for name in (first, second):
            known(name, [*owners, *self._figures, *self._things], "body with a shape, figure or thing", "ignore")
        self._apart.add(frozenset((first, second)))
        return self._changed()

    @property
    def scene(self) -> Scene:
        """The bodies among the things, with the pairs that are tested; its present posture is `q`.

        It is for questions: `scene.contacts(q)`, `scene.penetration`, `scene.sweep`. Add and move things by the
        assembly. After bodies, things or joints were added it is another one.
        """
        if self._scene is None:
            if not self._places:
                raise InputError("the assembly has no bodies; add some with body(...)")
            owners = self._owners()
            still = self._groups()
            at_rest = {owner.name for owner in owners if still[owner.body] == still[-1]}
            apart = [
                (owner.name, name)
                for owner in owners
                for name in self._things
                if owner.name in at_rest or self._ignores(owner, name)
            ]
            own = [
                pair for name, part in self._figures.items() for pair in figure_pairs(name, part.problem.scene.figure)
            ]
            parts: list[str | tuple[str, Figure]] = [
                (name, self._figures[name].problem.scene.figure) if name in self._figures else name
                for name in self._parts
            ]
            loose = LooseBodies(parts, owners, lambda one, other: self._tested(one, other, still), own)
            figure: Any = loose  # a scene asks of its figure what LooseBodies has
            excluded = dict.fromkeys(apart, "said to touch, or standing still")
            built = assemble(figure, self._things.values(), excluded)
            self._scene = Scene.of_parts(figure, self._things.values(), built)
        return self._scene

    def _owners(self) -> list[Owner]:
        found = [body_owner(name, self._names[name], given) for name, given in self._solids.items()]
        for name, part in self._figures.items():
            found += figure_owners(name, part.problem.scene.figure, part.first)
        return found

    def _tested(self, one: Owner, other: Owner, group: list[int]) -> bool:
        if one.figure and one.figure == other.figure:
            return False  # the figure's own pairs are added below
        if frozenset((one.body, other.body)) in self._joined or group[one.body] == group[other.body]:
            return False
        return not self._ignores(one, other.name, other.figure)

    def _ignores(self, owner: Owner, *others: str) -> bool:
        mine = {owner.name, owner.figure} - {""}
        return any(frozenset((a, b)) in self._apart for a in mine for b in others if b)

    def _groups(self) -> list[int]:
        """For each body, and last for the world, a number that is the same for bodies that fixed joints connect."""
        group = list(range(len(self._places) + 1))
        for first, second in self._fixed_pairs:
            old, new = group[second], group[first]
            group = [new if entry == old else entry for entry in group]
        return group

    # ---- for subclasses

    def _changed(self) -> Self:
        """Note that bodies, things or joints changed."""
        self._scene = None
        self.revision += 1
        return self

    def _check_new(self, name: str, kind: str) -> None:
        taken = {WORLD, *self._names, *self._frames, *self._figures, *self._things}
        if name in taken:
            raise InputError(f"{kind} {shown(name)}: the name is taken; give another one")

    def _frame(self, name: str, where: str) -> tuple[int, Any]:
        """Index of the body (-1 is the world) and placement in it of a body or a frame of a figure."""
        found = known(name, [*self._frames, WORLD], "body", where)
        return (-1, pin.SE3.Identity()) if found == WORLD else self._frames[found]

    def _moved(self, name: str, where: str) -> tuple[int, Any]:
        index, local = self._frame(name, where)
        if index < 0:
            raise InputError(f"{where}: the world does not move; name a body")
        return index, local

    def _placed(self, index: int) -> Any:
        """Placement of a body by index; -1 is the world."""
        return pin.XYZQUATToSE3(self._places[index]) if index >= 0 else pin.SE3.Identity()
