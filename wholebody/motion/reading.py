"""Clips of a figure from files, whatever the format, and from placements and angles, such as those of a glove."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array
from wholebody.base.checks import array, choice, flag, known, listed, shown, text, warn
from wholebody.base.checks import path as checked_path
from wholebody.base.checks import posture as checked_posture
from wholebody.base.errors import FileFormatError, InputError, one_line
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure
from wholebody.geometry.placement import placement
from wholebody.motion.clip import ROOT_SIZE, Clip, check_figure
from wholebody.motion.files import OTHERS, SKELETONS, bvh, columns, gltf_reading, read_frames
from wholebody.motion.files.base import Frames
from wholebody.motion.retargeting import retarget
from wholebody.motion.roles import column_names
from wholebody.motion.skeleton import UNITS, UP, SkeletonMotion, longest_way
from wholebody.motion.structure import is_sized, stands_along

JUMP = 10.0  # lengths of a body in a second: twice the fastest sprint


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
        raise FileFormatError(f"{one_line(path.name)}: {OTHERS.get(path.suffix.lower(), other)}")
    _say(motion, path)
    if unit is not None and not is_sized(motion.parents, motion.offsets):
        own = longest_way(motion.parents, motion.offsets)
        warn(
            f"{one_line(path.name)}: in {unit} the person is {own:.3g} m long, along the bones from foot to head; "
            "leave the unit out to have it recognised"
        )
    if up is not None and stands_along(motion, 0 if up == "y" else 1):
        warn(
            f"{one_line(path.name)}: with {up} up the person lies, and with {'z' if up == 'y' else 'y'} up stands on "
            "the ground; leave the axis out to have it recognised"
        )
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
    if motion.dt > 0.25 and len(motion) > 2:  # s: a step takes two frames then, and nothing tells when a foot rests
        warn(
            f"{one_line(path.name)}: its frames are {motion.dt:g} s apart, and speeds are of that; recordings have 20 "
            "or more a second: if it has, correct it with dataclasses.replace(motion, dt=1 / 30)"
        )
    rate = re.search(r"(?<![\d.])(\d{2,3})[ _-]?(fps|hz)", path.stem.lower()) if path.suffix.lower() == ".bvh" else None
    if rate and float(rate[1]) > 0.0 and not 0.8 < float(rate[1]) * motion.dt < 1.25:
        warn(
            f"{one_line(path.name)}: its name says {rate[1]} frames a second, and its frames are {motion.dt:.3g} s "
            f"apart; if the name is right, correct it with dataclasses.replace(motion, dt=1 / {int(rate[1])})"
        )
    steps = np.linalg.norm(np.diff(motion.positions[:, 0], axis=0), axis=1)
    jumps = np.flatnonzero(steps > JUMP * motion.dt * longest_way(motion.parents, motion.offsets))
    if len(jumps) and motion.dt <= 0.25:
        at = int(jumps[0])
        warn(
            f"{one_line(path.name)}: {motion.names[0]} jumps by {steps[at]:.1f} m from frame {at} to the next"
            f"{f', and {len(jumps) - 1} times more' if len(jumps) > 1 else ''}; if recordings were joined there, take "
            f"them apart by motion.part(0, {at + 1}) and motion.part({at + 1}, {len(motion)})"
        )
    for note in motion.notes:
        logging.getLogger(__name__).info("%s: %s", one_line(path.name), note)


def _skeleton(path: Path, unit: str | None, up: str | None) -> SkeletonMotion | None:
    """The skeleton of a file; None where the file holds none."""
    read = SKELETONS.get(path.suffix.lower())
    return None if read is None else read(path, unit, up)


def posed(
    figure: Figure,
    *,
    roots: Sequence[Any] | None = None,
    angles: Mapping[str, ArrayLike] | None = None,
    posture: str | ArrayLike | None = None,
    dt: float,
    name: str = "track",
) -> Clip:
    """The clip of placements of the root and angles by joint name: a hand's placements and a glove's angles.

    Args:
        figure: the figure of the postures.
        roots: n placements of a free root, each as for `Scene.add`; by default that of the posture.
        angles: joint name to n angles, radians, or one for all frames; other joints stay as in the posture.
        posture: (nq,) or a name; the figure's first one if left out.
        dt: seconds from frame to frame.
        name: name of the clip in messages.

    Raises:
        UnknownNameError: a joint that the figure does not have.
        InputError: tracks of different length, a placement that cannot be read (the frame is named), roots for a fixed
            figure.

    Examples:
        >>> track = wb.motion.posed(human, angles={"left_elbow_flexion": [0.0, 0.5, 1.0]}, dt=0.1)
        >>> track.q.shape
        (3, 56)
    """
    check_figure(figure, "posed")
    base = figure.neutral if posture is None else posture
    base = figure.posture(base) if isinstance(base, str) else checked_posture(base, figure.model.nq)
    text(name, "name")
    if not (angles is None or isinstance(angles, Mapping)):
        raise InputError(f"{name}: angles is {shown(angles)}; give angles by joint, such as {{'neck_flexion': [0.5]}}")
    joints = {known(joint, figure.joints, "joint", name): values for joint, values in (angles or {}).items()}
    given = {joint: _angles(values, joint) for joint, values in joints.items()}
    roots = None if roots is None else listed(roots, f"{name}: roots", "placements (x, y, z)")
    if not (roots is None or roots):
        raise InputError(f"{name}: roots is empty; give a placement for each frame, or leave it out")
    frames = _frames(name, roots, given)
    q = np.tile(base, (frames, 1))
    for joint, values in given.items():
        q[:, figure.model.joints[figure.joint_id(joint)].idx_q] = values
    if roots is not None:
        if figure.root != "free":
            what = "is fixed to the world" if figure.root == "fixed" else "are several figures"
            raise InputError(f"{name}: {figure.name} {what}; leave roots out")
        for frame, root in enumerate(roots):
            try:
                q[frame, :ROOT_SIZE] = pin.SE3ToXYZQUAT(placement(root))
            except InputError as error:
                raise InputError(f"{name}: frame {frame}: {error}") from None
    return Clip(figure, q, dt, name)


def _angles(values: object, joint: str) -> Array:
    wanted = "an angle for each frame, radians, or one for all"
    found = np.atleast_1d(array(values, f"angles of {joint!r}", wanted))
    if found.ndim != 1 or not len(found):
        raise InputError(f"angles of {joint!r} have shape {found.shape}; give {wanted}")
    return found


def _frames(name: str, roots: Sequence[Any] | None, angles: Mapping[str, Array]) -> int:
    sizes = {joint: len(values) for joint, values in angles.items() if len(values) != 1}
    if roots is not None:
        sizes["root"] = len(roots)
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{joint} {size}" for joint, size in list(sizes.items())[:5])
        raise InputError(f"{name}: tracks of different length ({listed} frames); cut them to the same")
    return next(iter(sizes.values()), 1)
