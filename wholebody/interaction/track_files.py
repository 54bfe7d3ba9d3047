"""Tracks as text: one line a frame, one named column a joint, so that what another program recorded can be read."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np

from wholebody.errors import FileFormatError, InputError, UnknownNameError
from wholebody.figures.figure import Figure
from wholebody.interaction.tracks import Track

ROOT_COLUMNS = ("root_x", "root_y", "root_z", "root_qx", "root_qy", "root_qz", "root_qw")
TIME = "time"
EVEN = 1e-3  # share of the time step by which a line may come early or late


def write_track(track: Track, path: str | os.PathLike[str]) -> Path:
    """Write a track as CSV: time in seconds, the seven values of a free root, then the joints in radians.

    Raises:
        InputError: the file cannot be written.
    """
    path = Path(path)
    root = ROOT_COLUMNS if track.q.shape[1] > len(track.joints) else ()
    temporary = path.with_name(f".{path.name}.part")
    try:
        with temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow([TIME, *root, *track.joints])
            for frame, q in enumerate(track.q):
                writer.writerow([repr(frame * track.dt), *map(repr, q.tolist())])
        os.replace(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise InputError(f"{path} cannot be written: {error.strerror}; make the folder first") from None
    return path


def read_track(path: str | os.PathLike[str], figure: Figure) -> Track:
    """Read a track of a figure; its columns may stand in any order.

    Raises:
        FileFormatError: the file cannot be read, a line has another length, a value is no number, or the time step
            changes; the line is named.
        UnknownNameError: a column that is no joint of the figure.
        InputError: joints are missing, or a value is not finite; the frame is named.
    """
    path = Path(path)
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = [line for line in csv.reader(file) if line]
    except (OSError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{path}: cannot be read ({error}); give a CSV file") from None
    if len(lines) < 3:
        raise FileFormatError(f"{path}: a track has a line of names and at least two frames")
    names = [name.strip() for name in lines[0]]
    wanted = [TIME, *(ROOT_COLUMNS if figure.root == "free" else ()), *figure.joints]
    for name in names:
        if name not in wanted:
            raise UnknownNameError("column", name, wanted, f"{path}, line 1")
    missing = [name for name in wanted if name not in names]
    if missing:
        raise InputError(f"{path}, line 1: the columns lack {', '.join(missing[:4])}; {len(missing)} are missing")
    table = np.empty((len(lines) - 1, len(names)))
    for number, line in enumerate(lines[1:], start=2):
        if len(line) != len(names):
            raise FileFormatError(f"{path}, line {number}: {len(line)} values for {len(names)} columns")
        try:
            table[number - 2] = [float(value) for value in line]
        except ValueError as error:
            raise FileFormatError(f"{path}, line {number}: {error}") from None
    order = [names.index(name) for name in wanted]
    time = table[:, order[0]]
    dt = float(time[1] - time[0])
    late = np.flatnonzero(np.abs(np.diff(time) - dt) > EVEN * abs(dt))
    if len(late):
        raise FileFormatError(f"{path}, line {int(late[0]) + 3}: the time step changes; resample to a fixed one")
    track = Track.of(figure, table[:, order[1:]], dt, path.name)
    track.check(figure)
    return track
