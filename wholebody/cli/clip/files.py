"""`wholebody clip info`, `convert`, `retarget`: what a file of motion holds, in another format, for a figure."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.cli.arguments import JOBS
from wholebody.cli.clip.arguments import MOTIONS, ONE_MOTION, PAGE, SCENE, clip_of, figure_of, scene_of
from wholebody.cli.command import command, flag, option

if TYPE_CHECKING:
    from wholebody.base.arrays import Array


BARE = flag("--bare", "CSV without names and times, as tools that train robots take it")


@command(
    "info",
    "what a file of motion holds",
    """\
Say what a file of motion holds: figure, frames, time step, duration, and of the joints that move most their range and
greatest speed.""",
    *ONE_MOTION,
)
def info(arguments: argparse.Namespace) -> int:
    """Describe the clip."""
    import numpy as np
    from rich.markup import escape

    from wholebody.cli.tables import console, table

    clip = clip_of(arguments)
    figure = clip.figure
    print(
        f"{clip.name}: {len(clip)} frames at {1.0 / clip.dt:.4g} Hz, {clip.duration:.3f} s, "
        f"{figure.name} with {figure.model.nv} degrees of freedom"
    )
    print(f"frames beyond joint limits: {sum(not figure.within_limits(q, 1e-6) for q in clip.q)}")
    speeds = np.abs(clip.velocities()).max(axis=0)
    values = [figure.joint_values(q) for q in clip.q]
    made = table("joints that move most", "from", "to", "greatest speed")
    ranges = {name: [frame[name] for frame in values] for name in values[0]}
    moving = [name for name in ranges if max(ranges[name]) > min(ranges[name])]
    for name in sorted(moving, key=lambda name: min(ranges[name]) - max(ranges[name]))[:12]:
        slides = figure.model.joints[figure.joint_id(name)].shortname().startswith("JointModelP")
        unit, factor = ("m", 1.0) if slides else ("deg", float(np.degrees(1.0)))
        low, high = (factor * end for end in (min(ranges[name]), max(ranges[name])))
        speed = factor * float(speeds[figure.dofs([name])].max())
        made.add_row(escape(name), f"{low:.4g} {unit}", f"{high:.4g} {unit}", f"{speed:.4g} {unit}/s")
    console().print(made)
    return 0


@command(
    "convert",
    "write a motion in another format",
    """\
Write a motion in another format: .npz (without loss), .bvh, .csv, .txt (joint profile) or .glb (glTF animation).
A skeleton that is not the figure's own is retargeted.""",
    *ONE_MOTION,
    option("out", type=Path, metavar="OUT", help="the file to write"),
    option("--dt", type=float, metavar="S", help="seconds from frame to frame (default: as it is)"),
    BARE,
    flag("--mirror", "exchange left and right"),
    epilog="""\
examples:
  wholebody clip convert walk.npz walk.glb
  wholebody clip convert walk.npz slow.bvh --dt 0.04 --mirror""",
)
def convert(arguments: argparse.Namespace) -> int:
    """Read, change and write."""
    from wholebody.base.files import check_writable
    from wholebody.motion.files import check_ending

    check_writable(check_ending(arguments.out, bare=arguments.bare), [arguments.file])
    clip = clip_of(arguments)
    if arguments.dt is not None:
        clip = clip.resampled(arguments.dt)
    if arguments.mirror:
        clip = clip.mirrored()
    print(f"wrote {clip.write(arguments.out, bare=arguments.bare)}: {len(clip)} frames, {clip.duration:.3f} s")
    return 0


