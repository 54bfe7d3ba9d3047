"""A gallery of two rooms with a door between them and some twenty objects."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Box, Capsule, Ellipsoid, HalfSpace, Hull, Mesh, Sphere
from wholebody.scene.scene import Scene
from wholebody.tracking.tracks import check_figure

Color = tuple[float, float, float, float]
Place = tuple[float, float, float]

WALL: Color = (0.86, 0.85, 0.82, 1.0)
OAK: Color = (0.60, 0.48, 0.36, 1.0)
STONE: Color = (0.72, 0.72, 0.70, 1.0)
BRONZE: Color = (0.55, 0.42, 0.26, 1.0)
BLUE: Color = (0.30, 0.42, 0.58, 1.0)

HALF_WIDTH = 2.5  # m: of a room, along y
LENGTH = 5.0  # m: of a room, along x; the rooms meet at x = 0
HEIGHT = 2.6
DOOR_WIDTH, DOOR_HEIGHT = 1.0, 2.1

TABLE: Place = (-2.5, 1.2, 0.74)  # m: middle of the top of the long table
TABLE_SIZE = (1.6, 0.8, 0.04)


def gallery(figure: Figure) -> Scene:
    """A scene with a figure in a gallery: a west room (x from -5 to 0), an east room (0 to 5), and a door between them.

    Walls, a door with a lintel, a niche in the east room, tables, a bench, pedestals, and sculptures on them: a torus,
    split into convex pieces, a sphere, an egg, an obelisk and a figure of capsules. All of them are fixed.
    """
    scene = Scene(check_figure(figure, "gallery"))
    scene.add(HalfSpace(), name="floor")
    _walls(scene)
    _furniture(scene)
    _sculptures(scene)
    return scene


def _walls(scene: Scene) -> None:
    t, h, middle = 0.15, HEIGHT, 0.5 * HEIGHT  # thickness
    outside = 2.0 * (LENGTH + t)
    scene.add(Box((t, 2.0 * HALF_WIDTH, h)), name="west wall", at=(-LENGTH - 0.5 * t, 0.0, middle), color=WALL)
    scene.add(Box((t, 2.0 * HALF_WIDTH, h)), name="east wall", at=(LENGTH + 0.5 * t, 0.0, middle), color=WALL)
    scene.add(Box((outside, t, h)), name="north wall", at=(0.0, HALF_WIDTH + 0.5 * t, middle), color=WALL)
    scene.add(Box((outside, t, h)), name="south wall", at=(0.0, -HALF_WIDTH - 0.5 * t, middle), color=WALL)
    side = HALF_WIDTH - 0.5 * DOOR_WIDTH
    for name, sign in (("wall left of the door", 1.0), ("wall right of the door", -1.0)):
        scene.add(Box((t, side, h)), name=name, at=(0.0, sign * (0.5 * DOOR_WIDTH + 0.5 * side), middle), color=WALL)
    lintel = h - DOOR_HEIGHT
    scene.add(Box((t, DOOR_WIDTH, lintel)), name="lintel", at=(0.0, 0.0, DOOR_HEIGHT + 0.5 * lintel), color=WALL)
    scene.add(Box((1.2, t, h)), name="niche", at=(LENGTH - 0.6, -0.9, middle), color=WALL)


def _furniture(scene: Scene) -> None:
    x, y, top = TABLE
    length, width, thick = TABLE_SIZE
    scene.add(Box(TABLE_SIZE), name="table", at=(x, y, top - 0.5 * thick), color=OAK)
    leg = top - thick
    for name, sign in (("table's west leg", -1.0), ("table's east leg", 1.0)):
        at = (x + sign * (0.5 * length - 0.1), y, 0.5 * leg)
        scene.add(Box((0.06, 0.8 * width, leg)), name=name, at=at, color=OAK)
    scene.add(_cylinder(0.45, 0.03), name="round table", at=(2.2, 1.4, 0.735), color=OAK)
    scene.add(_cylinder(0.06, 0.72), name="round table's foot", at=(2.2, 1.4, 0.36), color=OAK)
    scene.add(Box((1.4, 0.4, 0.45)), name="bench", at=(-2.5, -1.4, 0.225), color=OAK)


def _sculptures(scene: Scene) -> None:
    for name, x, y, height in (
        ("torus's pedestal", -0.9, 1.9, 0.9),
        ("sphere's pedestal", -4.3, -1.8, 1.0),
        ("egg's pedestal", 1.2, -1.8, 1.0),
    ):
        scene.add(Box((0.4, 0.4, height)), name=name, at=(x, y, 0.5 * height), color=STONE)
    upright = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    scene.add(_torus(), name="torus", at=(-0.9, 1.9, 0.9 + 0.37, *upright), color=BRONZE)
    scene.add(Sphere(0.2), name="sphere", at=(-4.3, -1.8, 1.2), color=BLUE)
    scene.add(Ellipsoid((0.14, 0.14, 0.24)), name="egg", at=(1.2, -1.8, 1.24), color=BLUE)
    obelisk = [(s * a, t * a, z) for a, z in ((0.2, 0.0), (0.12, 1.7)) for s in (-1, 1) for t in (-1, 1)]
    scene.add(Hull(np.array([*obelisk, (0.0, 0.0, 1.9)])), name="obelisk", at=(3.2, -1.8, 0.0), color=STONE)
    scene.add(Capsule(radius=0.12, length=1.2), name="column", at=(4.4, 1.9, 0.72), color=STONE)


def _cylinder(radius: float, height: float) -> Hull:
    angle = np.linspace(0.0, 2.0 * math.pi, 25)[:-1]
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    half = np.array([0.0, 0.0, 0.5 * height])
    return Hull(np.vstack([ring - half, ring + half]))


@cache
def _torus() -> Mesh:
    """A ring of 37 cm radius; splitting it takes seconds, so every gallery shares it."""
    import trimesh

    ring = trimesh.creation.torus(0.28, 0.09, major_sections=24, minor_sections=12)
    return Mesh((ring.vertices, ring.faces))
