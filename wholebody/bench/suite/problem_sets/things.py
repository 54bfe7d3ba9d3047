"""Random things around a figure, clear of postures that must stay possible."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import coal
import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.figures.postures import placed
from wholebody.figures.urdf.joints import exact
from wholebody.geometry.pieces import hull_triangles, swept_points
from wholebody.geometry.placement import placement

Make = Callable[[int, np.random.Generator], tuple[str, wb.Shape]]  # makes the thing of a number: its kind and its shape


def coal_distance(first: Any, at: pin.SE3, second: Any, there: pin.SE3, exact: bool = False) -> float:
    """Signed distance of two shapes of coal at placements, metres: a call of its own, which keeps nothing."""
    put, other = (coal.Transform3s(place.rotation, place.translation) for place in (at, there))
    request = coal.DistanceRequest()
    if exact:
        request.gjk_tolerance = request.epa_tolerance = 1e-9
    return float(coal.distance(first, put, second, other, request, coal.DistanceResult()))


def just_outside(gap: Callable[[float], float], inside: float, outside: float) -> float:
    """Where a gap, negative at one end of a way and not at the other, is zero to rounding: by bisection."""
    for _ in range(50):
        half = 0.5 * (inside + outside)
        inside, outside = (half, outside) if gap(half) < 0.0 else (inside, half)
    return outside


def shape_of(geometry: Any) -> tuple[str, list[float]]:
    """Kind of a shape of coal and its lengths [m], full ones and radii; n and d of a half-space n . x <= d."""
    known: dict[Any, tuple[str, Callable[[Any], Any]]] = {
        coal.Box: ("box", lambda shape: 2.0 * np.array(shape.halfSide)),
        coal.Sphere: ("sphere", lambda shape: (shape.radius,)),
        coal.Capsule: ("capsule", lambda shape: (shape.radius, 2.0 * shape.halfLength)),
        coal.Cylinder: ("cylinder", lambda shape: (shape.radius, 2.0 * shape.halfLength)),
        coal.Ellipsoid: ("ellipsoid", lambda shape: shape.radii),
        coal.Halfspace: ("half-space", lambda shape: (*shape.n, shape.d)),
    }
    if isinstance(geometry, coal.ConvexBase):
        return "hull", []
    kind, lengths = known.get(type(geometry), (type(geometry).__name__, lambda shape: ()))
    return kind, [float(length) for length in lengths(geometry)]


def hull_obj(hull: Any) -> str:
    """A convex hull of coal as the text of a Wavefront file."""
    lines = [f"v {exact(point)}" for point in np.array(hull.points()) + 0.0]  # no negative zero
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in hull_triangles(hull).tolist()]
    return "\n".join(lines) + "\n"


class Occupied:
    """What a figure's `count` pieces fill in some postures, then balls: `places` (SE3), `centres` (n, 3)."""

    def __init__(self, figure: wb.Figure, postures: Iterable[Array]) -> None:
        """Place the figure's pieces at each posture (nq,)."""
        pieces = [each for q in postures for each in placed(figure, q)]
        self.places = [place for _, place in pieces]
        self._shapes: list[Any] = [piece.geometry for piece, _ in pieces]
        self.centres = np.array([place.translation for place in self.places]).reshape(-1, 3)
        self._reach = np.array([swept_points(shape).reach for shape in self._shapes])
        self.count = figure.geometry.ngeoms

    def keep_free(self, places: Array, radius: float) -> None:
        """Take up balls about places (n, 3) too, metres."""
        self.places += [pin.SE3(np.eye(3), place) for place in places]
        self._shapes += [coal.Sphere(radius)] * len(places)
        self.centres = np.vstack([self.centres, places])
        self._reach = np.append(self._reach, np.full(len(places), radius))

    def clear_of(self, shape: wb.Shape, at: Sequence[float] | pin.SE3, room: float) -> bool:
        """Whether a thing at a placement leaves this much room, metres, around the figure in every posture."""
        base = placement(at)
        for piece in shape.pieces():
            there = base * piece.placement
            between = np.linalg.norm(self.centres - there.translation, axis=1)
            near = np.flatnonzero(between < self._reach + swept_points(piece.geometry).reach + room)
            if any(distance < room for distance in self._distances(piece.geometry, there, near.tolist())):
                return False
        return True

    def distance(self, shape: wb.Shape, at: pin.SE3, posture: int) -> float:
        """Least signed distance of a thing at a placement from the figure in one of the postures, metres."""
        numbers = range(posture * self.count, (posture + 1) * self.count)
        pieces = ((piece.geometry, at * piece.placement) for piece in shape.pieces())
        return min((least for piece in pieces for least in self._distances(*piece, numbers)), default=np.inf)

    def _distances(self, geometry: Any, there: pin.SE3, numbers: Iterable[int]) -> Iterator[float]:
        """Signed distances of a piece from some of the figure's, metres."""
        for number in numbers:
            yield coal_distance(geometry, there, self._shapes[number], self.places[number])


def add_things(
    scene: wb.Scene,
    count: int,
    taken: Occupied,
    room: float,
    rng: np.random.Generator,
    space: Sequence[Sequence[float]] = ((-0.6, -1.0, 0.1), (1.2, 1.0, 2.0)),
    make: Make | None = None,
) -> None:
    """Put random things into a box of space [m], clear of what is taken up; they may cross. `make`: kind and shape."""
    for number in range(count):
        for _ in range(5000):  # many times what the most crowded postures have needed
            kind, shape = (make or household_thing)(number, rng)
            turn = turned(rng)
            at = (*rng.uniform(space[0], space[1]), *turn)
            if taken.clear_of(shape, at, room):
                break
        else:
            raise InputError(
                f"there is no place for thing {number} of {count} around {scene.figure.name!r}; ask for fewer of them "
                "or less room"
            )
        scene.add(shape, name=f"{kind} {number}", at=at)


def turned(rng: np.random.Generator) -> Array:
    """A quaternion (4,) of any rotation."""
    turn = rng.normal(size=4)
    return np.asarray(turn / np.linalg.norm(turn))


def household_thing(number: int, rng: np.random.Generator) -> tuple[str, wb.Shape]:
    """A box, sphere, capsule or hull in turn, of the size of household things."""
    kind = ("box", "sphere", "capsule", "hull")[number % 4]
    if kind == "box":
        x, y, z = rng.uniform(0.05, 0.5, 3).tolist()
        return kind, wb.Box((x, y, z))
    if kind == "sphere":
        return kind, wb.Sphere(float(rng.uniform(0.03, 0.2)))
    if kind == "capsule":
        return kind, wb.Capsule(float(rng.uniform(0.02, 0.1)), float(rng.uniform(0.1, 0.6)))
    return kind, wb.Hull(rng.normal(size=(30, 3)) * rng.uniform(0.03, 0.12, 3))
