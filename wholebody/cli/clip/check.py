"""`wholebody clip check`: what overlaps in a clip, in its frames and in between; limits, speeds, feet, jerk."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.cli.clip.arguments import add_clip, add_equipment, dressed, figure_of

if TYPE_CHECKING:
    from rich.console import Console

    from wholebody.motion.checking import ClipCheck
    from wholebody.motion.clip import Clip
    from wholebody.scene import Scene

DESCRIPTION = """\
Check a motion: every pair of pieces that can touch, in every frame and in the motion from each frame to the next one;
joint limits, joint speeds, feet that slide while they stand, jerk. Overlaps of the figure with itself, with what it
carries and with the things around it are told apart."""
EPILOG = """\
examples:
  wholebody clip check walk.bvh
  wholebody clip check walk.bvh --equipment pack --html walk.html
  wholebody clip check walk.npz --scene room.toml
  wholebody clip check walk.npz --json > walk.json
exit code: 1 if something overlaps by more than the depth, or a joint is beyond its limit"""
MOST = 20  # lines of a table
WIDE = 110  # letters that its lines need


def add_to(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    shape = argparse.RawDescriptionHelpFormatter
    parser = commands.add_parser(
        "check", help="what overlaps in a motion, when and how deep", description=DESCRIPTION, epilog=EPILOG,
        formatter_class=shape,
    )  # fmt: skip
    add_clip(parser)
    add_equipment(parser)
    parser.add_argument("--scene", type=Path, metavar="TASK.toml", help="task file with the figure and its things")
    parser.add_argument("--depth", type=float, metavar="MM", help="deepest overlap that is no contact (default: 0.1)")
    parser.add_argument("--json", action="store_true", help="print everything as JSON instead of tables")
    parser.add_argument(
        "--html", type=Path, metavar="FILE", help="write a timeline to look at; opens without a network"
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Check the clip; 1 if it overlaps or is beyond joint limits."""
    import json

    from rich.console import Console

    from wholebody.files import check_writable, write
    from wholebody.motion.checking import DEPTH
    from wholebody.motion.reading import read_clip

    if arguments.html is not None:
        check_writable(arguments.html)
    scene = dressed(_scene(arguments), arguments.equipment)
    clip = read_clip(arguments.file, scene.figure)
    found = checked(clip, scene, DEPTH if arguments.depth is None else 1e-3 * arguments.depth)
    if arguments.json:
        print(json.dumps(found.as_dict(), indent=1))
    else:
        show(Console(width=max(WIDE, Console().width)), found)
    notes = Console(stderr=arguments.json)
    if arguments.html is not None:
        from wholebody.view.timeline import timeline

        with Console(stderr=True).status("drawing"):
            page = timeline(found, scene)
        notes.print(f"wrote {write(arguments.html, page)}", highlight=False, soft_wrap=True, markup=False)
    return 0 if found.free and not found.limits else 1


def _scene(arguments: argparse.Namespace) -> Scene:
    from wholebody.scene import Scene

    if arguments.scene is None:
        return Scene(figure_of(arguments))
    from wholebody.taskfile import read_task

    return read_task(arguments.scene).problem.scene


def checked(clip: Clip, scene: Scene, depth: float) -> ClipCheck:
    """Check, with a progress bar."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from wholebody.motion.checking import check

    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True, refresh_per_second=4) as bar:
        work = bar.add_task("checking every pair", total=len(clip))
        return check(clip, scene, depth=depth, progress=lambda done: bar.update(work, completed=done))


def show(console: Console, found: ClipCheck) -> None:
    """Print the tables."""
    from rich.markup import escape

    from wholebody.cli.tables import table

    clip = found.clip
    told = f"[bold]{escape(clip.name)}[/]: {len(clip)} frames, {clip.duration:.3f} s, {escape(clip.figure.name)}"
    console.print(told, highlight=False)
    kinds = [contact.kind for contact in found.contacts]
    apart = ", ".join(f"{kinds.count(kind)} {name}" for kind, name in KINDS.items() if kind in kinds)
    verdict = "[green]free[/]" if found.free else f"[red]{len(kinds)} pairs overlap[/] ({apart})"
    console.print(f"{verdict} at a depth of {1e3 * found.tolerance:g} mm\n", highlight=False)
    whole = table("judged", "")
    whole.add_row("frames in contact", f"{found.colliding} of {len(clip)}")
    whole.add_row("dips between free frames", f"{found.dips}")
    whole.add_row("deepest in a frame", f"{1e3 * found.deepest:.3f} mm")
    whole.add_row("deepest at any time", f"{1e3 * found.deepest_between:.3f} mm")
    whole.add_row("jerk, root mean square", f"{found.mean_jerk:.1f} rad/s^3")
    console.print(whole)
    dt = clip.dt
    if found.contacts:
        made = table("contacts", "with", "kind", "frames", "starts at s", "deepest mm", "at s", "longest s")
        made.columns[1].justify = "left"
        for each in found.contacts[:MOST]:
            at = f"{each.deepest_frame * dt:.3f}" + ("+" if each.deepest_between else "")
            long = f"{(each.longest[1] - each.longest[0]) * dt:.3f}"
            row = each.kind, f"{each.frames}", f"{each.start * dt:.3f}", f"{1e3 * each.deepest:.2f}", at, long
            made.add_row(escape(each.first), escape(each.second), *row)
        if len(found.contacts) > MOST:
            made.add_row(f"and {len(found.contacts) - MOST} more")
        console.print(made)
    for title, beyond in (("joints beyond limits", found.limits), ("joints faster than limits", found.speeds)):
        if beyond:
            made = table(title, "frames", "worst at s", "value", "limit")
            for worst in beyond[:MOST]:
                numbers = f"{worst.frames}", f"{worst.frame * dt:.3f}", f"{worst.value:.4g}", f"{worst.limit:.4g}"
                made.add_row(escape(worst.joint), *numbers)
            if len(beyond) > MOST:
                made.add_row(f"and {len(beyond) - MOST} more")
            console.print(made)
    if found.sliding:
        made = table("feet", "frames standing", "slides mm", "farthest at s")
        for point in found.sliding:
            made.add_row(point.frame, f"{point.stands.sum()}", f"{1e3 * point.distance:.2f}", f"{point.at * dt:.3f}")
        console.print(made)


KINDS = {"self": "of the figure with itself", "equipment": "with what it carries", "thing": "with things around it"}
