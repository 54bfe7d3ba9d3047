"""Shapes of things: immutable, checked when they are made, each a union of convex pieces."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from os import PathLike
from typing import Annotated, Literal, Protocol, TypeAlias, runtime_checkable

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wholebody.base.arrays import Array, brief, with_values
from wholebody.base.checks import array, listed, path, shown
from wholebody.base.errors import InputError
from wholebody.base.fields import Checked, Range, Vector
from wholebody.geometry.convex import CONCAVITY, VERTICES, check_mesh, convex_pieces
from wholebody.geometry.hull import SIDES, check_points, cylinder_pieces, hull_piece, torus_pieces
from wholebody.geometry.mesh_cache import ConvexPieces
from wholebody.geometry.meshes import GLTF, Y_UP, read_mesh
from wholebody.geometry.pieces import LARGEST, SMALLEST, Piece, kept, with_own_places
from wholebody.geometry.placement import unit_vector

LENGTH = Range(SMALLEST, LARGEST, "m")
Length: TypeAlias = Annotated[float, LENGTH]
Lengths: TypeAlias = Annotated[tuple[float, float, float], Vector(3, LENGTH)]


class Shape(Checked, ABC):
    """A solid, in its own axes, metres.

    Raises:
        InputError: a size that is no number or not within 0.1 mm and 10 km, as every shape raises it when it is made.

    Examples:
        >>> isinstance(wb.Sphere(0.1), wb.Shape)
        True
    """

    @abstractmethod
    def pieces(self) -> tuple[Piece, ...]:
        """Convex pieces whose union is the shape."""

    @property
    def added_volume(self) -> float:
        """Volume that the convex pieces add to the shape, as a share of its own volume; 0 for an exact shape."""
        return 0.0


@dataclass(frozen=True)
class Box(Shape):
    """A cuboid, centred at its origin.

    Attributes:
        size: full lengths along x, y and z, metres.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> table = wb.Box((1.2, 0.7, 0.04))
    """

    size: Lengths

    def pieces(self) -> tuple[Piece, ...]:
        """One coal Box."""
        return (Piece(coal.Box(*self.size), pin.SE3.Identity(), math.prod(self.size)),)


@dataclass(frozen=True)
class Sphere(Shape):
    """A ball, centred at its origin.

    Attributes:
        radius: metres.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> ball = wb.Sphere(radius=0.1)
    """

    radius: Length

    def pieces(self) -> tuple[Piece, ...]:
        """One coal Sphere."""
        return (Piece(coal.Sphere(self.radius), pin.SE3.Identity(), 4.0 / 3.0 * math.pi * self.radius**3),)


@dataclass(frozen=True)
class Capsule(Shape):
    """All points within a radius of a segment along z, centred at its origin.

    Attributes:
        radius: metres.
        length: of the segment, without the two half balls, metres.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> rail = wb.Capsule(radius=0.02, length=0.8)
    """

    radius: Length
    length: Length

    def pieces(self) -> tuple[Piece, ...]:
        """One coal Capsule."""
        volume = math.pi * self.radius**2 * (self.length + 4.0 / 3.0 * self.radius)
        return (Piece(coal.Capsule(self.radius, self.length), pin.SE3.Identity(), volume),)


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder along z, centred at its origin: one hull, a prism of `SIDES` sides around it.

    The prism is nowhere inside the cylinder, and at its edges 0.12 % of the radius outside.

    Attributes:
        radius: metres.
        length: along z, metres.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> post = wb.Cylinder(radius=0.05, length=2.0)
    """

    radius: Length
    length: Length

    def pieces(self) -> tuple[Piece, ...]:
        """One coal Convex."""
        return kept(self, lambda: cylinder_pieces(self.radius, self.length))

    @property
    def added_volume(self) -> float:
        """What the prism adds: n tan(pi / n) / pi - 1."""
        return SIDES * math.tan(math.pi / SIDES) / math.pi - 1.0


