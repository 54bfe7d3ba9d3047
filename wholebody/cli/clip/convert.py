"""`wholebody clip convert`: a motion in another format."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import Commands
from wholebody.cli.clip.arguments import add_command, clip_of

DESCRIPTION = """\
Write a motion in another format: .npz (without loss), .bvh, .csv, .txt (joint profile) or .glb (glTF animation).
A skeleton that is not the figure's own is retargeted."""
EPILOG = """\
examples:
  wholebody clip convert walk.npz walk.glb
  wholebody clip convert walk.npz slow.bvh --dt 0.04 --mirror"""


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = add_command(commands, "convert", "write a motion in another format", DESCRIPTION, EPILOG)
    parser.add_argument("out", type=Path, metavar="OUT", help="the file to write")
    parser.add_argument("--dt", type=float, metavar="S", help="seconds from frame to frame (default: as it is)")
    parser.add_argument("--mirror", action="store_true", help="exchange left and right")
    parser.set_defaults(run=run)


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
