"""Reading clips of a figure, whatever the format."""

from __future__ import annotations

import os

from wholebody.checks import path as checked_path
from wholebody.errors import FileFormatError, InputError
from wholebody.figures.figure import Figure
from wholebody.motion.clip import Clip
from wholebody.motion.files import read_frames
from wholebody.tracking.tracks import check_figure


def read_clip(path: str | os.PathLike[str], figure: Figure) -> Clip:
    """Read a clip of a figure; the ending of the file's name says the format.

    Args:
        path: a file that `Clip.write` wrote (.npz).
        figure: the figure of the postures.

    Raises:
        FileFormatError: the file cannot be read, is cut off, has wrong counts or values that are no finite numbers, or
            does not fit the figure; the file and, in text files, the line are named.
        UnknownNameError: it has a joint that the figure does not have.
    """
    path = checked_path(path, "path")
    frames = read_frames(path, check_figure(figure, "read_clip"))
    try:
        return Clip(figure, frames.q, frames.dt, frames.name)
    except InputError as error:
        raise FileFormatError(f"{path.name}: {error}") from None
