"""`wholebody bench files`: what is read of a folder's files, and recordings retargeted by wholebody and mink."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import FileFormatError, InputError, WholebodyError, one_line
from wholebody.bench.rows import Figure, Row, measured_ms
from wholebody.geometry.gltf import GltfDocument
from wholebody.motion.checking import check
from wholebody.motion.clip import Clip
from wholebody.motion.files import READERS
from wholebody.motion.footholds import speeds
from wholebody.motion.retargeting import errors_of
from wholebody.motion.roles import Roles, matched
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.stance import paths
from wholebody.motion.standing_ground import ground

ROBOTS, MESHES, SKELETONS = (
    (".urdf", ".xml"),
    (".stl", ".obj", ".ply", ".dae", ".glb", ".gltf"),
    (".bvh", ".npz", ".fbx"),
)


def read(folder: Path, frames: int) -> Iterator[Row]:
    """A row for each readable file below a folder; `frames`: largest number of frames of a motion to retarget."""
    human = wb.load("human")
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        ending = path.suffix.lower()
        kind = next((kind for kind in (ROBOTS, MESHES, SKELETONS, tuple(READERS)) if ending in kind), None)
        if kind is None:
            continue

        def work(path: Path = path, kind: tuple[str, ...] = kind) -> dict[str, Figure]:
            return _read(path, kind, human, frames)

        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            spent, _, found = measured_ms(lambda work=work: _answer(work))  # type: ignore[misc]
        said = (
            [str(found["said"])]
            if "said" in found
            else list(dict.fromkeys(one_line(str(w.message), 300) for w in told))
        )
        figures = {name: value for name, value in found.items() if name != "said"}
        yield Row(str(path.relative_to(folder)), "", {**figures, "ms": spent, "said": "; ".join(said)})


def _answer(work: Callable[[], dict[str, Figure]]) -> dict[str, Figure]:
    """Figures of a file, or the sentence by which it is refused; any other error is a fault, and told as one."""
    try:
        return {"read": "yes", **work()}
    except WholebodyError as error:
        return {"read": "refused", "said": one_line(str(error), 300)}
    except Exception as error:
        return {"read": "FAULT", "said": one_line(f"{type(error).__name__}: {error}", 300)}


def _moves(path: Path) -> bool:
    """Whether a file of a kind of meshes is glTF with an animation."""
    return path.suffix.lower() in (".glb", ".gltf") and bool(GltfDocument(path).tree.get("animations"))


def _read(path: Path, kind: tuple[str, ...], human: wb.Figure, frames: int) -> dict[str, Figure]:
    if kind == ROBOTS:
        figure = wb.load(path)
        return {"joints": len(figure.joints), "notes": len(figure.notes)}
    if kind == MESHES and not _moves(path):
        return {"pieces": len(wb.Mesh(path).pieces())}
    try:
        motion = wb.motion.read_skeleton(path) if kind in (SKELETONS, MESHES) else None
    except FileFormatError as error:
        if path.suffix.lower() != ".npz" or "is no skeleton" not in str(error):
            raise
        motion = None
    if motion is None:
        return {"frames": len(wb.read_clip(path, human))}
    size: dict[str, Figure] = {"joints": len(motion.names), "frames": len(motion)}
    part = motion.part(0, min(frames, len(motion)))
    try:
        clip = wb.retarget(part, human)
    except WholebodyError as error:
        return {**size, "said": one_line(str(error), 300)}
    errors = [float(np.degrees(np.median(values))) for values in wb.motion.bone_errors(part, clip).values()]
    return size | ({"bones median deg": float(np.median(errors)), "bones worst deg": max(errors)} if errors else {})


TOOLS = ("wholebody", "mink, GMR's weights")
SLOWEST = 60.0  # Hz: recordings at more than twice this rate are subsampled


def compare(folder: Path, figures: Sequence[wb.Figure], frames: int) -> Iterator[Row]:
    """A row for each recording of a folder (BVH), figure and tool; `frames` are the first ones that are followed.

    Raises:
        InputError: there is no recording.
    """
    files = sorted(folder.rglob("*.bvh"))
    if not files:
        raise InputError(f"{folder}: there are no .bvh files; give a folder of recordings")
    for path in files:
        motion = _thinned(wb.motion.read_skeleton(path))
        motion = motion.part(0, min(frames, len(motion)))
        for figure in figures:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # warnings about a recording are the same for both tools
                roles = matched(motion, figure, None)
                for tool in TOOLS:
                    began = time.process_time()
                    clip = _followed(tool, motion, figure, roles)
                    rate = len(motion) / (time.process_time() - began)
                    yield Row(f"{path.stem}, {figure.name}", tool, judged(motion, clip, roles) | {"frames a s": rate})


def _thinned(motion: SkeletonMotion) -> SkeletonMotion:
    every = max(1, round(1.0 / (motion.dt * SLOWEST)))
    parts = motion.rotations[::every], motion.positions[::every]
    return SkeletonMotion(motion.names, motion.parents, motion.offsets, *parts, motion.dt * every, motion.name)


def _followed(tool: str, motion: SkeletonMotion, figure: wb.Figure, roles: Roles) -> Clip:
    if tool == TOOLS[0]:
        return wb.retarget(motion, figure)
    from wholebody.bench.suite.adapters.mink_retargeting import MinkRetargeting

    follower = MinkRetargeting(motion, figure, roles)
    return Clip(figure, np.array([follower.frame(k) for k in range(len(motion))]), motion.dt, motion.name)


def judged(motion: SkeletonMotion, clip: Clip, roles: Roles) -> dict[str, Figure]:
    """Figures of a clip that follows a recording: findings of `wb.check` on a floor, bones, slides, jerk."""
    found = check(clip, wb.Scene(clip.figure).add(wb.HalfSpace(), name="floor"))
    errors = np.degrees(np.concatenate(list(errors_of(motion, clip, roles).values())))
    shared = [role for role in roles.frames if role in roles.joints]
    ours = paths(clip.figure, clip.q, tuple(roles.frames[role] for role in shared))
    theirs = motion.positions[:, [motion.names.index(roles.joints[role]) for role in shared]]
    rests = ground(motion, {"skeleton": roles.joints}).rests
    slides = [
        speeds(ours[:, shared.index(role)], clip.dt)[mask]
        for role, mask in rests.items()
        if role in shared and role.endswith(("ankle", "toe"))
    ]
    slide = np.concatenate([*slides, np.zeros(0)])
    return {
        "bones median deg": float(np.median(errors)),
        "frames that overlap": f"{found.colliding} of {len(clip)}",
        "deepest mm": 1e3 * max(found.deepest, found.deepest_between),
        "slide mm/s": 1e3 * float(slide.mean()) if len(slide) else float("nan"),
        "jerk": _jerk(ours) / max(_jerk(theirs) * _size(ours) / max(_size(theirs), 1e-9), 1e-9),
    }


def _jerk(places: Array) -> float:
    """Root mean square of the third difference of places (n, p, 3), metres."""
    return float(np.sqrt((np.diff(places, 3, axis=0) ** 2).mean())) if len(places) > 3 else 0.0


def _size(places: Array) -> float:
    """Metres by which points (n, p, 3) are spread, in the middle of the frames."""
    return float(np.median(np.sqrt(((places - places.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean(axis=1))))


def totals(rows: Sequence[Row]) -> list[Row]:
    """A row for each figure and tool over all clips: medians, and the deepest of all."""
    found = []
    for figure, tool in dict.fromkeys((_figure(row), row.tool) for row in rows):
        mine = [row for row in rows if (_figure(row), row.tool) == (figure, tool)]
        free = sum(str(row["frames that overlap"]).startswith("0 ") for row in mine)
        middle = {
            name: float(np.nanmedian([float(row[name]) for row in mine]))
            for name in ("bones median deg", "slide mm/s", "jerk", "frames a s")
        }
        deep = np.array([float(row["deepest mm"]) for row in mine])
        figures: dict[str, Figure] = {"clips": len(mine), "without overlap in frames": free, **middle}
        figures |= {"deepest mm, median": float(np.median(deep)), "deepest mm, most": float(deep.max())}
        found.append(Row(figure, tool, figures))
    return found


def _figure(row: Row) -> str:
    return row.case.rsplit(", ", 1)[-1]