@command(
    "retarget",
    "skeletons' motions for a figure",
    """\
Turn the motion of a skeleton (BVH, glTF, AMASS) into a clip of a figure of any proportions. Limbs keep the recorded
directions, within joint limits, speed limits and reach cones. Points that rest are held on the ground, and no frame
overlaps itself or the floor. A table has the errors of bones; `wholebody clip check` tests the motion between frames. A
robot's .npz has the arrays that mjlab, BeyondMimic and GMR name. Several files are written into a folder; those that
it holds are not made again.""",
    *MOTIONS,
    option("--to", metavar="FIGURE", help="another name of --figure; a robot goes about freely"),
    option("--out", type=Path, metavar="OUT", help=".npz, .bvh, .csv, .txt or .glb; of several motions a folder"),
    option("--rate", type=float, metavar="HZ", help="frames a second that are written (default: as recorded)"),
    BARE,
    option("--names", type=Path, metavar="FILE.toml", help="which bone is which part"),
    option(
        "--ground", choices=("auto", "none"), default="auto", help="find where feet rest, or follow the skeleton alone"
    ),
    SCENE,
    option(
        "--track",
        action="append",
        default=[],
        metavar="THING=FILE",
        help="where a thing of the scene is in each frame: a line of x y z, or x y z qx qy qz qw; repeated for others",
    ),
    option("--unit", metavar="UNIT", help="of lengths, such as centimetres (default: recognised)"),
    option("--up", choices=("y", "z"), help="the axis that points up (default: recognised)"),
    PAGE,
    *JOBS,
    epilog="""\
examples:
  wholebody clip retarget walk.bvh --out walk.npz --sex female --stature 1.62
  wholebody clip retarget walk.bvh --to g1.urdf --ground auto --out walk.npz
  wholebody clip retarget walk.bvh --to g1.urdf --rate 50 --bare --out walk.csv --html walk.html
  wholebody clip retarget lift.bvh --scene room.toml --track box=box.csv --out lift.npz
  wholebody clip retarget walk.bvh run.bvh jump.bvh --out clips --jobs 4""",
)
def retarget_motions(arguments: argparse.Namespace) -> int:
    """Read, retarget and write."""
    _aim(arguments)
    if len(arguments.files) > 1:
        return _many(arguments)
    from wholebody.base.files import check_writable, checked_target, write
    from wholebody.cli.tables import bar
    from wholebody.motion.files import check_ending
    from wholebody.motion.reading import read_skeleton
    from wholebody.motion.retargeting import bone_errors, retarget

    check_writable(check_ending(arguments.out, bare=arguments.bare), arguments.files)
    if arguments.html is not None:
        checked_target(arguments.html, "--html", "a page", (".htm", ".html"), arguments.files)
    motion = read_skeleton(arguments.files[0], unit=arguments.unit, up=arguments.up)
    scene, tracks = scene_of(arguments), _tracks(arguments)
    figure = scene.figure
    with bar("retargeting") as tell:
        clip = retarget(
            motion, figure, None if arguments.scene is None else scene,
            None if arguments.ground == "none" else "auto", things=tracks, names=arguments.names,
            progress=lambda share: tell(share, "retargeting"),
        )  # fmt: skip
    _print_errors(bone_errors(motion, clip, arguments.names))
    if arguments.html is not None:
        from wholebody.view.motion_curves import motion_curves

        page = motion_curves(motion, {"retargeted": clip}, scene, arguments.names)
        print(f"wrote {write(arguments.html, page)}")
    if arguments.rate is not None:
        clip = clip.resampled(1.0 / arguments.rate)
    written = clip.write(arguments.out, bare=arguments.bare)
    print(f"wrote {written}: {len(clip)} frames, {clip.duration:.3f} s, of {figure.name}")
    return 0


def _tracks(arguments: argparse.Namespace) -> dict[str, Array] | None:
    """Placements (n, 3) or (n, 7) of things by name; raises InputError for one that is not named, or has no scene."""
    from wholebody.base.checks import shown
    from wholebody.base.errors import InputError
    from wholebody.tracking.path_following import read_rows

    found = {}
    for given in arguments.track:
        name, _, file = given.partition("=")
        if not (name and file):
            raise InputError(f"--track is {shown(given)}; give THING=FILE, such as box=box.csv")
        if arguments.scene is None:
            raise InputError(f"--track {name}: there is no scene with such a thing; give --scene TASK.toml")
        if name in found:
            raise InputError(f"--track {name}: it is given twice; give one file a thing")
        found[name] = read_rows(Path(file), (3, 7), "x y z in metres, or x y z qx qy qz qw")
    return found or None


def _aim(arguments: argparse.Namespace) -> None:
    """Check where the motion goes, and make --to the figure; raises InputError for what does not go together."""
    from wholebody.base.checks import TIME_STEP, number
    from wholebody.base.errors import InputError

    if arguments.out is None:
        raise InputError("there is no file to write; name it with --out")
    if arguments.rate is not None:
        number(arguments.rate, "--rate", 1.0 / TIME_STEP[1], 1.0 / TIME_STEP[0], "Hz")
    if arguments.to is None:
        return
    if arguments.figure != "human":
        raise InputError("--to and --figure are one and the same; give one of them")
    arguments.figure = arguments.to
    if arguments.root is None and Path(arguments.to).suffix:
        arguments.root = "free"


def _print_errors(errors: Mapping[str, Array]) -> None:
    """Print how far the directions of bones are from the recording's; those beyond 15 degrees stand out."""
    import numpy as np

    from wholebody.cli.tables import console, table

    made = table("bones: degrees from the recording", "median", "of 95 in 100 frames", "greatest")
    for name, values in errors.items():
        half, most, greatest = np.degrees(np.percentile(values, (50, 95, 100)))
        style = "bold red" if half > 15.0 else None
        made.add_row(name, *(f"{value:.1f}" for value in (half, most, greatest)), style=style)
    console().print(made)


def _many(arguments: argparse.Namespace) -> int:
    from wholebody.base.errors import InputError
    from wholebody.cli.tables import bar
    from wholebody.motion.batch import read_many

    for given in ("names", "ground", "scene", "track", "unit", "up", "rate", "bare", "html"):
        if getattr(arguments, given) not in (None, False, "auto", []):
            raise InputError(f"--{given} is for one file, and there are {len(arguments.files)}; give one at a time")
    figure, count = figure_of(arguments), len(arguments.files)
    with bar("retargeting", count) as tell:
        found = read_many(
            arguments.files, arguments.out, figure, jobs=arguments.at_once, cluster=arguments.cluster,
            progress=lambda done, said: tell(done, said),
        )  # fmt: skip
    for name, made in found.items():
        print(f"wrote {made}" if isinstance(made, Path) else f"{name}: {made}")
    return 0 if all(isinstance(made, Path) for made in found.values()) else 1
