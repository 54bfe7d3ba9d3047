"""`wholebody clip play`: a motion as a page, a movie or a strip of pictures."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from wholebody.base.checks import whole
from wholebody.base.errors import InputError
from wholebody.base.files import checked_target
from wholebody.cli.clip.arguments import scene_of, skeleton_of
from wholebody.cli.tables import bar
from wholebody.figures.postures import lowest
from wholebody.geometry.shapes import HalfSpace
from wholebody.motion.clip import Clip
from wholebody.motion.reading import read_clip
from wholebody.motion.worn_equipment import put_on
from wholebody.scene.scene import Scene
from wholebody.view import Viewer
from wholebody.view.screenshot import check_movie
from wholebody.view.side_by_side import beside, write_filmstrip

ENDINGS = (".glb", ".htm", ".html", ".mp4", ".gif", ".png")


def run(arguments: argparse.Namespace) -> int:
    """Show or write the motion."""
    out: Path | None = arguments.out
    whole(arguments.pictures, "--pictures", 1, 100)
    if out is not None:
        checked_target(out, "--out", "a clip's picture", ENDINGS, [arguments.file, arguments.ghost, arguments.beside])
        if out.suffix.lower() == ".mp4":
            check_movie(out)
    scene = put_on(scene_of(arguments), arguments.equipment)
    clip = read_clip(arguments.file, scene.figure)
    ghost = None if arguments.ghost is None else read_clip(arguments.ghost, clip.figure)
    if ghost is not None and len(ghost) != len(clip):
        raise InputError(f"--ghost: {arguments.ghost.name} has {len(ghost)} frames and not {len(clip)}")
    if arguments.beside is not None:
        if ghost is not None or (out is not None and out.suffix.lower() == ".png"):
            raise InputError("--beside shows motions side by side, as a page or a movie; leave out --ghost, and .png")
        return _written(_beside(arguments.beside, clip, scene), out)
    if clip.figure.root == "free" and arguments.scene is None:
        floor = min(lowest(clip.figure, q) for q in clip.q)  # recordings do not all have it at 0
        scene.add(HalfSpace(), name="floor", at=(0.0, 0.0, floor))
    with Viewer(scene, title=clip.name) as viewer:
        if clip.figure.root == "free":
            middle = 0.5 * (clip.q[:, :3].min(axis=0) + clip.q[:, :3].max(axis=0))
            away = 1.3 + 0.9 * float(np.ptp(clip.q[:, :2], axis=0).max())
            # direction from the figure to the camera: from in front, from the left and from above
            viewer.look(tuple(middle + away * np.array((1.6, 1.0, 0.5))), tuple(middle))
        if out is not None and out.suffix.lower() == ".png":
            frames = np.linspace(0, len(clip) - 1, min(arguments.pictures, len(clip))).round().astype(int)
            ghosts = None if ghost is None else list(ghost.q[frames])
            print(f"wrote {write_filmstrip(viewer, list(clip.q[frames]), out, ghosts=ghosts)}")
            return 0
        viewer.play(clip, ghost=ghost, repeat=math.inf if out is None else 1)
        return _written(viewer, out)


def _beside(path: Path, clip: Clip, scene: Scene) -> Viewer:
    """Both motions side by side, and on the left the skeleton of the first where its file has one."""
    before = read_clip(path, clip.figure)
    if len(before) != len(clip):
        raise InputError(f"--beside: {path.name} has {len(before)} frames and not {len(clip)}")
    motion = skeleton_of(path, len(clip))
    return beside(motion, {"before": before, "after": clip}, scene, clip.name)


def _written(viewer: Viewer, out: Path | None) -> int:
    """Show what a viewer plays, or write it as a page, glTF or movie."""
    with viewer:
        if out is None:
            viewer.open()
            viewer.wait_until_closed()
        elif out.suffix.lower() in (".glb", ".htm", ".html"):
            print(f"wrote {viewer.save(out)}")
        else:
            with bar(f"drawing {out.name}") as show:  # a share: a movie may have fewer pictures than the clip frames
                written = viewer.movie(
                    out, progress=lambda drawn, total: show(drawn / total, f"picture {drawn} of {total}")
                )
            print(f"wrote {written}")
    return 0