@dataclass(frozen=True)
class Torus(Shape):
    """A ring about z, centred at its origin, such as a steering wheel: 24 convex pieces around it.

    On the outer side the pieces cover the ring; on the inner side a sector is as straight as a chord, and up to 0.9 %
    of the radius of the ring is missing at its ends.

    Attributes:
        radius: from the centre to the middle of the tube, metres.
        tube: radius of the tube, metres; less than `radius`.

    Raises:
        InputError: a length out of range, or the tube is not thinner than the ring.

    Examples:
        >>> wheel = wb.Torus(radius=0.18, tube=0.015)
    """

    radius: Length
    tube: Length

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.tube < self.radius:
            raise InputError(f"Torus: tube is {self.tube:g} m; give less than the radius of {self.radius:g} m")

    def pieces(self) -> tuple[Piece, ...]:
        """One coal Convex a sector: the hull of the tube's circles at both of its ends."""
        return torus_pieces(self.radius, self.tube)

    @property
    def added_volume(self) -> float:
        """What the pieces add to the ring, of the volume 2 pi^2 R r^2."""
        exact = 2.0 * math.pi**2 * self.radius * self.tube**2
        return sum(piece.volume for piece in self.pieces()) / exact - 1.0


@dataclass(frozen=True)
class Ellipsoid(Shape):
    """An ellipsoid, centred at its origin. Its distances are accurate to 1e-6 m and 1e-5 of its size.

    Attributes:
        semi_axes: half lengths along x, y and z, metres.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> egg = wb.Ellipsoid((0.03, 0.03, 0.04))
    """

    semi_axes: Lengths

    def pieces(self) -> tuple[Piece, ...]:
        """One coal Ellipsoid."""
        volume = 4.0 / 3.0 * math.pi * math.prod(self.semi_axes)
        return (Piece(coal.Ellipsoid(*self.semi_axes), pin.SE3.Identity(), volume),)


@dataclass(frozen=True)
class HalfSpace(Shape):
    """Everything on one side of a plane: the points x with normal . x <= offset are solid.

    Attributes:
        normal: outward normal; converted to a unit vector.
        offset: distance of the plane from the origin along the normal, metres.

    Raises:
        InputError: the normal has no length, or a value is no number or out of range.

    Examples:
        >>> ground = wb.HalfSpace()
    """

    normal: Annotated[tuple[float, float, float], unit_vector] = (0.0, 0.0, 1.0)
    offset: Annotated[float, Range(-LARGEST, LARGEST, "m")] = 0.0

    def pieces(self) -> tuple[Piece, ...]:
        """One coal Halfspace, of infinite volume."""
        return (Piece(coal.Halfspace(np.array(self.normal), self.offset), pin.SE3.Identity(), math.inf),)


@dataclass(frozen=True, eq=False)
class Hull(Shape):
    """The convex hull of points.

    Attributes:
        points: (n, 3), metres; kept without duplicates, read-only.

    Raises:
        InputError: not such points, or none that span a solid.

    Examples:
        >>> wedge = wb.Hull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    """

    __repr__ = brief

    points: Array

    def __post_init__(self) -> None:
        points = np.unique(check_points(array(self.points, "Hull: points", "an array of shape (n, 3)"), "Hull"), axis=0)
        points.setflags(write=False)
        object.__setattr__(self, "points", points)
        self.pieces()

    def pieces(self) -> tuple[Piece, ...]:
        """One coal Convex."""
        return with_own_places(kept(self, lambda: (hull_piece(self.points, "Hull"),)))


@runtime_checkable
class HasTriangles(Protocol):
    """A mesh of another library, such as trimesh."""

    @property
    def vertices(self) -> ArrayLike:
        """(n, 3)."""

    @property
    def faces(self) -> ArrayLike:
        """(m, 3) indices of vertices."""


