"""`wholebody clip avoid`: free a motion of collisions."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.cli.clip.arguments import add_clip, add_equipment, clip_of, dressed

if TYPE_CHECKING:
    from wholebody.motion.avoidance import Avoided
    from wholebody.motion.avoider import Avoider
    from wholebody.motion.strength import Strength

DESCRIPTION = """\
Free a motion of collisions of the body with itself and with what it wears. The answer is judged by all pairs in all
frames and by sweeps between them, independently of the method; the exit code is 1 where something is left."""


def add_to(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = commands.add_parser("avoid", help="free a motion of collisions", description=DESCRIPTION)
    add_clip(parser)
    parser.add_argument("--method", default="trajectory", metavar="NAME", help="how (default: trajectory)")
    add_equipment(parser)
    parser.add_argument("--no-feet", action="store_true", help="let feet slide that stand; without it they are held")
    parser.add_argument(
        "--dynamics",
        action="store_true",
        help="keep torques within the strength of a median person, and the balance within the feet",
    )
    parser.add_argument(
        "--stretch",
        type=float,
        metavar="FACTOR",
        help="slow the motion by up to this factor where joints are too fast or, with --dynamics, too weak",
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="default: <name>-free.npz, beside FILE")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Free the clip, write it, and say what was found."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from wholebody.motion.avoidance import avoid
    from wholebody.scene import Scene

    method = _method(arguments)
    clip = clip_of(arguments)
    scene = dressed(Scene(clip.figure), arguments.equipment)
    console = Console()
    with Progress(TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(), transient=True) as bar:
        task = bar.add_task(clip.name, total=1.0)
        avoided = avoid(
            clip,
            scene,
            method=method,
            hold_feet=not arguments.no_feet,
            dynamics=_strength(arguments),
            progress=lambda told: bar.update(task, completed=told.share, description=told.note),
        )
    out = arguments.out or arguments.file.with_name(f"{arguments.file.stem}-free.npz")
    written = avoided.clip.write(out)
    _tell(console, avoided, written)
    return 0 if avoided.report.solved else 1


def _method(arguments: argparse.Namespace) -> Avoider:
    """The method, which may slow the motion.

    Raises:
        WholebodyError: there is no such method, or it does not slow motions.
    """
    from wholebody.errors import InputError
    from wholebody.motion.avoidance import as_avoider
    from wholebody.motion.trajectory.method import Trajectory

    method = as_avoider(arguments.method)
    if arguments.stretch is None:
        return method
    if not isinstance(method, Trajectory):
        raise InputError(f"--stretch: the method {method.name} does not slow motions; leave out --method")
    return replace(method, stretch=arguments.stretch)


def _strength(arguments: argparse.Namespace) -> bool | Strength:
    """Strength of a person of the sex that was asked for."""
    from wholebody.motion.strength import Strength

    return Strength(sex=arguments.sex or "male") if arguments.dynamics else False


def _tell(console: object, avoided: Avoided, written: Path) -> None:
    from rich.console import Console
    from rich.markup import escape

    from wholebody.cli.tables import table

    assert isinstance(console, Console)
    report, clip = avoided.report, avoided.clip
    color = "green" if report.solved else "red"
    rate = report.seconds / max(clip.duration, clip.dt)
    console.print(f"[{color}]{escape(report.message)}[/]", highlight=False)
    made = table("", "before", "after")
    made.add_row("frames in collision", str(report.before.colliding), str(report.after.colliding))
    made.add_row("deepest in a frame", f"{1e3 * report.before.deepest:.3g} mm", f"{1e3 * report.after.deepest:.3g} mm")
    made.add_row("dips between frames", str(report.before.dips), str(report.after.dips))
    if report.loads is not None:
        was, now = report.loads.before, report.loads.after
        made.add_row("largest torque", f"{was.largest_share:.0%} of strength", f"{now.largest_share:.0%} of strength")
        far = [f"{1e3 * each.outside.max():.0f} mm" for each in (was, now)]
        made.add_row("zero moment point outside of the feet", *far)
    if report.stretch > 1.0:
        made.add_row("duration", f"{report.before.clip.duration:.2f} s", f"{report.duration:.2f} s")
    console.print(made)
    console.print(
        f"{report.method}: {report.seconds:.2f} s, {rate:.2f} s a second of motion; {report.programs} programs, "
        f"{report.posture_solves} postures; {report.frames_changed} of {len(clip)} frames changed",
        highlight=False,
    )
    console.print(f"written: {escape(str(written))}", highlight=False)
