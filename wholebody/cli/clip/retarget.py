"""`wholebody clip retarget`: the motions of skeletons for a figure."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.clip.arguments import JOBS, MOTIONS, bar, figure_of, jobs_of
from wholebody.cli.command import command, option


@command(
    "retarget",
    "skeletons' motions for a figure",
    """\
Turn the motion of a skeleton (BVH, AMASS) into a clip of a figure of any proportions: directions of limbs as recorded,
within joint limits and reach cones, smooth, standing feet held. The clip may collide with itself: `wholebody clip
check` says where, `wholebody clip avoid` frees it. Several files are written into a folder; what it holds already is
not made again.""",
    *MOTIONS,
    option(
        "out", type=Path, metavar="OUT", help="the file to write: .npz, .bvh, .csv, .txt or .glb; of several a folder"
    ),
    option("--names", type=Path, metavar="FILE.toml", help="which bone is which part"),
    option("--unit", metavar="UNIT", help="of lengths, such as centimetres (default: recognised)"),
    option("--up", choices=("y", "z"), help="the axis that points up (default: recognised)"),
    *JOBS,
    epilog="""\
examples:
  wholebody clip retarget walk.bvh walk.npz --sex female --stature 1.62
  wholebody clip retarget walk.bvh robot.npz --figure g1.urdf --names bones.toml
  wholebody clip retarget walk.bvh run.bvh jump.bvh clips --jobs 4""",
)
def run(arguments: argparse.Namespace) -> int:
    """Read, retarget and write."""
    if len(arguments.files) > 1:
        return _many(arguments)
    from wholebody.base.files import check_writable
    from wholebody.motion.files import check_ending
    from wholebody.motion.reading import read_skeleton
    from wholebody.motion.retargeting import retarget

    check_writable(check_ending(arguments.out))
    motion = read_skeleton(arguments.files[0], unit=arguments.unit, up=arguments.up)
    figure = figure_of(arguments)
    with bar("retargeting") as tell:
        clip = retarget(motion, figure, arguments.names, progress=lambda share: tell(share, "retargeting"))
    print(f"wrote {clip.write(arguments.out)}: {len(clip)} frames, {clip.duration:.3f} s, of {figure.name}")
    return 0


def _many(arguments: argparse.Namespace) -> int:
    from wholebody.base.errors import InputError
    from wholebody.motion.batch import read_many

    for given in ("names", "unit", "up"):
        if getattr(arguments, given) is not None:
            raise InputError(f"--{given} is for one file, and there are {len(arguments.files)}; give one at a time")
    figure, count = figure_of(arguments), len(arguments.files)
    with bar("retargeting", count) as tell:
        found = read_many(
            arguments.files, arguments.out, figure, jobs=jobs_of(arguments), cluster=arguments.cluster,
            progress=lambda done, said: tell(done, said),
        )  # fmt: skip
    for name, made in found.items():
        print(f"wrote {made}" if isinstance(made, Path) else f"{name}: {made}")
    return 0 if all(isinstance(made, Path) for made in found.values()) else 1
