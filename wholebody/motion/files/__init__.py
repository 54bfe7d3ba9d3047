"""Files of clips: the ending of a file's name chooses the format; one module a format."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from pathlib import Path

from wholebody.base.checks import flag, warn
from wholebody.base.checks import path as checked_path
from wholebody.base.errors import FileFormatError, InputError, one_line
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure
from wholebody.motion.files import amass, archive, bvh, columns, gltf, gltf_reading, joint_profile
from wholebody.motion.files.base import Frames, Motion
from wholebody.motion.skeleton import SkeletonMotion

WRITERS: dict[str, Callable[[Motion, Path], Path]] = {
    ".npz": archive.write,
    ".bvh": bvh.write,
    ".csv": columns.write,
    ".txt": joint_profile.write,
    ".glb": gltf.write,
}
"""Ending of a name to the function that writes the format."""

READERS: dict[str, Callable[[Path, Figure], Frames]] = {
    ".npz": archive.read,
    ".csv": columns.read,
    ".txt": joint_profile.read,
}
"""Ending of a name to the function that reads postures of a figure."""

SKELETONS: dict[str, Callable[[Path, str | None, str | None], SkeletonMotion | None]] = {
    ".bvh": bvh.read_motion,
    **dict.fromkeys(gltf_reading.ENDINGS, gltf_reading.read_motion),
    ".npz": amass.read_motion,
}
"""Ending of a name to the function that reads a skeleton, with its unit and axis; None of a file that holds none."""

MARKERS = "holds places of markers and no skeleton; solve it in the program that recorded it, and export BVH"
OTHERS = {
    ".fbx": "FBX is not read; Blender turns it into what is: File > Import > FBX, then File > Export > glTF 2.0 (.glb)",
    ".c3d": MARKERS,
    ".trc": MARKERS,
}
"""Ending of a name to what is said of motion that is not read."""


def write_motion(motion: Motion, path: str | os.PathLike[str], *, bare: bool = False) -> Path:
    """Write a clip in the format that the ending of the file's name says; see `Clip.write`."""
    path = check_ending(path, bare=bare)
    ending = path.suffix.lower()
    if ending == ".txt":
        one_figure(motion.figure, f"{one_line(path.name)} holds one figure, and the clip's figure")
    if ending != ".npz" and motion.things:
        warn(f"{one_line(path.name)} holds postures, without {', '.join(motion.things)}, which move; write .npz")
    return columns.write(motion, path, bare=True) if bare else WRITERS[ending](motion, path)


def check_ending(path: str | os.PathLike[str], *, bare: bool = False) -> Path:
    """The path of a file to write, checked before long work; without names only as CSV."""
    path = checked_path(path, "path")
    ending = _ending(path, WRITERS, "written")
    if flag(bare, "bare") and ending != ".csv":
        raise InputError(f"{one_line(path.name)}: bare numbers are written as CSV; give the name the ending .csv")
    return path


def read_frames(path: str | os.PathLike[str], figure: Figure) -> Frames:
    """Read postures of a figure from a file in the format that the ending of its name says; see `wb.read_clip`."""
    path = checked_path(path, "path")
    return READERS[_ending(path, {*READERS, *SKELETONS}, "read")](path, figure)


def _ending(path: Path, known: Collection[str], done: str) -> str:
    ending = path.suffix.lower()
    if ending in OTHERS and done == "read":
        raise FileFormatError(f"{one_line(path.name)}: {OTHERS[ending]}")
    if ending not in known:
        raise FileFormatError(
            f"{one_line(path.name)}: a clip cannot be {done} as {one_line(ending) or 'a file without ending'}; "
            f"give one of {', '.join(sorted(known))}"
        )
    return ending
