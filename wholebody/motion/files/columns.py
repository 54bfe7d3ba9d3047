"""Clips as CSV: one line a frame, one named column a joint, in any order."""

from __future__ import annotations

from pathlib import Path

from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import title_of
from wholebody.figures.figure import Figure
from wholebody.motion.files.base import Frames, Motion
from wholebody.tracking.track_files import read_track, write_track
from wholebody.tracking.tracks import ROOT_SIZE, Track


def write(motion: Motion, path: Path) -> Path:
    """Write time, the seven values of a free root, and the joints in radians.

    Raises:
        InputError: a joint has several values, or the file cannot be written.
    """
    values = motion.q.shape[1] - (ROOT_SIZE if motion.figure.root == "free" else 0)
    if values != len(motion.figure.joints):
        raise InputError(f"CSV has one value for each joint, and {motion.figure.name} has joints of several; give .npz")
    if len(motion.q) < 2:
        raise InputError(f"{motion.name}: CSV says the time step by two frames or more; give .npz")
    return write_track(Track(motion.q, motion.dt, motion.figure.joints, motion.name), path)


def read(path: Path, figure: Figure) -> Frames:
    """Read such a file; see `read_track`."""
    try:
        track = read_track(path, figure)
    except FileFormatError:
        raise
    except InputError as error:
        raise FileFormatError(f"{error}" if path.name in str(error) else f"{path.name}: {error}") from None
    return Frames(track.q, track.dt, title_of(path))
