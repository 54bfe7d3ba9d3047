"""The bodies of an assembly as one figure, so that scenes, sweeps and the viewer take them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.model_check import Turning
from wholebody.figures.state import State
from wholebody.geometry.large_models import geometry_model
from wholebody.geometry.pieces import swept_points
from wholebody.geometry.placement import PlacementLike, placement
from wholebody.geometry.shapes import Shape
from wholebody.methods.newton.batches import Batch
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.terms import bound_equations, constraint_equations
from wholebody.problem import Problem

Solid = tuple[Shape, Any]
"""A shape, and its placement (pin.SE3) in its body."""

ShapeLike = Shape | Iterable[Shape | tuple[Shape, PlacementLike]]


class Owner(NamedTuple):
    """A body with its pieces, or a segment "<figure>/<segment>" with them: name, placement in the body, geometry."""

    name: str
    body: int
    figure: str
    pieces: list[tuple[str, Any, Any]]


def solids(shape: ShapeLike | None, where: str) -> tuple[Solid, ...]:
    """The shapes of a body, each with its placement in the body."""
    if shape is None:
        return ()
    listed = [shape] if isinstance(shape, Shape) else checks.listed(shape, f"{where}: shape", "[wb.Box((1, 1, 1))]")
    found: list[Solid] = []
    for entry in listed:
        given, at = entry if isinstance(entry, tuple) and len(entry) == 2 else (entry, (0.0, 0.0, 0.0))
        correction = "give wb.Box, wb.Sphere or another, or (shape, placement)"
        one: Shape = checks.instance(given, Shape, f"{where}: shape", correction)
        found.append((one, placement(at, f"{where}: shape")))
        if _reach(found[-1:]) == float("inf"):
            raise InputError(f"{where}: a body cannot be a half-space; add it as a thing, or give a wb.Box")
    return tuple(found)


def rim(of: Iterable[Solid], otherwise: float) -> float:
    """Distance from a body's origin to its farthest point, metres."""
    return max(_reach(of), 0.0) or otherwise


def _reach(of: Iterable[Solid]) -> float:
    far = 0.0
    for shape, at in of:
        for piece in shape.pieces():
            center = (at * piece.placement).translation
            far = max(far, float((center @ center) ** 0.5) + swept_points(piece.geometry).reach)
    return far


def body_owner(name: str, body: int, of: Iterable[Solid]) -> Owner:
    """The pieces of a body."""
    pieces: list[tuple[str, Any, Any]] = []
    for shape, at in of:
        for piece in shape.pieces():
            pieces.append((f"{name}:{len(pieces)}", at * piece.placement, piece.geometry))
    return Owner(name, body, "", pieces)


def figure_owners(name: str, figure: Figure, first: int) -> list[Owner]:
    """The pieces of a figure by segments; its root's body has the index `first`."""
    found: dict[str, Owner] = {}
    for piece in figure.geometry.geometryObjects:
        segment = f"{name}/{figure.model.frames[piece.parentFrame].name}"
        owner = found.setdefault(segment, Owner(segment, first + int(piece.parentJoint) - 1, name, []))
        owner.pieces.append((f"{name}/{piece.name}", piece.placement, piece.geometry))
    return list(found.values())


def figure_pairs(name: str, figure: Figure) -> list[tuple[str, str]]:
    """Names of the pieces of a figure that it tests against each other."""
    pieces = [f"{name}/{piece.name}" for piece in figure.geometry.geometryObjects]
    return [(pieces[pair.first], pieces[pair.second]) for pair in figure.geometry.collisionPairs]


class AssemblyFigure(FigureBodies):
    """A figure among the bodies of an assembly: `batches` are its joints, limits and constraints."""

    def __init__(self, name: str, problem: Problem, first: int) -> None:
        """Read the joints; `first` is the index of the first body."""
        super().__init__(problem.scene.figure, problem.start, first)
        self.name, self.problem = name, problem
        constraints = constraint_equations(problem, self)
        bounds = bound_equations(problem, self, State(problem.scene.model))
        sets = (self.equations, constraints, bounds)
        self.batches: list[Batch] = [self.limits, *(batch for one in sets for batch in one.batches())]
        for batch in self.batches:
            batch.labels = [f"{name!r}, {label}" for label in batch.labels]

    def __getstate__(self) -> tuple[str, Problem, int]:
        """Return the arguments that it is made from; Pinocchio's data are computed anew."""
        return self.name, self.problem, self.first

    def __setstate__(self, state: tuple[str, Problem, int]) -> None:
        self.__init__(*state)  # type: ignore[misc]


class LooseBodies:
    """What a `wholebody.Scene` asks of its figure: a free joint a body, the figures' own joints, all pieces and pairs.

    Joint k + 1 of `model` is body k. Figures keep their joints, because Pinocchio's data grow with the cube of the
    degrees of freedom: by 7 GB for 100 free bodies.
    """

    root = "free"
    detail = "own"
    postures = ()
    visual = None
    members = ()
    outer = ()
    name = "assembly"

    def __init__(
        self,
        parts: Sequence[str | tuple[str, Figure]],
        owners: Iterable[Owner],
        tested: Callable[[Owner, Owner], bool],
        pairs: Iterable[tuple[str, str]],
    ) -> None:
        self.model = pin.Model()
        for part in parts:
            if isinstance(part, str):
                self.model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), part)
            else:
                self._append(*part)
        pieces, owner_of = [], []
        self.segments: tuple[str, ...] = ()
        for owner in owners:
            frame = pin.Frame(owner.name, owner.body + 1, 0, pin.SE3.Identity(), pin.FrameType.BODY)
            index = self.model.addFrame(frame)
            self.segments += (owner.name,)
            for name, at, shape in owner.pieces:
                pieces.append(pin.GeometryObject(name, owner.body + 1, index, at, shape))
                owner_of.append(owner)
        self.geometry = geometry_model(pieces)
        for second, one in enumerate(owner_of):
            for first, other in enumerate(owner_of[:second]):
                if other.body != one.body and tested(other, one):
                    self.geometry.addCollisionPair(pin.CollisionPair(first, second))
        for part in parts:
            if isinstance(part, str) and part not in self.segments:
                self.model.addJointFrame(self.model.getJointId(part))
        index_of = {piece.name: index for index, piece in enumerate(pieces)}
        for pair in pairs:
            self.geometry.addCollisionPair(pin.CollisionPair(*sorted(index_of[name] for name in pair)))
        self._turning = Turning(self.model)

    def warn_of_angles(self, q: Array, what: str) -> bool:
        """Warn of the angle farthest out of limits in q, as `Figure.warn_of_angles` does."""
        return self._turning.warn(q, what)

    def _append(self, name: str, figure: Figure) -> None:
        """Add the joints of a figure."""
        own, before = figure.model, self.model.njoints - 1
        for joint in range(1, own.njoints):
            parent = int(own.parents[joint])
            carrier = before + parent if parent else 0
            self.model.addJoint(carrier, own.joints[joint], own.jointPlacements[joint], f"{name}/{own.names[joint]}")

    def frame_id(self, name: str) -> int:
        """Index of the frame of a body, or of a segment of a figure with pieces."""
        known = [frame.name for frame in self.model.frames][1:]
        return int(self.model.getFrameId(checks.known(name, known, "body")))
