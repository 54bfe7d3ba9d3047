"""Reading clips of a figure, whatever the format."""

from __future__ import annotations

import logging
import os

from wholebody.checks import choice
from wholebody.checks import path as checked_path
from wholebody.errors import FileFormatError, InputError, one_line
from wholebody.figures.figure import Figure
from wholebody.motion.clip import Clip
from wholebody.motion.files import read_frames
from wholebody.motion.files.bvh import read_motion
from wholebody.motion.retargeting import retarget
from wholebody.motion.skeleton import UNITS, UP, SkeletonMotion
from wholebody.tracking.tracks import check_figure

SKELETONS = (".bvh",)
"""Endings of files that hold skeletons."""


def read_skeleton(path: str | os.PathLike[str], *, unit: str | None = None, up: str | None = None) -> SkeletonMotion:
    """Read a skeleton that moves, in metres with z up.

    Args:
        path: a BVH file.
        unit: "metres", "centimetres", "millimetres" or "inches"; recognised by the skeleton's size if left out.
        up: "y" or "z", the axis of the file that points up; recognised by the rest posture if left out.

    Returns:
        The motion; its notes say what was recognised.

    Raises:
        FileFormatError: the file cannot be read, is cut off, has wrong counts, two roots, or values that are no finite
            numbers; the line is named.
        MissingPackageError: pybvh is not installed.
    """
    path = checked_path(path, "path")
    if unit is not None:
        choice(unit, UNITS, "read_skeleton: unit")
    if up is not None:
        choice(up, UP, "read_skeleton: up")
    if path.suffix.lower() not in SKELETONS:
        raise FileFormatError(
            f"{one_line(path.name)}: a skeleton is read from {', '.join(SKELETONS)}; give such a file"
        )
    motion = read_motion(path, unit, up)
    for note in motion.notes:
        logging.getLogger(__name__).info("%s: %s", one_line(path.name), note)
    return motion


def read_clip(path: str | os.PathLike[str], figure: Figure) -> Clip:
    """Read a clip of a figure; the ending of the file's name says the format.

    Args:
        path: a file that `Clip.write` wrote (.npz), or a skeleton that moves (.bvh), which is retargeted.
        figure: the figure of the postures.

    Raises:
        FileFormatError: the file cannot be read, is cut off, has wrong counts or values that are no finite numbers, or
            does not fit the figure; the file and, in text files, the line are named.
        UnknownNameError: it has a joint that the figure does not have.
    """
    path = checked_path(path, "path")
    check_figure(figure, "read_clip")
    if path.suffix.lower() in SKELETONS:
        return retarget(read_skeleton(path), figure)
    frames = read_frames(path, check_figure(figure, "read_clip"))
    try:
        return Clip(figure, frames.q, frames.dt, frames.name)
    except InputError as error:
        raise FileFormatError(f"{path.name}: {error}") from None
