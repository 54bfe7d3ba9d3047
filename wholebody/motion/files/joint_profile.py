"""Joint profiles: text files of a person's joint angles over time (Degenhardt 2014, appendix).

Comment lines begin with #. The first row is the time step in seconds, the second one the number of frames. Then each
frame has a row: G1 G2 G3, the place of the pelvis; G4 G5 G6, its rotations about its own x, y and z in this order; and
Q1 ... Q49, the joints in the order of the figure, radians. Tabs or spaces separate the values.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wholebody.base.arrays import Array
from wholebody.base.errors import FileFormatError, InputError, one_line
from wholebody.base.files import read_text, title_of
from wholebody.base.files import write as write_file
from wholebody.figures.figure import Figure
from wholebody.motion.files.base import LARGEST_FILE, Frames, Motion, frame_count, seconds, table
from wholebody.motion.files.nodes import angles_about
from wholebody.tracking.tracks import MOST_FRAMES, ROOT_SIZE

GLOBAL = 6  # values of the pelvis: place and rotation


def write(motion: Motion, path: Path) -> Path:
    """Write a clip as a joint profile.

    Raises:
        InputError: the figure has no free root, a joint of several degrees of freedom, or the file cannot be written.
    """
    _check_figure(motion.figure)
    angles = np.unwrap(angles_about(Rotation.from_quat(motion.q[:, 3:ROOT_SIZE]), np.eye(3)), axis=0)
    rows = np.hstack([motion.q[:, :3], angles, motion.q[:, ROOT_SIZE:]])
    joints = motion.q.shape[1] - ROOT_SIZE
    names = [*(f"G{k + 1}" for k in range(GLOBAL)), *(f"Q{k + 1}" for k in range(joints))]
    lines = [
        f"# Joint profiles in rad: {motion.name}",
        "# first row is delta time",
        "# second row is the number of increments",
        "# next row is the initial Q values, followed by the Q values for time 2 and so on",
        f"# joints: {' '.join(motion.figure.joints)}",
        "# " + "\t".join(names),
        repr(motion.dt),
        str(len(rows)),
        *("\t".join(f"{value:.9f}" for value in row) for row in rows.tolist()),
    ]
    return write_file(path, "\n".join(lines) + "\n")


def read(path: Path, figure: Figure) -> Frames:
    """Read a joint profile.

    Raises:
        FileFormatError: the file cannot be read, has no positive time step, another number of rows than it says, or
            another number of values than the figure has; the line is named.
        InputError: the figure has no free root, or a joint of several degrees of freedom.
    """
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
    values = table(name, frames, GLOBAL + figure.model.nq - ROOT_SIZE)
    return Frames(_postures(values), dt, title_of(path))


def sampled(times: Array, curves: Array, figure: Figure, dt: float, name: str = "splines") -> Frames:
    """Frames of joint curves that are given by points: cubic splines through them, with rest at both ends.

    Args:
        times: (k,) seconds, ascending; the first and the last one are the start and the end.
        curves: (k, 6 + joints) values G1 ... G6, Q1 ... at these times.
        figure: the figure.
        dt: seconds from frame to frame.
        name: of the clip.

    Raises:
        InputError: times do not ascend, or shapes do not fit.
    """
    from scipy.interpolate import CubicSpline

    from wholebody.base.checks import array, time_step

    _check_figure(figure)
    times, curves = (
        array(times, "times", "seconds, shape (k,)"),
        array(curves, "curves", "values, shape (k, 6 + joints)"),
    )
    dt = time_step(dt, "dt")
    wide = GLOBAL + figure.model.nq - ROOT_SIZE
    if times.ndim != 1 or len(times) < 2 or not (np.diff(times) > 0.0).all() or not np.isfinite(times).all():
        raise InputError("times are at least two, ascending and finite, seconds")
    if curves.shape != (len(times), wide) or not np.isfinite(curves).all():
        raise InputError(f"curves have shape {curves.shape}; give finite values of shape ({len(times)}, {wide})")
    count = int(np.floor((times[-1] - times[0]) / dt * (1.0 + 1e-12) + 1e-9)) + 1
    if count > MOST_FRAMES:
        raise InputError(f"dt of {dt:g} s makes {count} frames; give a longer one")
    spline = CubicSpline(times, curves, bc_type="clamped")
    return Frames(_postures(spline(times[0] + dt * np.arange(count))), dt, name)


def _postures(values: Array) -> Array:
    turns = Rotation.from_euler("XYZ", values[:, 3:GLOBAL]).as_quat()
    return np.hstack([values[:, :3], turns, values[:, GLOBAL:]])


def _check_figure(figure: Figure) -> None:
    """Raises: InputError, unless the figure has a free root and joints of one value each."""
    if figure.root != "free" or figure.model.nq != ROOT_SIZE + len(figure.joints):
        raise InputError(
            f"a joint profile has six values of a free root and one for each joint; {figure.name} has "
            f"{figure.model.nq} values for {len(figure.joints)} joints"
        )
