"""Arguments that the commands of `wholebody clip` share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wholebody.figures import Figure
    from wholebody.motion.clip import Clip
    from wholebody.scene import Scene


def add_clip(parser: argparse.ArgumentParser) -> None:
    """Add the file of a clip, and the figure that it moves."""
    parser.add_argument("file", type=Path, metavar="FILE", help="the motion")
    figure = parser.add_argument_group("figure")
    figure.add_argument(
        "--figure", default="human", metavar="FIGURE", help="human (default), avatar, hand, or the path of a URDF"
    )
    figure.add_argument("--sex", choices=("male", "female"), help="sex of a person (default: male)")
    figure.add_argument("--stature", type=float, metavar="M", help="height of a person, m (default: median)")
    figure.add_argument("--mass", type=float, metavar="KG", help="mass of a person, kg (default: from the stature)")
    figure.add_argument("--detail", choices=("spheres", "capsules", "hulls"), help="geometry (default: capsules)")


def add_equipment(parser: argparse.ArgumentParser) -> None:
    """Add what the figure wears."""
    parser.add_argument(
        "--equipment", action="append", default=[], metavar="WHAT",
        help="what the body wears: a ready name such as pack, or a mesh that is put on its back; may be repeated",
    )  # fmt: skip


def dressed(scene: Scene, names: Sequence[str]) -> Scene:
    """The scene with equipment attached to its figure.

    Raises:
        WholebodyError: no such equipment, a mesh that cannot be read, or a figure that it does not fit.
    """
    from wholebody.geometry.shapes import Mesh
    from wholebody.motion.equipment import Equipment
    from wholebody.motion.ready_equipment import READY, equipment

    for name in names:
        if name in READY or not Path(name).suffix:
            worn = equipment(name, scene.figure)
        else:
            worn = (Equipment.worn(Mesh(name), scene.figure, name=Path(name).stem),)
        for one in worn:
            one.attach(scene)
    return scene


def figure_of(arguments: argparse.Namespace) -> Figure:
    """Load the figure.

    Raises:
        WholebodyError: there is no such figure.
    """
    from wholebody.figures import load

    given: dict[str, Any] = {name: getattr(arguments, name) for name in ("sex", "stature", "mass", "detail")}
    return load(arguments.figure, **{name: value for name, value in given.items() if value is not None})


def clip_of(arguments: argparse.Namespace) -> Clip:
    """Read the clip of the figure.

    Raises:
        WholebodyError: the file cannot be read, or does not fit the figure.
    """
    from wholebody.motion.reading import read_clip

    return read_clip(arguments.file, figure_of(arguments))
