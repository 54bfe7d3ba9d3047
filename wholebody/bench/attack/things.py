"""Things at random: every shape, of any size, clear of a figure or inside it by a given depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.things import Occupied

KINDS = ("box", "sphere", "capsule", "ellipsoid", "hull", "plate", "halfspace", "mesh")
SHARES = (0.25, 0.15, 0.15, 0.1, 0.12, 0.12, 0.1, 0.01)
THINNEST = 2e-4  # m
LEAST, MOST = 2e-4, 300.0  # m: of a size
FAR = 60.0  # m: things stand nearer than this
TRIES = 20  # things that are tried for one that is clear
HALVINGS = 60  # of a way, until a depth is met


@dataclass(frozen=True)
class Thing:
    """A thing.

    Attributes:
        shape: what it is.
        call: Python that makes the shape.
        at: (7,) where it stands.
    """

    shape: wb.Shape
    call: str
    at: tuple[float, ...]

    @property
    def placement(self) -> pin.SE3:
        """Where it stands."""
        return pin.SE3(pin.Quaternion(np.array(self.at[3:])).matrix(), np.array(self.at[:3]))

    def line(self, name: str) -> str:
        """Return the line that adds it to a scene."""
        return f"scene.add({self.call}, name={name!r}, at={self.at!r})"


def shape(rng: np.random.Generator, size: float) -> tuple[wb.Shape, str]:
    """Return a shape of about a size, metres, and Python that makes it."""
    kind = str(rng.choice(KINDS, p=SHARES))
    scale = size * float(np.exp(rng.uniform(np.log(0.02), np.log(0.6))))

    def length(low: float, high: float) -> float:
        return float(np.clip(scale * rng.uniform(low, high), LEAST, MOST))

    made: Any
    if kind == "box":
        made = wb.Box((length(0.2, 1.0), length(0.2, 1.0), length(0.2, 1.0)))
    elif kind == "plate":
        made = wb.Box((length(0.5, 3.0), length(0.5, 3.0), max(THINNEST, 1e-3 * size)))
    elif kind == "sphere":
        made = wb.Sphere(length(0.2, 0.7))
    elif kind == "capsule":
        made = wb.Capsule(length(0.1, 0.4), length(0.3, 1.5))
    elif kind == "ellipsoid":
        made = wb.Ellipsoid((length(0.2, 0.8), length(0.2, 0.8), length(0.2, 0.8)))
    elif kind == "halfspace":
        normal = rng.normal(size=3) if rng.random() < 0.5 else np.eye(3)[int(rng.integers(3))]
        made = wb.HalfSpace((float(normal[0]), float(normal[1]), float(normal[2])))
    elif kind == "hull":
        cloud = rng.normal(size=(int(rng.integers(8, 40)), 3)) * [length(0.2, 0.5) for _ in range(3)]
        return wb.Hull(cloud), f"wb.Hull(np.array({cloud.tolist()!r}))"
    else:
        return _corner(length(0.4, 1.0))
    return made, f"wb.{made!r}"


def _corner(size: float) -> tuple[wb.Shape, str]:
    """A mesh that is not convex: an angle of two walls."""
    outline = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.2), (0.2, 0.2), (0.2, 1.0), (0.0, 1.0)]
    vertices = [(size * x, size * y, size * z) for z in (0.0, 0.5) for x, y in outline]
    caps = [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 5, 4)]
    faces = caps + [(6 + a, 6 + c, 6 + b) for a, b, c in caps]
    for k in range(6):
        following = (k + 1) % 6
        faces += [(k, following, 6 + following), (k, 6 + following, 6 + k)]
    call = f"wb.Mesh((np.array({vertices!r}), np.array({faces!r})))"
    return wb.Mesh((np.array(vertices), np.array(faces))), call


def somewhere(rng: np.random.Generator, placed: Occupied, size: float) -> pin.SE3:
    """Return a place about a figure."""
    middle, spread = _extent(placed)
    reach = 1.3 * spread + 0.5 * size
    return pin.SE3(pin.Quaternion(_turn(rng)).matrix(), middle + rng.uniform(-reach, reach, 3))


def _extent(placed: Occupied) -> tuple[Array, float]:
    """Middle (3,) of a figure's pieces in its postures, and how far the farthest is from there, metres."""
    middle = placed.centres.mean(axis=0) if len(placed.centres) else np.zeros(3)
    return middle, float(np.linalg.norm(placed.centres - middle, axis=1).max(initial=0.0))


def clear(rng: np.random.Generator, placed: Occupied, size: float, room: float, postures: list[int]) -> Thing | None:
    """Return a thing that leaves some room, metres, around a figure in some of its postures; None if none was found."""
    for _ in range(TRIES):
        made, call = shape(rng, size)
        at = somewhere(rng, placed, size)
        if all(placed.distance(made, at, posture) > room for posture in postures):
            return Thing(made, call, xyzquat(at))
    return None


def inside(rng: np.random.Generator, placed: Occupied, size: float, depth: float) -> Thing | None:
    """Return a thing that is in the figure's first posture by a depth, metres; None where its shape does not let it."""
    made, call = shape(rng, size)
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
    for _ in range(HALVINGS):
        middle = 0.5 * (near + far)
        if placed.distance(made, at(middle), 0) < -depth:
            near = middle
        else:
            far = middle
    place = at(near)
    if np.abs(place.translation).max() > FAR:
        return None
    return Thing(made, call, xyzquat(place))


def xyzquat(at: pin.SE3) -> tuple[float, ...]:
    """Return a placement as seven numbers."""
    return tuple(float(x) for x in pin.SE3ToXYZQUAT(at))


def _turn(rng: np.random.Generator) -> Array:
    turn = rng.normal(size=4)
    return np.asarray(turn / np.linalg.norm(turn))
