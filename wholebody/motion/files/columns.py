"""Clips as CSV: one line a frame, one named column a joint, in any order."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import title_of
from wholebody.figures.figure import Figure
from wholebody.motion.files.base import Frames, Motion
from wholebody.tracking.track_files import read_values, write_numbers, write_track
from wholebody.tracking.tracks import ROOT_SIZE, Track


def write(motion: Motion, path: Path, *, bare: bool = False) -> Path:
    """Write time, the seven values of a free root, and the joints in radians; turns without limits are angles.

    `bare` leaves out the line of names and the times.

    Raises:
        InputError: a joint has several degrees of freedom, or the file cannot be written.
    """
    figure, q = motion.figure, motion.q
    if len(figure.joint_values(figure.neutral)) != len(figure.joints):
        raise InputError(f"CSV has one value for each joint, and {figure.name} has joints of several; give .npz")
    if len(q) < 2:
        raise InputError(f"{motion.name}: CSV says the time step by two frames or more; give .npz")
    if figure.followers or any(figure.model.joints[figure.joint_id(name)].nq == 2 for name in figure.joints):
        root = q[:, : ROOT_SIZE if figure.root == "free" else 0]
        angles = np.unwrap([list(figure.joint_values(each).values()) for each in q], axis=0)
        q = np.hstack([root, angles])
    track = Track(q, motion.dt, figure.joints, motion.name)
    return write_numbers(track, path) if bare else write_track(track, path)


def read(
    path: Path, figure: Figure, columns: Mapping[str, str] = MappingProxyType({}), *, degrees: bool = False
) -> Frames:
    """Read such a file, of whose joints some may have columns of other names, or degrees; see `read_track`."""
    try:
        values, dt = read_values(path, figure, columns, degrees=degrees)
        root = ROOT_SIZE if figure.root == "free" else 0
        q = np.tile(figure.neutral, (len(values), 1))
        q[:, :root] = values[:, :root]
        for name, value in zip(figure.joints, values[:, root:].T, strict=True):
            joint = figure.model.joints[figure.joint_id(name)]
            if name in figure.followers:
                continue
            if joint.nq == 2:
                q[:, joint.idx_q], q[:, joint.idx_q + 1] = np.cos(value), np.sin(value)
            else:
                q[:, joint.idx_q] = value
    except FileFormatError:
        raise
    except InputError as error:
        raise FileFormatError(f"{error}" if path.name in str(error) else f"{path.name}: {error}") from None
    return Frames(q, dt, title_of(path))
