"""AMASS archives (npz): poses of SMPL, SMPL-H or SMPL-X as axis-angle; no licensed body model is needed.

The archive has no lengths of bones, because these are the body model's. Those of an average body stand in
place of them; retargeting replaces lengths by the figure's anyway.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wholebody.base.arrays import Array
from wholebody.base.checks import TIME_STEP
from wholebody.base.errors import FileFormatError, InputError, one_line
from wholebody.base.files import packaged_table, title_of
from wholebody.motion.clip import LARGEST, MOST_FRAMES
from wholebody.motion.files.archive import read_arrays
from wholebody.motion.skeleton import UP, SkeletonMotion
from wholebody.motion.structure import stands_along

BODY = 22  # joints whose poses every version has; SMPL's two hands are joints only there

TEMPLATE = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""From the template's axes into those of a body that faces x: z forward to x, x left to y, y up to z."""

PELVIS = {"smpl": (-0.002, -0.223, 0.028), "smplx": (0.003, -0.351, 0.012)}
"""Pelvis of an average body in the template's axes, metres: `trans` moves the origin of these, which turns do not."""


def read_motion(path: Path, unit: str | None = None, up: str | None = None) -> SkeletonMotion | None:
    """Read the body of an AMASS archive, in metres with z up; None of another archive.

    AMASS has z up; archives that others made of videos have y up.
    """
    name, arrays = one_line(path.name), read_arrays(path)
    if "trans" not in arrays or not ("poses" in arrays or {"root_orient", "pose_body"} <= arrays.keys()):
        return None
    if unit not in (None, "metres"):
        raise InputError(f"{name}: an archive of AMASS has metres, not {unit}; leave the unit out")
    poses, places, frequency = _arrays(name, arrays)
    frames = len(poses)
    whole = str(arrays.get("surface_model_type", "")).lower() == "smplx" or poses.shape[1] == 3 * 55
    bones = packaged_table(Path(__file__).parents[1] / "data" / "smpl.csv")
    names = tuple(bone["joint"] for bone in bones)
    offsets = np.array([[float(bone[axis]) for axis in "xyz"] for bone in bones])
    local = np.tile(np.eye(3), (frames, len(names), 1, 1))
    turns = Rotation.from_rotvec(poses[:, : 3 * BODY].reshape(-1, 3)).as_matrix().reshape(frames, BODY, 3, 3)
    # Poses turn the template, whose y is up, into a world whose z is up: the root's rotation holds the change of axes.
    local[:, 0] = turns[:, 0] @ TEMPLATE.T
    local[:, 1:BODY] = TEMPLATE @ turns[:, 1:] @ TEMPLATE.T
    parents = np.array([names.index(bone["parent"]) if bone["parent"] else -1 for bone in bones], dtype=np.intp)
    root, notes = places + PELVIS["smplx" if whole else "smpl"], ["lengths of bones are those of an average body"]
    try:
        made = partial(SkeletonMotion.moved, names, parents, offsets @ TEMPLATE.T, dt=1.0 / frequency)
        if up is None and _stands_along_y(made(local=local, root=root)):
            up, notes = "y", [*notes, "y is up"]
        if up == "y":
            local[:, 0], root = UP["y"] @ local[:, 0], root @ UP["y"].T
        return made(local=local, root=root, name=title_of(path), notes=tuple(notes))
    except InputError as error:
        raise FileFormatError(f"{name}: {error}") from None


def _stands_along_y(motion: SkeletonMotion) -> bool:
    """Whether a person stands along y and does not lie on the floor z = 0, above which joints are 2 to 20 cm, m."""
    lowest = motion.positions[:, :, 2].min(axis=1)
    return stands_along(motion, 1) and not (lowest.min() > 0.02 and lowest.max() < 0.2)


def _arrays(name: str, arrays: dict[str, np.ndarray]) -> tuple[Array, Array, float]:
    """Poses (n, 3 x joints) and places (n, 3) of an archive, and its frame rate, checked; see `read_motion`."""
    rates = ("mocap_framerate", "mocap_frame_rate", "fps")
    rate = next((arrays[key] for key in rates if key in arrays), None)
    if rate is None:
        raise FileFormatError(f"{name}: is no archive of AMASS; it lacks {rates[0]}")
    if "poses" in arrays:
        poses = _numbers(arrays["poses"], f"{name}: poses")
        poses = poses.reshape(len(poses), -1) if poses.ndim == 3 and poses.shape[2] == 3 else poses
    else:
        parts = [_numbers(arrays[part], f"{name}: {part}") for part in ("root_orient", "pose_body")]
        if any(part.ndim != 2 or len(part) != len(parts[0]) for part in parts):
            raise FileFormatError(
                f"{name}: root_orient and pose_body have shapes {parts[0].shape} and {parts[1].shape}; "
                "give (frames, 3) and (frames, 63)"
            )
        poses = np.hstack(parts)
    places = _numbers(arrays["trans"], f"{name}: trans")
    frequency = _numbers(rate, f"{name}: frame rate")
    if frequency.size != 1 or not 1.0 / TIME_STEP[1] <= float(frequency.ravel()[0]) <= 1.0 / TIME_STEP[0]:
        raise FileFormatError(
            f"{name}: the frame rate is {one_line(str(frequency.tolist()), 30)}; "
            f"give one number between {1.0 / TIME_STEP[1]:g} and {1.0 / TIME_STEP[0]:g} frames a second"
        )
    frames = len(poses) if poses.ndim == 2 else 0
    if not 0 < frames <= MOST_FRAMES or poses.shape[1] < 3 * BODY or poses.shape[1] % 3:
        raise FileFormatError(
            f"{name}: poses have shape {poses.shape}; give (frames, 3 x joints), {BODY} joints or more"
        )
    if places.shape != (frames, 3):
        raise FileFormatError(f"{name}: trans has shape {places.shape}; give ({frames}, 3)")
    return poses, places, float(frequency.ravel()[0])


def _numbers(value: np.ndarray, what: str) -> Array:
    if value.dtype.kind not in "fiu":
        raise FileFormatError(f"{what} are no numbers")
    found: Array = value.astype(np.float64)
    if not (np.abs(found) <= LARGEST).all():
        frame = int(np.argwhere(~(np.abs(found) <= LARGEST))[0][0]) if found.ndim else 0
        raise FileFormatError(f"{what} have a value that is not finite or beyond {LARGEST:g} in frame {frame}")
    return found
