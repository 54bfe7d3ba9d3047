"""`wholebody clip play`: a motion as a page, a movie or a strip of pictures."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.clip.arguments import ONE_MOTION, bar, clip_of
from wholebody.cli.command import command, option

NOTHING = "nothing"
PICTURES = 8
ENDINGS = (".glb", ".htm", ".html", ".mp4", ".gif", ".png")


@command(
    "play",
    "show a motion",
    """\
Show a motion. Without --out a page opens in the browser and plays it; with --out it is written as a page that opens
without a network (.html), as glTF (.glb), a movie (.mp4, .gif) or a strip of pictures (.png). A second motion is its
ghost. With --equipment the body is shown with what it wears.""",
    *ONE_MOTION,
    option("--ghost", type=Path, metavar="FILE", help="another motion of the figure, shown transparent"),
    option(
        "--equipment",
        default=NOTHING,
        metavar="WHAT",
        help="what the body wears: a ready name such as pack, names joined by +, or a mesh that is put on its back",
    ),
    option("--out", type=Path, metavar="OUT", help=".html, .glb, .mp4, .gif or .png"),
    option("--pictures", type=int, default=PICTURES, metavar="N", help="of a strip (default: 8)"),
    epilog="""\
examples:
  wholebody clip play walk.bvh
  wholebody clip play free.npz --ghost walk.npz --out before-after.html
  wholebody clip play walk-free.npz --ghost walk.bvh --equipment pack""",
)
def run(arguments: argparse.Namespace) -> int:
    """Show or write the motion."""
    import math

    import numpy as np

    from wholebody.base.checks import whole
    from wholebody.base.errors import InputError
    from wholebody.base.files import checked_target
    from wholebody.figures.postures import lowest
    from wholebody.geometry.shapes import HalfSpace
    from wholebody.motion.reading import read_clip
    from wholebody.motion.worn_equipment import dressed
    from wholebody.view import Viewer
    from wholebody.view.filmstrip import write_filmstrip

    out: Path | None = arguments.out
    whole(arguments.pictures, "--pictures", 1, 100)
    if out is not None:
        checked_target(out, "--out", "a clip's picture", ENDINGS, [arguments.file, arguments.ghost])
    clip = clip_of(arguments)
    ghost = None if arguments.ghost is None else read_clip(arguments.ghost, clip.figure)
    if ghost is not None and len(ghost) != len(clip):
        raise InputError(f"--ghost: {arguments.ghost.name} has {len(ghost)} frames and not {len(clip)}")
    scene = dressed(clip.figure, arguments.equipment)
    if clip.figure.root == "free":
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
            beside = None if ghost is None else list(ghost.q[frames])
            print(f"wrote {write_filmstrip(viewer, list(clip.q[frames]), out, ghosts=beside)}")
            return 0
        viewer.play(clip, ghost=ghost, repeat=math.inf if out is None else 1)
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
