"""What is read of a folder's files."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

import wholebody as wb
from wholebody.base.errors import FileFormatError, WholebodyError, one_line
from wholebody.bench.rows import Figure, Row, measured_ms
from wholebody.geometry.gltf import GltfDocument
from wholebody.motion.files import READERS

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

        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            spent, _, found = measured_ms(lambda work=work: _answer(work))  # type: ignore[misc]
        said = (
            [str(found["said"])]
            if "said" in found
            else list(dict.fromkeys(one_line(str(w.message), 300) for w in caught))
        )
        figures = {name: value for name, value in found.items() if name != "said"}
        yield Row(str(path.relative_to(folder)), "", {**figures, "ms": spent, "said": "; ".join(said)})


def _answer(work: Callable[[], dict[str, Figure]]) -> dict[str, Figure]:
    """Figures of a file, or the sentence by which it is refused; any other error is a fault, and reported as one."""
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
