"""Arguments that the commands of `wholebody clip` share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.cli.arguments import add_person, person_options
from wholebody.cli.command import Option, option

if TYPE_CHECKING:
    from wholebody.figures import Figure
    from wholebody.motion.clip import Clip
    from wholebody.motion.skeleton import SkeletonMotion
    from wholebody.scene.scene import Scene


def _figure(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("figure")
    group.add_argument(
        "--figure", default="human", metavar="FIGURE", help="human (default), avatar, hand, or the path of a URDF"
    )
    add_person(group)
    group.add_argument(
        "--root", choices=("fixed", "free"), help="of a robot: whether it goes about (default: as its file says)"
    )


SCENE = option("--scene", type=Path, metavar="TASK.toml", help="task file with the figures and their things")

ONE_MOTION: tuple[Option, ...] = (option("file", type=Path, metavar="FILE", help="the motion"), _figure, SCENE)
"""The file of a motion, and the figure or the scene that it moves."""

MOTIONS: tuple[Option, ...] = (option("files", type=Path, nargs="+", metavar="FILE", help="the motions"), _figure)

EQUIPMENT = option(
    "--equipment", action="append", default=[], metavar="WHAT",
    help="what the body wears: a ready name such as pack, names joined by +, or a mesh that is put on its back; "
    "repeated, each in turn",
)  # fmt: skip

PAGE = option("--html", type=Path, metavar="FILE", help="write curves over time and a film beside the recording")


def figure_of(arguments: argparse.Namespace) -> Figure:
    """Load the figure."""
    from wholebody.figures import load

    root = {} if arguments.root is None else {"root": arguments.root}
    return load(arguments.figure, **person_options(arguments), **root)


def scene_of(arguments: argparse.Namespace) -> Scene:
    """Return the scene of the task file, or the figure alone; raises InputError for a figure beside a task file."""
    from wholebody.base.errors import InputError
    from wholebody.scene.scene import Scene

    if arguments.scene is None:
        return Scene(figure_of(arguments))
    from wholebody.taskfile import read_task

    if arguments.figure != "human" or arguments.root is not None or person_options(arguments):
        raise InputError("--scene has a figure of its own; leave out --figure, --to and the options of a person")
    return read_task(arguments.scene).problem.scene


def skeleton_of(path: Path, frames: int) -> SkeletonMotion | None:
    """The skeleton that a file of motion holds; None for a clip, or one of other frames: a figure's own BVH file."""
    from wholebody.base.errors import FileFormatError
    from wholebody.motion.reading import read_skeleton

    try:
        motion = read_skeleton(path)
        return motion if len(motion) == frames else None
    except FileFormatError:
        return None


def clip_of(arguments: argparse.Namespace) -> Clip:
    """Read the clip of the figure, or of the figures of the scene."""
    from wholebody.motion.reading import read_clip

    return read_clip(arguments.file, scene_of(arguments).figure)
