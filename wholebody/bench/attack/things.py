"""Things at random: every shape, of any size, clear of a figure or inside it by a given depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.things import Occupied


@dataclass(frozen=True)
class Thing:
    """A thing.

    Attributes:
        shape: what it is.
        at: (7,) where it stands.
    """

    shape: wb.Shape
    at: tuple[float, ...]

    @property
    def placement(self) -> pin.SE3:
        """Where it stands."""
        return pin.SE3(pin.Quaternion(np.array(self.at[3:])).matrix(), np.array(self.at[:3]))


def shape(rng: np.random.Generator, size: float) -> wb.Shape:
    """A shape of about a size, metres."""
    shares = {"box": 0.25, "sphere": 0.15, "capsule": 0.15, "ellipsoid": 0.1, "hull": 0.12, "plate": 0.12}
    shares |= {"halfspace": 0.1, "mesh": 0.01}
    kind = str(rng.choice(list(shares), p=list(shares.values())))
    scale = size * float(np.exp(rng.uniform(np.log(0.02), np.log(0.6))))

    def length(low: float, high: float) -> float:
        return float(np.clip(scale * rng.uniform(low, high), 2e-4, 300.0))

    if kind == "box":
        return wb.Box((length(0.2, 1.0), length(0.2, 1.0), length(0.2, 1.0)))
    if kind == "plate":
        return wb.Box((length(0.5, 3.0), length(0.5, 3.0), max(2e-4, 1e-3 * size)))
    if kind == "sphere":
        return wb.Sphere(length(0.2, 0.7))
    if kind == "capsule":
        return wb.Capsule(length(0.1, 0.4), length(0.3, 1.5))
    if kind == "ellipsoid":
        return wb.Ellipsoid((length(0.2, 0.8), length(0.2, 0.8), length(0.2, 0.8)))
    if kind == "halfspace":
        normal = rng.normal(size=3) if rng.random() < 0.5 else np.eye(3)[int(rng.integers(3))]
        return wb.HalfSpace((float(normal[0]), float(normal[1]), float(normal[2])))
    if kind == "hull":
        return wb.Hull(rng.normal(size=(int(rng.integers(8, 40)), 3)) * [length(0.2, 0.5) for _ in range(3)])
    return _corner(length(0.4, 1.0))


def _corner(size: float) -> wb.Shape:
    """A mesh that is not convex: an angle of two walls."""
    outline = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.2), (0.2, 0.2), (0.2, 1.0), (0.0, 1.0)]
    vertices = [(size * x, size * y, size * z) for z in (0.0, 0.5) for x, y in outline]
    caps = [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 5, 4)]
    faces = caps + [(6 + a, 6 + c, 6 + b) for a, b, c in caps]
    for k in range(6):
        following = (k + 1) % 6
        faces += [(k, following, 6 + following), (k, 6 + following, 6 + k)]
    return wb.Mesh((np.array(vertices), np.array(faces)))


def somewhere(rng: np.random.Generator, placed: Occupied, size: float) -> pin.SE3:
    """A place about a figure."""
    middle, spread = _extent(placed)
    reach = 1.3 * spread + 0.5 * size
    return pin.SE3(pin.Quaternion(_turn(rng)).matrix(), middle + rng.uniform(-reach, reach, 3))


def _extent(placed: Occupied) -> tuple[Array, float]:
    """Middle (3,) of a figure's pieces in its postures, and how far the farthest is from there, metres."""
    middle = placed.centres.mean(axis=0) if len(placed.centres) else np.zeros(3)
    return middle, float(np.linalg.norm(placed.centres - middle, axis=1).max(initial=0.0))


def clear(rng: np.random.Generator, placed: Occupied, size: float, room: float, postures: list[int]) -> Thing | None:
    """Return a thing that leaves some room, metres, around a figure in some of its postures; None if none was found."""
    for _ in range(20):
        made = shape(rng, size)
        at = somewhere(rng, placed, size)
        if all(placed.distance(made, at, posture) > room for posture in postures):
            return Thing(made, xyzquat(at))
    return None


def inside(rng: np.random.Generator, placed: Occupied, size: float, depth: float) -> Thing | None:
    """Return a thing that is in the figure's first posture by a depth, metres; None where its shape does not let it."""
    made = shape(rng, size)
    if not placed.places:
        return None
    start = placed.places[int(rng.integers(placed.count))]
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    turn = pin.Quaternion(_turn(rng)).matrix()
    near, far = 0.0, 4.0 * (_extent(placed)[1] + size)

    def at(way: float) -> pin.SE3:
        return pin.SE3(turn, start.translation + way * direction)

    if placed.distance(made, at(near), 0) > -depth or placed.distance(made, at(far), 0) < -depth:
        return None
    for _ in range(60):
        middle = 0.5 * (near + far)
        if placed.distance(made, at(middle), 0) < -depth:
            near = middle
        else:
            far = middle
    place = at(near)
    if np.abs(place.translation).max() > 60.0:
        return None
    return Thing(made, xyzquat(place))


def xyzquat(at: pin.SE3) -> tuple[float, ...]:
    """Return a placement as seven numbers."""
    return tuple(float(x) for x in pin.SE3ToXYZQUAT(at))


def _turn(rng: np.random.Generator) -> Array:
    turn = rng.normal(size=4)
    return np.asarray(turn / np.linalg.norm(turn))
