"""`wholebody clip info`, `convert`, `retarget`: what a file of motion holds, in another format, for a figure."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from rich.markup import escape

from wholebody.base.arrays import Array
from wholebody.base.checks import TIME_STEP, number, shown
from wholebody.base.errors import InputError
from wholebody.base.files import check_writable, checked_target, write
from wholebody.cli.clip.arguments import clip_of, figure_of, scene_of
from wholebody.cli.clip.check import show
from wholebody.cli.tables import bar, console, table
from wholebody.motion.batch import read_many
from wholebody.motion.checking import check
from wholebody.motion.files import check_ending
from wholebody.motion.reading import read_skeleton
from wholebody.motion.retargeting import bone_errors, retarget
from wholebody.tracking.path_following import read_rows
from wholebody.view.motion_curves import motion_curves


def info(arguments: argparse.Namespace) -> int:
    """Describe the clip."""
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


def convert(arguments: argparse.Namespace) -> int:
    """Read, change and write."""
    check_writable(check_ending(arguments.out, bare=arguments.bare), [arguments.file])
    clip = clip_of(arguments)
    if arguments.dt is not None:
        clip = clip.resampled(arguments.dt)
    if arguments.mirror:
        clip = clip.mirrored()
    print(f"wrote {clip.write(arguments.out, bare=arguments.bare)}: {len(clip)} frames, {clip.duration:.3f} s")
    return 0


def retarget_motions(arguments: argparse.Namespace) -> int:
    """Read, retarget and write."""
    _aim(arguments)
    if len(arguments.files) > 1:
        return _many(arguments)
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
    _print_errors(bone_errors(motion, clip, arguments.names, None if arguments.scene is None else scene))
    if arguments.html is not None:
        page = motion_curves(motion, {"retargeted": clip}, scene, arguments.names)
        print(f"wrote {write(arguments.html, page)}")
    if arguments.rate is not None:
        clip = clip.resampled(1.0 / arguments.rate, smooth=True)
    with bar(said := "checking every pair", len(clip)) as tell:
        show(check(clip, scene, progress=lambda done: tell(done, said)))
    written = clip.write(arguments.out, bare=arguments.bare)
    print(f"wrote {written}: {len(clip)} frames, {clip.duration:.3f} s, of {figure.name}")
    return 0


def _tracks(arguments: argparse.Namespace) -> dict[str, Array] | None:
    """Placements (n, 3) or (n, 7) of things by name; raises InputError for one that is not named, or has no scene."""
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
    made = table("bones: degrees from the recording", "median", "of 95 in 100 frames", "greatest")
    for name, values in errors.items():
        half, most, greatest = np.degrees(np.percentile(values, (50, 95, 100)))
        style = "bold red" if half > 15.0 else None
        made.add_row(name, *(f"{value:.1f}" for value in (half, most, greatest)), style=style)
    console().print(made)


def _many(arguments: argparse.Namespace) -> int:
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
