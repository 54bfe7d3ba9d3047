"""Joint profiles: text files of a person's joint angles over time (Degenhardt 2014, appendix).

Comment lines begin with #. The first row is the time step in seconds, the second one the number of frames. Then each
frame has a row: G1 G2 G3, the place of the pelvis; G4 G5 G6, its rotations about its own x, y and z in this order; and
Q1 ... Q49, the joints in the order of the figure, radians. Tabs or spaces separate the values.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wholebody.base.errors import FileFormatError, InputError, one_line
from wholebody.base.files import read_text, title_of
from wholebody.base.files import write as write_file
from wholebody.figures.figure import Figure
from wholebody.motion.clip import ROOT_SIZE
from wholebody.motion.files.base import LARGEST_FILE, Frames, Motion, frame_count, seconds, table
from wholebody.motion.files.nodes import angles_about

GLOBAL = 6  # values of the pelvis: place and rotation


def write(motion: Motion, path: Path) -> Path:
    """Write a clip as a joint profile; its figure has a free root and joints of one degree of freedom."""
    _check_figure(motion.figure)
    angles = np.unwrap(angles_about(Rotation.from_quat(motion.q[:, 3:ROOT_SIZE]), np.eye(3)), axis=0)
    rows = np.hstack([motion.q[:, :3], angles, motion.q[:, ROOT_SIZE:]])
    lines = [
        f"# Joint profiles in rad: {motion.name}",
        "# first row is delta time",
        "# second row is the number of increments",
        "# next row is the initial Q values, followed by the Q values for time 2 and so on",
        f"# joints: {' '.join(motion.figure.joints)}",
        "# " + "\t".join(_names(motion.figure)),
        repr(motion.dt),
        str(len(rows)),
        *("\t".join(f"{value:.9f}" for value in row) for row in rows.tolist()),
    ]
    return write_file(path, "\n".join(lines) + "\n")


def read(path: Path, figure: Figure) -> Frames:
    """Read a joint profile; an error names its line."""
    _check_figure(figure)
    name = one_line(path.name)
    lines = enumerate(read_text(path, "joint profile", LARGEST_FILE).splitlines(), 1)
    rows = [(line, text.split()) for line, text in lines if text.strip() and not text.lstrip().startswith("#")]
    if len(rows) < 3:
        last = rows[-1][0] if rows else 1
        raise FileFormatError(f"{name}, line {last}: the file is cut off; give time step, number of frames and rows")
    words = [" ".join(row) for _, row in rows[:2]]
    dt = seconds(words[0], f"{name}, line {rows[0][0]}")
    count = frame_count(words[1], f"{name}, line {rows[1][0]}")
    frames = rows[2:]
    if len(frames) != count:
        line = frames[-1][0] if len(frames) < count else frames[count][0]
        raise FileFormatError(f"{name}, line {line}: {len(frames)} rows and not {count}; the file is cut off or wrong")
    values = table(name, frames, _names(figure))
    turns = Rotation.from_euler("XYZ", values[:, 3:GLOBAL]).as_quat()
    return Frames(np.hstack([values[:, :3], turns, values[:, GLOBAL:]]), dt, title_of(path))


def _names(figure: Figure) -> list[str]:
    """Names of the values of a row."""
    return [*(f"G{k + 1}" for k in range(GLOBAL)), *(f"Q{k + 1}" for k in range(figure.model.nq - ROOT_SIZE))]


def _check_figure(figure: Figure) -> None:
    """Raises: InputError, unless the figure has a free root and joints of one value each."""
    if figure.root != "free" or figure.model.nq != ROOT_SIZE + len(figure.joints):
        raise InputError(
            f"a joint profile has six values of a free root and one for each joint; {figure.name} has "
            f"{figure.model.nq} values for {len(figure.joints)} joints"
        )
