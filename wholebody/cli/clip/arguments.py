"""What arguments that the commands of `wholebody clip` share stand for: figures, scenes, clips."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.base.errors import FileFormatError, InputError
from wholebody.cli.arguments import person_options
from wholebody.figures import Figure, load
from wholebody.motion.clip import Clip
from wholebody.motion.files.archive import made_with
from wholebody.motion.reading import read_clip, read_skeleton
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.scene.scene import Scene
from wholebody.taskfile import read_task


def figure_of(arguments: argparse.Namespace) -> Figure:
    """Load the figure; where none is stated, the person that the first file was made with."""
    root = {} if arguments.root is None else {"root": arguments.root}
    options = person_options(arguments) | root
    if arguments.figure == "human" and not options:
        first = arguments.files[0] if "files" in arguments else arguments.file
        return made_with(first) or load("human")
    return load(arguments.figure, **options)


def scene_of(arguments: argparse.Namespace) -> Scene:
    """Return the scene of the task file, or the figure alone; raises InputError for a figure beside a task file."""
    if arguments.scene is None:
        return Scene(figure_of(arguments))
    if arguments.figure != "human" or arguments.root is not None or person_options(arguments):
        raise InputError("--scene has a figure of its own; leave out --figure, --to and the options of a person")
    return read_task(arguments.scene).problem.scene


def skeleton_of(path: Path, frames: int) -> SkeletonMotion | None:
    """The skeleton that a file of motion holds; None for a clip, or one of other frames: a figure's own BVH file."""
    try:
        motion = read_skeleton(path)
        return motion if len(motion) == frames else None
    except FileFormatError:
        return None


def clip_of(arguments: argparse.Namespace) -> Clip:
    """Read the clip of the figure, or of the figures of the scene."""
    return read_clip(arguments.file, scene_of(arguments).figure)
