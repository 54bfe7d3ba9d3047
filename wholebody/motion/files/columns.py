"""Clips as CSV: one line a frame, one named column a joint, in any order, as other programs write recordings."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import TIME_STEP, TIME_STEP_ASKED, is_number, known, warn
from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import read_text, title_of
from wholebody.base.files import write as write_file
from wholebody.figures.figure import Figure
from wholebody.motion.files.base import LARGEST_FILE, Frames, Motion, check_one, table

ROOT_COLUMNS = ("root_x", "root_y", "root_z", "root_qx", "root_qy", "root_qz", "root_qw")
TIME = "time"
UNIT = re.compile(r"\s*[\[(](deg|degrees|°|rad|radians)[\])]$|[\s_](deg|degrees|rad|radians)$", re.IGNORECASE)


def write(motion: Motion, path: Path, *, bare: bool = False) -> Path:
    """Write time, the seven values of a free root, and the joints in radians; turns without limits are angles.

    `bare` leaves out the line of names and the times, as Unitree's LAFAN1 files are. InputError for a joint of several
    degrees of freedom.
    """
    figure, q = motion.figure, motion.q
    if len(figure.joint_values(figure.neutral)) != len(figure.joints):
        raise InputError(f"CSV has one value for each joint, and {figure.name} has joints of several; give .npz")
    if len(q) < 2:
        raise InputError(f"{motion.name}: CSV says the time step by two frames or more; give .npz")
    columns = _columns_of(figure)
    if figure.followers or any(figure.model.joints[figure.joint_id(name)].nq == 2 for name in figure.joints):
        angles = np.unwrap([list(figure.joint_values(each).values()) for each in q], axis=0)
        column = dict(zip(figure.joints, angles.T, strict=True))
        q = np.column_stack([column[name] if at is None else q[:, at] for name, at in columns.items()])
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n" if bare else "\r\n")
    if not bare:
        writer.writerow([TIME, *columns])
    for frame, values in enumerate(q):
        writer.writerow([*([] if bare else [repr(frame * motion.dt)]), *map(repr, values.tolist())])
    return write_file(path, text.getvalue())


def _columns_of(figure: Figure) -> dict[str, int | None]:
    """The columns of a figure in the order of its model: of a free root each with its place in q, and its joints."""
    roots = {joint: name.removesuffix("root") for name, joint in figure.roots.items()}
    found: dict[str, int | None] = {}
    for joint in range(1, figure.model.njoints):
        if joint in roots:
            at = int(figure.model.joints[joint].idx_q)
            found.update({roots[joint] + column: at + k for k, column in enumerate(ROOT_COLUMNS)})
        else:
            found[figure.model.names[joint]] = None
    return found


def read(
    path: Path, figure: Figure, columns: Mapping[str, str] = MappingProxyType({}), *, degrees: bool = False
) -> Frames:
    """Read such a file, of whose joints some may have columns of other names, or degrees.

    The time step is the mean of the file's, whose times may be rounded to the decimals that they have. A column such as
    "left_knee_flexion [deg]" is in degrees. A file without names has the root and the joints in the figure's order, one
    line for each thirtieth of a second, as Unitree's LAFAN1 files have; a warning says so. Joints without a column stay
    as in the neutral posture, and a free root without its seven columns where it is in that posture; a warning names
    them.

    Raises:
        FileFormatError: the file cannot be read, a line has another length, a value is no finite number, or the time
            step changes or is not within `TIME_STEP`; the line is named. No time or no joint has a column, or a root
            has some of its columns.
        UnknownNameError: a column that is no joint of the figure.
    """
    try:
        values, dt = _values(path, figure, columns, degrees)
    except FileFormatError:
        raise
    except InputError as error:
        raise FileFormatError(f"{error}" if path.name in str(error) else f"{path.name}: {error}") from None
    q = np.tile(figure.neutral, (len(values), 1))
    for (name, at), value in zip(_columns_of(figure).items(), values.T, strict=True):
        if at is not None:
            q[:, at] = value
        if at is not None or name in figure.followers:
            continue
        joint = figure.model.joints[figure.joint_id(name)]
        if joint.nq == 2:
            q[:, joint.idx_q], q[:, joint.idx_q + 1] = np.cos(value), np.sin(value)
        else:
            q[:, joint.idx_q] = value
    return Frames(q, dt, title_of(path))


def _values(path: Path, figure: Figure, columns: Mapping[str, str], degrees: bool) -> tuple[Array, float]:
    """The values (n, columns) of `_columns_of` in a table, and its time step; see `read`."""
    resting = figure.joint_values(figure.neutral)
    if len(resting) < len(figure.joints):
        joint = next(joint for joint in figure.joints if joint not in resting)
        raise InputError(
            f"{path.name}: joint {joint!r} of {figure.name} has several values, and a column one; give .npz"
        )
    text = read_text(path, "table", LARGEST_FILE)
    lines = _lines(path, text)
    number, first = next(lines, (1, []))
    columns_of = _columns_of(figure)
    wanted = [TIME, *columns_of]
    own = {column: joint for joint, column in columns.items()}
    given = [name.strip() for name in first]
    first = [own.get(name, name) for name in given]
    if first and all(map(is_number, first)):
        first, lines = _without_names(path, first, wanted, [(number, first), *lines])
    check_one(given, figure, f"{path.name}: the table")
    names = _columns(f"{path.name}, line {number}", first, wanted)
    rows, time = list(lines), names.index(TIME)
    if len(rows) < 2:
        last = rows[-1][0] if rows else number
        raise FileFormatError(
            f"{path.name}, line {last}: a clip has a line of names and at least two frames; the file is cut off"
        )
    found = table(path.name, rows, names)
    given = given if len(given) == len(names) else names  # a file without names has no time either
    units = [_in_degrees(*each, figure, default=degrees) for each in zip(given, names, strict=True)]
    found[:, units] = np.radians(found[:, units])
    dt = _time_step(path, found[:, time], [line for line, _ in rows], max(_decimals(words[time]) for _, words in rows))
    missing = [name for name in wanted if name not in names]
    if missing:
        more = f" and {len(missing) - 4} more" if len(missing) > 4 else ""
        warn(f"{path.name}: no column for {', '.join(missing[:4])}{more}; they stay as in the neutral posture")
    still = [resting[name] if at is None else figure.neutral[at] for name, at in columns_of.items()]
    values = np.tile(still, (len(found), 1))
    for column, name in enumerate(wanted[1:]):
        if name in names:
            values[:, column] = found[:, names.index(name)]
    return values, dt


def _in_degrees(column: str, name: str, figure: Figure, *, default: bool) -> bool:
    """Whether the column of a name is in degrees: as it says itself, and otherwise as others do, if its joint turns."""
    unit = UNIT.search(column) if column != name else None
    if unit is not None:
        return (unit[1] or unit[2]).lower() in ("deg", "degrees", "°")
    turns = name in figure.joints and not figure.model.joints[figure.joint_id(name)].shortname().startswith(
        "JointModelP"
    )
    return default and turns


def _without_names(
    path: Path, first: list[str], wanted: list[str], lines: list[tuple[int, list[str]]]
) -> tuple[list[str], Iterator[tuple[int, list[str]]]]:
    """Names for the columns of a file that has none, and its lines with times; a warning says what was taken."""
    if len(first) != len(wanted) - 1:
        raise FileFormatError(
            f"{path.name}, line {lines[0][0]}: no names of columns, and {len(first)} numbers where the figure has "
            f"{len(wanted) - 1}; write time and the names of joints into the first line"
        )
    warn(
        f"{path.name}: the first line has no names; the columns were taken as {wanted[1]} to {wanted[-1]} in the "
        "figure's order, at 30 frames a second"
    )
    return wanted, ((number, [repr(frame / 30.0), *line]) for frame, (number, line) in enumerate(lines))


def _columns(place: str, first: list[str], wanted: list[str]) -> list[str]:
    """Names of the columns, without their units; see `read`."""
    for mark, what in ((";", "semicolons"), ("\t", "tabs")):
        if len(first) == 1 and mark in first[0]:
            raise FileFormatError(
                f"{place}: the columns are separated by {what}; write commas between them, and points in numbers"
            )
    names = [name if name.strip() in wanted else UNIT.sub("", name.strip()) for name in map(str.strip, first)]
    for name in names:
        known(name, wanted, "column", place)
    twice = [name for name in wanted if names.count(name) > 1]
    if twice:
        raise FileFormatError(f"{place}: the column {twice[0]} occurs twice; leave one out")
    missing = [name for name in wanted if name not in names]
    roots = [
        {name.removesuffix(one) + column for column in ROOT_COLUMNS}
        for name in missing
        if (one := name.rpartition("/")[2]) in ROOT_COLUMNS
    ]
    if TIME in missing:
        lacked = [TIME]
    elif partly := next((root for root in roots if not root.issubset(missing)), None):
        lacked = [name for name in missing if name in partly]
    else:
        lacked = missing if len(missing) == len(wanted) - 1 else []
    if lacked:
        more = f" and {len(lacked) - 4} more" if len(lacked) > 4 else ""
        raise InputError(f"{place}: the columns lack {', '.join(lacked[:4])}{more}; add them")
    return names


def _decimals(time: str) -> int:
    """How many decimals a time has as it is written; as many as a number has with an exponent."""
    return len(time.strip().partition(".")[2]) if "e" not in time.lower() else 17


def _time_step(path: Path, time: Array, places: list[int], decimals: int) -> float:
    """The mean step of times (n,) that are rounded to some decimals."""
    dt = float(time[-1] - time[0]) / (len(time) - 1)
    if not TIME_STEP[0] <= dt <= TIME_STEP[1]:
        raise FileFormatError(f"{path.name}, line {places[1]}: the time step is {dt:g} s; {TIME_STEP_ASKED}")
    steps = np.diff(time)  # a step may differ by a thousandth, and by what rounding both of its times makes
    late = np.flatnonzero(np.abs(steps - np.median(steps)) > 1e-3 * dt + min(1.001 * 10.0**-decimals, 0.4 * dt))
    if len(late):
        place = places[int(late[0]) + 1]
        raise FileFormatError(f"{path.name}, line {place}: the time step changes; resample to a fixed one")
    return dt


def _lines(path: Path, text: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        for line in reader:
            if line:
                yield reader.line_num, line
    except csv.Error as error:
        raise FileFormatError(f"{path.name}, line {reader.line_num}: is not CSV ({error})") from None
