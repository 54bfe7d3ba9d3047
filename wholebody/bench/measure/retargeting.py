"""`wholebody bench files FOLDER --compare`: recordings retargeted by wholebody, and by mink as GMR does it."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.bench.rows import Figure as Value
from wholebody.bench.rows import Row
from wholebody.figures.figure import Figure
from wholebody.geometry.shapes import HalfSpace
from wholebody.motion.checking import check
from wholebody.motion.clip import Clip
from wholebody.motion.footholds import speeds
from wholebody.motion.reading import read_skeleton
from wholebody.motion.retargeting import errors_of, retarget
from wholebody.motion.roles import Roles, matched
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.stance import paths
from wholebody.motion.standing_ground import ground
from wholebody.scene.scene import Scene

TOOLS = ("wholebody", "mink, GMR's weights")
SLOWEST = 60.0  # Hz: recordings of more than twice as many frames a second are thinned out


def compare(folder: Path, figures: Sequence[Figure], frames: int) -> Iterator[Row]:
    """A row for each recording of a folder (BVH), figure and tool; `frames` are the first ones that are followed.

    Raises:
        InputError: there is no recording.
    """
    files = sorted(folder.rglob("*.bvh"))
    if not files:
        raise InputError(f"{folder}: there are no .bvh files; give a folder of recordings")
    for path in files:
        motion = _thinned(read_skeleton(path))
        motion = motion.part(0, min(frames, len(motion)))
        for figure in figures:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # what is not known of a recording is the same for both
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


def _followed(tool: str, motion: SkeletonMotion, figure: Figure, roles: Roles) -> Clip:
    if tool == TOOLS[0]:
        return retarget(motion, figure)
    from wholebody.bench.suite.adapters.mink_retargeting import MinkRetargeting

    follower = MinkRetargeting(motion, figure, roles)
    return Clip(figure, np.array([follower.frame(k) for k in range(len(motion))]), motion.dt, motion.name)


def judged(motion: SkeletonMotion, clip: Clip, roles: Roles) -> dict[str, Value]:
    """Figures of a clip that follows a recording: what `wb.check` finds on a floor, bones, slides, jerk."""
    found = check(clip, Scene(clip.figure).add(HalfSpace(), name="floor"))
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
        figures: dict[str, Value] = {"clips": len(mine), "without overlap in frames": free, **middle}
        figures |= {"deepest mm, median": float(np.median(deep)), "deepest mm, most": float(deep.max())}
        found.append(Row(figure, tool, figures))
    return found


def _figure(row: Row) -> str:
    return row.case.rsplit(", ", 1)[-1]
