"""Ready-made equipment for people: a sphere at the torso's side, pouches, a vest plate, a pack, a torus.

The shapes are parametric meshes and solids; sizes are those of common gear, and places follow from the figure's pieces.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.checks import instance, known
from wholebody.base.checks import text as checked_text
from wholebody.base.errors import InputError
from wholebody.base.files import is_file
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import Box, Mesh, Sphere
from wholebody.motion.worn_equipment import Equipment
from wholebody.scene.scene import Scene

CARRIERS = ("lower_thorax", "thorax")
CLOTH = (0.35, 0.38, 0.28, 1.0)

BALL = 0.075  # m: radius of the sphere at the torso's side, of which half is inside the torso
POUCH = (0.05, 0.17, 0.20)  # m: depth, width, height of a double magazine pouch
PLATE = (0.025, 0.24, 0.32)  # m: a medium plate of body armour (24 x 32 cm)
PACK = (0.20, 0.32, 0.50)  # m: depth, width, height of a day pack of 30 litres
RING = (0.13, 0.03)  # m: radii of the torus and of its tube; the hole is wide enough for a forearm
SIDE, WAIST, BELT = -0.05, -0.11, -0.15  # m: heights above the origin of the lower thorax
SECTIONS, ROUND = 16, 12  # convex sections of the torus, and corners of each
SLIT = 1e-4  # rad: between two sections, so that they stay separate parts, each convex


def side_sphere(figure: Figure) -> tuple[Equipment, ...]:
    """A ball at the left side of the torso, half inside it."""
    ball = Equipment.worn(
        Sphere(BALL), figure, name="side_sphere", to="lower_thorax", side="left", height=SIDE, color=CLOTH
    )
    at = ball.at.translation - np.array([0.0, BALL, 0.0])  # type: ignore[union-attr]
    return (Equipment(ball.name, ball.shape, ball.to, at, ball.rests_on, CLOTH),)


def pouches(figure: Figure) -> tuple[Equipment, ...]:
    """A pouch at each side of the waist."""
    depth, width, height = POUCH
    shape = Box((width, depth, height))
    return tuple(
        Equipment.worn(
            shape, figure, name=f"{side}_pouch", to="lower_thorax", side=side, height=BELT, sideways=0.1, color=CLOTH
        )
        for side in ("left", "right")
    )


def vest_plate(figure: Figure) -> tuple[Equipment, ...]:
    """A plate on the chest."""
    return (Equipment.worn(Box(PLATE), figure, name="vest_plate", to="thorax", side="front", color=CLOTH),)


def pack(figure: Figure) -> tuple[Equipment, ...]:
    """A pack on the back."""
    return (Equipment.worn(Box(PACK), figure, name="pack", to="thorax", side="back", height=-0.08, color=CLOTH),)


def torus(figure: Figure) -> tuple[Equipment, ...]:
    """A horizontal ring at the left side of the waist; a hanging arm can get into its hole."""
    mesh = Mesh(torus_mesh(*RING))
    return (Equipment.worn(mesh, figure, name="torus", to="lower_thorax", side="left", height=WAIST, color=CLOTH),)


NOTHING = "nothing"
"""In place of equipment: nothing is worn."""

READY: dict[str, Callable[[Figure], tuple[Equipment, ...]]] = {
    "side_sphere": side_sphere,
    "pouches": pouches,
    "vest_plate": vest_plate,
    "pack": pack,
    "torus": torus,
}


def equipment(name: str, figure: Figure) -> tuple[Equipment, ...]:
    """Ready-made equipment, at its place on a person.

    Args:
        name: "side_sphere", "pouches", "vest_plate", "pack" or "torus".
        figure: the person or avatar that wears it.

    Raises:
        UnknownNameError: there is no such equipment.
        InputError: not a person.
    """
    known(name, READY, "equipment", "equipment")
    instance(figure, Figure, "equipment: figure", "load one with wb.load('human')")
    if not set(CARRIERS) <= set(figure.segments):
        raise InputError(
            f"equipment {name!r} fits a person, and {figure.name!r} lacks {', '.join(CARRIERS)}; "
            "put it on with wb.motion.Equipment(name, shape, to=..., at=...)"
        )
    return READY[name](figure)


Worn = str | Equipment | tuple["str | Equipment", ...]
"""What is worn: "nothing"; names of equipment, joined by "+"; the path of a mesh, which is put on the back; equipment;
or several of these."""


def dressed(figure: Figure, worn: Worn) -> Scene:
    """The scene of a figure that wears something; see `put_on`."""
    return put_on(Scene(figure), worn)


def put_on(scene: Scene, worn: Worn) -> Scene:
    """The scene, which is changed, with something attached to its figure.

    Raises:
        UnknownNameError: there is no such equipment.
        WholebodyError: a mesh that cannot be read, or a figure that the equipment does not fit.
    """
    if isinstance(worn, tuple):
        for one in worn:
            put_on(scene, one)
        return scene
    pieces = [worn] if isinstance(worn, Equipment) else list[Equipment]()
    for name in () if isinstance(worn, Equipment) else _names(worn):
        if name not in READY and Path(name).suffix:
            pieces.append(Equipment.worn(Mesh(name), scene.figure, name=Path(name).stem))
        elif name != NOTHING:
            pieces.extend(equipment(name, scene.figure))
    for piece in pieces:
        piece.attach(scene)
    return scene


def label(worn: Worn) -> str:
    """Name of what is worn, for tables and files.

    Raises:
        InputError: it is nothing of these.
    """
    if isinstance(worn, tuple) and worn:
        return "+".join(label(one) for one in worn)
    if isinstance(worn, Equipment):
        return worn.name
    return "+".join(Path(name).stem if Path(name).suffix else name for name in _names(worn))


def _names(worn: object) -> list[str]:
    text = checked_text(worn, "equipment")
    return [text] if is_file(text) else text.split("+")


def torus_mesh(radius: float, tube: float) -> tuple[Array, NDArray[np.int64]]:
    """A torus about z of convex closed sections, as vertices and triangles.

    Args:
        radius: of the circle of centres, metres.
        tube: radius of its cross-section, metres.
    """
    turn = 2.0 * np.pi * np.arange(ROUND) / ROUND
    ring = np.stack([radius + tube * np.cos(turn), np.zeros(ROUND), tube * np.sin(turn)], axis=1)
    sides = [(k, (k + 1) % ROUND) for k in range(ROUND)]
    section = [[a, b + ROUND, b] for a, b in sides] + [[a, a + ROUND, b + ROUND] for a, b in sides]
    section += [[0, k, k + 1] for k in range(1, ROUND - 1)]
    section += [[ROUND, ROUND + k + 1, ROUND + k] for k in range(1, ROUND - 1)]
    vertices, faces = [], []
    for k in range(SECTIONS):
        for angle in (2.0 * np.pi * k / SECTIONS + SLIT, 2.0 * np.pi * (k + 1) / SECTIONS):
            c, s = np.cos(angle), np.sin(angle)
            vertices.append(ring @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))
        faces.append(np.array(section, dtype=np.int64) + 2 * ROUND * k)
    return np.vstack(vertices), np.vstack(faces)
