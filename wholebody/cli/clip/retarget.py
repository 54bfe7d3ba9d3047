"""`wholebody clip retarget`: the motion of a skeleton for a figure."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.clip.arguments import add_clip, figure_of

DESCRIPTION = """\
Turn the motion of a skeleton (BVH, AMASS) into a clip of a figure of any proportions: directions of limbs as recorded,
within joint limits and reach cones, smooth, standing feet held. The clip may collide with itself: `wholebody clip
check` says where, `wholebody clip avoid` frees it."""
EPILOG = """\
examples:
  wholebody clip retarget walk.bvh walk.npz --sex female --stature 1.62
  wholebody clip retarget walk.bvh robot.npz --figure g1.urdf --names bones.toml"""


def add_to(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    shape = argparse.RawDescriptionHelpFormatter
    parser = commands.add_parser(
        "retarget",
        help="a skeleton's motion for a figure",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=shape,
    )
    add_clip(parser)
    parser.add_argument("out", type=Path, metavar="OUT", help="the file to write: .npz, .bvh, .csv, .txt or .glb")
    parser.add_argument("--names", type=Path, metavar="FILE.toml", help="which bone is which part")
    parser.add_argument("--unit", metavar="UNIT", help="of lengths, such as centimetres (default: recognised)")
    parser.add_argument("--up", choices=("y", "z"), help="the axis that points up (default: recognised)")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Read, retarget and write."""
    from rich.progress import Progress

    from wholebody.files import check_writable
    from wholebody.motion.files import check_ending
    from wholebody.motion.reading import read_skeleton
    from wholebody.motion.retargeting import retarget

    check_writable(check_ending(arguments.out))
    motion = read_skeleton(arguments.file, unit=arguments.unit, up=arguments.up)
    figure = figure_of(arguments)
    with Progress(transient=True) as bar:
        task = bar.add_task("retargeting", total=1.0)
        clip = retarget(motion, figure, arguments.names, progress=lambda share: bar.update(task, completed=share))
    print(f"wrote {clip.write(arguments.out)}: {len(clip)} frames, {clip.duration:.3f} s, of {figure.name}")
    return 0
