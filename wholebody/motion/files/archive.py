"""Clips as npz, without loss: arrays of postures, time step, names of joints."""

from __future__ import annotations

import io
import json
import math
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.errors import FileFormatError, UnknownNameError, WholebodyError, one_line
from wholebody.base.files import LARGEST, read_bytes, title_of
from wholebody.base.files import write as write_file
from wholebody.figures.figure import Figure
from wholebody.figures.loading import load
from wholebody.geometry.placement import steady
from wholebody.motion.clip import MOST_FRAMES, ROOT_SIZE
from wholebody.motion.files.base import Frames, Motion, check_one

VERSION = 1  # of the layout of the arrays
PEOPLE = ("human", "avatar", "hand")  # figures that their options make anywhere


def write(motion: Motion, path: Path) -> Path:
    """Write a clip as npz: `wholebody_clip` (version), `q`, `dt`, `name`, `joints`, `figure`; see `_robot_arrays`.

    `joint_places` (njoints, 3) has where each joint is on the one before it, `loaded_as` how `wb.load` made a person.
    Of things that move it has names, `things` (k,), and placements, `thing_placements` (k, n, 7).
    """
    data = io.BytesIO()
    moving: dict[str, Any] = {}
    if motion.things:
        moving = {"things": np.array(list(motion.things)), "thing_placements": np.array(list(motion.things.values()))}
    np.savez_compressed(
        data,
        wholebody_clip=np.array(VERSION),
        q=motion.q,
        dt=np.array(motion.dt),
        name=np.array(motion.name),
        joints=np.array(motion.figure.joints, dtype=np.str_),
        figure=np.array(motion.figure.name),
        joint_places=_joint_places(motion.figure),
        **_loaded_as(motion.figure),
        **moving,
        **_robot_arrays(motion),
    )
    return write_file(path, data.getvalue())


def _joint_places(figure: Figure) -> NDArray[np.float64]:
    return np.array([place.translation for place in figure.model.jointPlacements])


def _loaded_as(figure: Figure) -> dict[str, Any]:
    """How a person was made; nothing of other figures, or of options that are no plain values."""
    if figure.loaded_as is None or figure.loaded_as[0] not in PEOPLE:
        return {}
    try:
        return {"loaded_as": np.array(json.dumps(figure.loaded_as))}
    except TypeError:
        return {}


def made_with(path: Path) -> Figure | None:
    """The person that a clip was made with; None where the file, of any kind, does not say."""
    try:
        with zipfile.ZipFile(path) as archive, archive.open("loaded_as.npy") as file:
            told = np.lib.format.read_array(file, allow_pickle=False)  # type: ignore[no-untyped-call]
        spec, options = json.loads(str(told))
        return load(spec, **options) if spec in PEOPLE else None
    except (OSError, zipfile.BadZipFile, zlib.error, KeyError, ValueError, TypeError, WholebodyError):
        return None  # `read` says what is wrong with the file


def _robot_arrays(motion: Motion) -> dict[str, Any]:
    """What programs that train robots read; none of people, of robots without a free root or with other joints.

    `root_pos`, `root_rot` (x, y, z, w) and `dof_pos` are those of GMR's files; `joint_pos`, `joint_vel` and the places
    and velocities of bodies in the world (quaternions w, x, y, z) those of BeyondMimic and mjlab. Both have `fps`.
    """
    figure, q, dt = motion.figure, motion.q, motion.dt
    model = figure.model
    if figure.detail != "own" or figure.root != "free" or model.nq != ROOT_SIZE + len(figure.joints):
        return {}
    velocities = motion.velocities()
    names = [name for name in figure.frames if model.frames[figure.frame_id(name)].type == pin.FrameType.BODY]
    places, turns, moves = (np.empty((len(q), len(names), size)) for size in (3, 4, 6))
    data, frames = model.createData(), [figure.frame_id(name) for name in names]
    for k, posture in enumerate(q):
        pin.forwardKinematics(model, data, posture, velocities[k])
        pin.updateFramePlacements(model, data)
        for number, frame in enumerate(frames):
            places[k, number], turns[k, number] = np.split(pin.SE3ToXYZQUAT(data.oMf[frame]), [3])
            moves[k, number] = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED).vector
    return {
        "fps": np.array([1.0 / dt]),
        "root_pos": q[:, :3],
        "root_rot": q[:, 3:ROOT_SIZE],
        "dof_pos": q[:, ROOT_SIZE:],
        "joint_names": np.array(figure.joints, dtype=np.str_),
        "joint_pos": q[:, ROOT_SIZE:],
        "joint_vel": velocities[:, 6:],
        "body_names": np.array(names, dtype=np.str_),
        "body_pos_w": places,
        "body_quat_w": steady(turns)[..., [3, 0, 1, 2]],
        "body_lin_vel_w": moves[..., :3],
        "body_ang_vel_w": moves[..., 3:],
    }


