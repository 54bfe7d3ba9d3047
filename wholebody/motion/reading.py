"""Reading clips of a figure, whatever the format."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping
from pathlib import Path

from wholebody.base.checks import choice, flag
from wholebody.base.checks import path as checked_path
from wholebody.base.errors import FileFormatError, InputError, one_line
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure
from wholebody.motion.clip import Clip, check_figure
from wholebody.motion.files import FBX, SKELETONS, bvh, columns, gltf_reading, read_frames
from wholebody.motion.files.base import Frames
from wholebody.motion.retargeting import retarget
from wholebody.motion.roles import column_names
from wholebody.motion.skeleton import UNITS, UP, SkeletonMotion


def read_skeleton(path: str | os.PathLike[str], *, unit: str | None = None, up: str | None = None) -> SkeletonMotion:
    """Read a skeleton that moves, in metres with z up.

    Args:
        path: a BVH file, a glTF file (.glb, .gltf), or an archive of AMASS (.npz).
        unit: "metres", "centimetres", "millimetres" or "inches"; recognised by the skeleton's size if left out.
        up: "y" or "z", the axis of the file that points up; if left out recognised by the rest posture, in glTF y.

    Returns:
        The motion; its notes say what was recognised.

    Raises:
        FileFormatError: the file cannot be read, is cut off, has wrong counts, two roots, or values that are no finite
            numbers; the line is named.
        InputError: the path is none, or unit or up is another word.

    Examples:
        >>> motion = wb.motion.read_skeleton(recording)
        >>> motion.dt == clip.dt
        True
    """
    path = checked_path(path, "path")
    if unit is not None:
        choice(unit, UNITS, "read_skeleton: unit")
    if up is not None:
        choice(up, UP, "read_skeleton: up")
    motion = _skeleton(path, unit, up)
    if motion is None:
        other = "is no skeleton; give a BVH or glTF file, or an archive of AMASS (.npz)"
        raise FileFormatError(f"{one_line(path.name)}: {FBX if path.suffix.lower() == '.fbx' else other}")
    _say(motion, path)
    return motion


def read_clip(
    path: str | os.PathLike[str],
    figure: Figure,
    names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None = None,
    *,
    degrees: bool = False,
) -> Clip:
    """Read a clip of a figure; the ending of the file's name says the format.

    Args:
        path: a clip of this figure that `Clip.write` wrote (.npz, .bvh, .glb), a table (.csv), a joint profile (.txt),
            or the motion of another skeleton (.bvh, .glb, .gltf, AMASS .npz), which is retargeted.
        figure: the figure of the postures.
        names: as for `wb.retarget`; of a table, by `columns`, the column of a joint of another name:
            ``{"columns": {"left_knee": "LKnee", "time": "t"}}``.
        degrees: whether joints of a table turn by degrees; a column such as "left_knee [deg]" says so itself.

    Raises:
        FileFormatError: the file cannot be read, is cut off, has wrong counts or values that are no finite numbers, or
            does not fit the figure; the file and, in text files, the line are named.
        UnknownNameError: it has a joint that the figure does not have.
        InputError: the path is none, or the figure is none.

    Examples:
        >>> wb.read_clip(recording, human).dt == clip.dt
        True
    """
    path = checked_path(path, "path")
    check_figure(figure, "read_clip")
    if path.suffix.lower() == ".txt":
        one_figure(figure, f"read_clip: {path.name} holds one figure, and the figure")
    motion: SkeletonMotion | None = None
    degrees = flag(degrees, "read_clip: degrees")
    if path.suffix.lower() == ".csv":
        frames: Frames | None = columns.read(path, figure, column_names(names, figure), degrees=degrees)
    elif path.suffix.lower() in gltf_reading.ENDINGS:
        animated = gltf_reading.Animated(path)
        frames = gltf_reading.own(animated, figure)
        motion = gltf_reading.skeleton_of(animated) if frames is None else None
    else:
        motion = _skeleton(path, None, None)
        frames = read_frames(path, figure) if motion is None else bvh.own(motion, figure)
    if motion is not None and frames is None:
        _say(motion, path)
    try:
        if frames is None:
            assert motion is not None
            return retarget(motion, figure, names=names)
        return Clip(figure, frames.q, frames.dt, frames.name, frames.things)
    except InputError as error:
        raise FileFormatError(f"{one_line(path.name)}: {error}") from None


def _say(motion: SkeletonMotion, path: Path) -> None:
    for note in motion.notes:
        logging.getLogger(__name__).info("%s: %s", one_line(path.name), note)


def _skeleton(path: Path, unit: str | None, up: str | None) -> SkeletonMotion | None:
    """The skeleton of a file; None where the file holds none."""
    read = SKELETONS.get(path.suffix.lower())
    return None if read is None else read(path, unit, up)
