"""`wholebody clip convert`: a motion in another format."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.clip.arguments import ONE_MOTION, clip_of
from wholebody.cli.command import command, option


@command(
    "convert",
    "write a motion in another format",
    """\
Write a motion in another format: .npz (without loss), .bvh, .csv, .txt (joint profile) or .glb (glTF animation).
A skeleton that is not the figure's own is retargeted.""",
    *ONE_MOTION,
    option("out", type=Path, metavar="OUT", help="the file to write"),
    option("--dt", type=float, metavar="S", help="seconds from frame to frame (default: as it is)"),
    option("--mirror", action="store_true", help="exchange left and right"),
    epilog="""\
examples:
  wholebody clip convert walk.npz walk.glb
  wholebody clip convert walk.npz slow.bvh --dt 0.04 --mirror""",
)
def run(arguments: argparse.Namespace) -> int:
    """Read, change and write."""
    from wholebody.base.files import check_writable
    from wholebody.motion.files import check_ending

    check_writable(check_ending(arguments.out))
    clip = clip_of(arguments)
    if arguments.dt is not None:
        clip = clip.resampled(arguments.dt)
    if arguments.mirror:
        clip = clip.mirrored()
    print(f"wrote {clip.write(arguments.out)}: {len(clip)} frames, {clip.duration:.3f} s")
    return 0