def read(path: Path, figure: Figure) -> Frames:
    """Read a clip that `write` wrote of a figure of the same joints."""
    arrays = read_arrays(path)
    if "wholebody_clip" not in arrays:
        listed = ", ".join(one_line(name, 30) for name in list(arrays)[:6]) or "none"
        raise FileFormatError(f"{path.name}: is no clip of wholebody; its arrays are {listed}")
    missing = [name for name in ("q", "dt", "name", "joints", "joint_places") if name not in arrays]
    if missing:
        raise FileFormatError(f"{path.name}: the arrays lack {', '.join(missing)}; write the clip anew")
    if arrays["wholebody_clip"].tolist() != VERSION:
        version = one_line(str(arrays["wholebody_clip"].tolist()), 20)
        raise FileFormatError(f"{path.name}: its layout is {version}, and {VERSION} is known; update wholebody")
    q, dt, joints = arrays["q"], arrays["dt"], [str(joint) for joint in np.atleast_1d(arrays["joints"])]
    if q.dtype.kind not in "fiu" or q.ndim != 2 or dt.dtype.kind not in "fiu" or dt.shape != ():
        raise FileFormatError(f"{path.name}: q of shape {q.shape} and dt of shape {dt.shape} are no clip")
    _check_joints(path, joints, figure)
    if q.shape[1] != figure.model.nq:
        free = figure.root == "fixed" and q.shape[1] == ROOT_SIZE + figure.model.nq
        mend = "with root='free' (--root free)" if free else "that the clip was made with"
        raise FileFormatError(
            f"{path.name}: {q.shape[1]} values a frame, and {figure.name} has {figure.model.nq}; load the figure {mend}"
        )
    _check_places(path, arrays, figure)
    name = str(arrays["name"])
    name = name if name.strip() and name.isprintable() else title_of(path)
    return Frames(q.astype(np.float64, copy=False), float(dt), name, _things(path, arrays, len(q)))


def _check_places(path: Path, arrays: dict[str, NDArray[np.generic]], figure: Figure) -> None:
    """Refuse a clip of a figure of the same joints and another size: on this one its feet would leave the ground."""
    places, here = arrays["joint_places"], _joint_places(figure)
    if places.dtype.kind != "f" or places.shape != here.shape:
        raise FileFormatError(f"{path.name}: joint_places do not fit the joints; write the clip anew")
    apart = np.linalg.norm(places.astype(np.float64) - here, axis=1)
    if np.all(apart <= 1e-3):  # m; not of NaN
        return
    worst = int(np.argmax(np.nan_to_num(apart, nan=np.inf)))
    told = f", {one_line(str(arrays['loaded_as']), 200)}" if "loaded_as" in arrays else ""
    raise FileFormatError(
        f"{path.name}: is of another size of {figure.name}: {figure.model.names[worst]} is {1e3 * apart[worst]:.0f} mm "
        f"from where it is on this one; load the figure that the clip was made with{told}"
    )


def _things(path: Path, arrays: dict[str, NDArray[np.generic]], frames: int) -> dict[str, NDArray[np.float64]]:
    """Placements (n, 7) of what moves beside the figure."""
    names, placed = arrays.get("things"), arrays.get("thing_placements")
    if names is None and placed is None:
        return {}
    if names is None or placed is None or names.ndim != 1 or placed.shape != (len(names), frames, 7):
        raise FileFormatError(f"{path.name}: things and thing_placements do not fit; write the clip anew")
    if placed.dtype.kind not in "fiu":
        raise FileFormatError(f"{path.name}: thing_placements are no numbers; write the clip anew")
    return dict(zip(map(str, names), placed.astype(np.float64), strict=True))


def _check_joints(path: Path, joints: list[str], figure: Figure) -> None:
    check_one(joints, figure, f"{path.name}: the clip")
    for joint in joints:
        if joint not in figure.joints:
            raise UnknownNameError("joint", joint, figure.joints, path.name)
    if tuple(joints) != figure.joints:
        missing = [joint for joint in figure.joints if joint not in joints]
        what = f"it lacks the joints {', '.join(missing[:4])}" if missing else "its joints are in another order"
        raise FileFormatError(f"{path.name}: {what}; load the figure that the clip was made with")


def read_arrays(path: Path) -> dict[str, NDArray[np.generic]]:
    """All arrays of an npz file, without those of Python objects; the header of one that is too large says so."""
    data = read_bytes(path, "clip")
    arrays: dict[str, NDArray[np.generic]] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > LARGEST:
                raise FileFormatError(f"{path.name}: is larger than {LARGEST / 1e6:g} MB when unpacked")
            for entry in archive.infolist():
                name = entry.filename.removesuffix(".npy")
                with archive.open(entry) as file:
                    if _holds_objects(file, f"{path.name}: {one_line(name, 30)}"):
                        continue
                with archive.open(entry) as file:
                    content = np.lib.format.read_array(file, allow_pickle=False)  # type: ignore[no-untyped-call]
                arrays[name] = content
    except FileFormatError:
        raise
    except (  # what numpy and zipfile raise for a damaged archive
        *(zipfile.BadZipFile, zlib.error, tokenize.TokenError, ValueError, OSError, EOFError, KeyError, SyntaxError),
        *(NotImplementedError, RuntimeError, MemoryError, OverflowError, TypeError),
    ) as error:
        why = one_line(f"{type(error).__name__}: {error}")
        raise FileFormatError(f"{path.name}: is no npz file, or it is cut off or damaged ({why})") from None
    return arrays


def _holds_objects(file: IO[bytes], what: str) -> bool:
    """Whether an array holds Python objects, which are never unpacked; its header says that, and its size."""
    version = np.lib.format.read_magic(file)  # type: ignore[no-untyped-call]
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    header = read(file)  # type: ignore[no-untyped-call]
    shape: tuple[int, ...] = header[0]
    if header[2].hasobject:
        return True
    if shape and shape[0] > MOST_FRAMES:
        raise FileFormatError(f"{what} has {shape[0]} frames; give 1 to {MOST_FRAMES}, or cut the clip into parts")
    size = 8 * math.prod(shape)  # as float64
    if size > LARGEST:
        raise FileFormatError(
            f"{what} has shape {shape}, {size / 1e6:.0f} MB; give at most {LARGEST / 1e6:g} MB, or cut it into parts"
        )
    return False
