"""Random things around a figure, clear of postures that must stay possible."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import coal
import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.arrays import Array
from wholebody.errors import InputError
from wholebody.geometry.placement import placement
from wholebody.geometry.swept_points import swept_points

KINDS = ("box", "sphere", "capsule", "hull")
SPACE = ((-0.6, -1.0, 0.1), (1.2, 1.0, 2.0))  # m: where things are put around a person
TRIES = 2000
"""Places that are tried for one thing: many times what the most crowded postures have needed."""


class Occupied:
    """The space that a figure takes up in some postures."""

    def __init__(self, figure: wb.Figure, postures: Iterable[Array]) -> None:
        """Place the figure's pieces at each posture (nq,)."""
        geometry = figure.geometry
        data, placed = figure.model.createData(), pin.GeometryData(geometry)
        self.shapes = [piece.geometry for piece in geometry.geometryObjects]
        self.places = []
        for q in postures:
            pin.updateGeometryPlacements(figure.model, data, geometry, placed, q)
            self.places += [pin.SE3(place) for place in placed.oMg]
        self.centres = np.array([place.translation for place in self.places])
        self.reach = np.tile([swept_points(shape).reach for shape in self.shapes], len(self.places) // len(self.shapes))

    def clear_of(self, shape: wb.Shape, at: Sequence[float] | pin.SE3, room: float) -> bool:
        """Whether a thing at a placement leaves this much room, metres, around the figure in every posture."""
        base = placement(at)
        for piece in shape.pieces():
            there = base * piece.placement
            put = coal.Transform3s(there.rotation, there.translation)
            between = np.linalg.norm(self.centres - there.translation, axis=1)
            near = np.flatnonzero(between < self.reach + swept_points(piece.geometry).reach + room)
            for number in near.tolist():
                body, place = self.shapes[number % len(self.shapes)], self.places[number]
                other = coal.Transform3s(place.rotation, place.translation)
                found = coal.DistanceResult()
                if coal.distance(piece.geometry, put, body, other, coal.DistanceRequest(), found) < room:
                    return False
        return True


def add_things(
    scene: wb.Scene,
    count: int,
    taken: Occupied,
    room: float,
    rng: np.random.Generator,
    space: tuple[Sequence[float], Sequence[float]] = SPACE,
) -> None:
    """Put random things into a box of space, in any orientation, clear of what is taken up; they may cross each other.

    Raises:
        InputError: no place was found for one of them.
    """
    for number in range(count):
        kind = KINDS[number % len(KINDS)]
        for _ in range(TRIES):
            shape = random_shape(kind, rng)
            turn = rng.normal(size=4)
            at = (*rng.uniform(*space), *(turn / np.linalg.norm(turn)))
            if taken.clear_of(shape, at, room):
                break
        else:
            raise InputError(f"no place is left for thing {number} of {count}; ask for fewer of them or less room")
        scene.add(shape, name=f"{kind} {number}", at=at)


def random_shape(kind: str, rng: np.random.Generator) -> wb.Shape:
    """A box, sphere, capsule or hull of the size of household things."""
    if kind == "box":
        edges = rng.uniform(0.05, 0.5, 3)
        return wb.Box((float(edges[0]), float(edges[1]), float(edges[2])))
    if kind == "sphere":
        return wb.Sphere(float(rng.uniform(0.03, 0.2)))
    if kind == "capsule":
        return wb.Capsule(float(rng.uniform(0.02, 0.1)), float(rng.uniform(0.1, 0.6)))
    return wb.Hull(rng.normal(size=(30, 3)) * rng.uniform(0.03, 0.12, 3))