@dataclass(frozen=True, eq=False)
class Mesh(Shape):
    """A triangle mesh, split into convex pieces when they are first needed.

    Attributes:
        source: path of an OBJ, STL, PLY, glTF, GLB or COLLADA file, a pair of arrays (vertices (n, 3), faces (m, 3)),
            or an object that has them as `vertices` and `faces`, such as a trimesh.Trimesh; kept as a pair of arrays.
        scale: metres for each unit of the file: 0.001 for millimetres.
        up: axis of the file that points up; with "y" the mesh is rotated: y to z, and the file's z to -y. If left out,
            glTF and GLB files have y up and z to the front, as their standard says, which become z and x; others "z".
        max_vertices: most vertices of a piece of a decomposition; convex parts keep all of theirs.
        threshold: concavity of the pieces of a decomposition, as a share of the part's size: smaller is closer, with
            more pieces.
        vertices: (n, 3) scaled and rotated, read-only.
        faces: (m, 3), read-only.

    Raises:
        FileFormatError: the file is no mesh that can be read.
        MissingPackageError: trimesh, or for a COLLADA file pycollada, is not installed.

    Examples:
        >>> corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
        >>> wedge = wb.Mesh((corners, [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]))
    """

    __repr__ = brief

    source: str | PathLike[str] | tuple[ArrayLike, ArrayLike] | HasTriangles
    scale: Annotated[float, Range(1e-12, 1e12, wanted="metres for each unit of the file, such as 0.001")] = 1.0
    up: Literal["z", "y"] | None = None
    max_vertices: Annotated[int, VERTICES] = 32
    threshold: Annotated[float, CONCAVITY] = 0.05
    vertices: Array = field(init=False, repr=False)
    faces: NDArray[np.int64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.source, (str, PathLike, tuple, list)) and isinstance(self.source, HasTriangles):
            object.__setattr__(self, "source", (self.source.vertices, self.source.faces))
        if isinstance(self.source, (str, PathLike)):
            vertices, faces = read_mesh(path(self.source, "Mesh source"))
        elif isinstance(self.source, (tuple, list)) and len(self.source) == 2:
            vertices = array(self.source[0], "Mesh vertices", "an array of shape (n, 3)")
            corners = array(self.source[1], "Mesh faces", "an array of shape (m, 3)")
            if not (np.abs(corners) <= 2**31).all():  # Greatest index of a vertex.
                raise InputError("Mesh faces: not every value is an index of a vertex; give whole numbers")
            faces = corners  # type: ignore[assignment]
        else:
            raise InputError(
                f"Mesh source is {shown(self.source)}; give the path of a file, a trimesh.Trimesh, or a pair of "
                "arrays (vertices, faces)"
            )
        with np.errstate(over="ignore"):  # overflowed values are refused as not finite
            vertices = vertices * self.scale
        vertices, faces = check_mesh(vertices, faces, self._name())
        gltf = isinstance(self.source, (str, PathLike)) and str(self.source).lower().endswith((".gltf", ".glb"))
        turn = Y_UP if self.up == "y" else GLTF if self.up is None and gltf else np.eye(3)
        vertices = vertices @ turn.T
        faces = faces.copy()
        vertices.setflags(write=False)
        faces.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    def _name(self) -> str:
        return f"mesh {self.source}" if isinstance(self.source, (str, PathLike)) else "mesh"

    def convexified(self) -> ConvexPieces:
        """Pieces, added volume, and notes on the parts that could not be kept as they are."""
        settings = self.max_vertices, self.threshold, self._name()
        found = kept(self, lambda: convex_pieces(self.vertices, self.faces, *settings))
        return with_values(found, pieces=with_own_places(found.pieces))

    def pieces(self) -> tuple[Piece, ...]:
        """One coal Convex for each convex part, several for the others.

        Raises:
            InputError: nothing solid in the mesh, or max_vertices or threshold out of range.
            MissingPackageError: a part is not convex and coacd is not installed.
        """
        return self.convexified().pieces

    @property
    def added_volume(self) -> float:
        """Volume that the convex pieces add to the closed parts of the mesh, as a share of it."""
        return self.convexified().added_volume


@dataclass(frozen=True, eq=False)
class Compound(Shape):
    """Shapes that are one thing.

    Attributes:
        parts: each shape, and its placement as a pin.SE3.

    Raises:
        InputError: other parts, or none.
    """

    parts: tuple[tuple[Shape, pin.SE3], ...]

    def __post_init__(self) -> None:
        wanted = "[(wb.Box((0.1, 0.1, 0.1)), pin.SE3.Identity())]"
        parts = tuple(listed(self.parts, "Compound parts", wanted))
        for part in parts:
            pair = isinstance(part, (tuple, list)) and len(part) == 2
            placed = pair and isinstance(part[0], Shape) and isinstance(part[1], pin.SE3)
            if not (placed and np.isfinite(part[1].homogeneous).all()):
                raise InputError(f"Compound: a part is {shown(part)}; give pairs such as {wanted}")
        if not parts:
            raise InputError(f"Compound: there are no parts; give pairs such as {wanted}")
        object.__setattr__(self, "parts", tuple((shape, pin.SE3(at)) for shape, at in parts))

    def pieces(self) -> tuple[Piece, ...]:
        """The pieces of all shapes."""
        return tuple(
            Piece(piece.geometry, at * piece.placement, piece.volume)
            for shape, at in self.parts
            for piece in shape.pieces()
        )
