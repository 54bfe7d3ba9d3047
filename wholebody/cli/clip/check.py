"""`wholebody clip check`: what overlaps in a clip, in its frames and in between; limits, speeds, feet, jerk."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from wholebody.base.batches import run_batch
from wholebody.base.checks import number
from wholebody.base.errors import InputError, WholebodyError
from wholebody.base.files import checked_target, write
from wholebody.base.runner import Job
from wholebody.cli.clip.arguments import scene_of
from wholebody.cli.tables import bar, console, table
from wholebody.motion.checking import DEPTH, LARGEST, SMALLEST, ClipCheck, check
from wholebody.motion.reading import read_clip
from wholebody.motion.worn_equipment import NOTHING, put_on
from wholebody.view.motion_curves import timeline

MOST = 20  # lines of a table
WIDE = 110  # letters that its lines need


def run(arguments: argparse.Namespace) -> int:
    """Check the clip; 1 if it overlaps or is beyond joint limits."""
    depth = DEPTH if arguments.depth is None else 1e-3 * arguments.depth
    if len(arguments.files) * max(1, len(arguments.equipment)) > 1:
        return _many(arguments, depth)
    if arguments.html is not None:
        checked_target(arguments.html, "--html", "a page", (".htm", ".html"))
    (file,), worn = arguments.files, (*arguments.equipment, NOTHING)[0]
    scene = put_on(scene_of(arguments), worn)
    clip = read_clip(file, scene.figure)
    with bar(said := "checking every pair", len(clip)) as tell:
        found = check(clip, scene, depth=depth, progress=lambda done: tell(done, said))
    if arguments.json:
        print(json.dumps(found.as_dict(), indent=1))
    else:
        show(found)
    if arguments.html is not None:
        with Console(stderr=True).status("drawing"):
            page = timeline(found, scene)
        print(f"wrote {write(arguments.html, page)}", file=sys.stderr if arguments.json else sys.stdout)
    return 0 if found.free and not found.limits else 1


def _many(arguments: argparse.Namespace, depth: float) -> int:
    """Each motion with each equipment: one line of a table each; 1 if one overlaps, or cannot be read."""
    if arguments.html is not None:
        raise InputError("--html is for one motion with one equipment; give one file")
    number(1e3 * depth, "--depth", 1e3 * SMALLEST, 1e3 * LARGEST, "mm")
    cases = [(file, worn) for file in arguments.files for worn in arguments.equipment or [NOTHING]]
    for worn in dict.fromkeys(worn for _, worn in cases):
        put_on(scene_of(arguments), worn)  # what does not fit is said before anything is checked
    work = (Job(case, _check_one, (arguments, *case, depth), 0.0) for case in cases)
    found: dict[tuple[Path, str], dict[str, Any]] = {}
    with bar("checking", len(cases)) as tell:
        for outcome in run_batch(work, arguments.at_once, arguments.cluster):
            found[outcome.job.name] = outcome.answer or {"refused": str(outcome.error)}
            tell(len(found), str(outcome.job.name[0].name))
    if arguments.json:
        rows = [{"file": str(file), "equipment": worn, **found[file, worn]} for file, worn in cases]
        print(json.dumps(rows, indent=1))
    else:
        made = table("motion", "wears", "frames", "collide", "dips", "deepest mm", "at any time mm", "jerk rad/s^3")
        made.columns[1].justify = "left"
        stems = [file.stem for file in arguments.files]
        names = {file: file.stem if stems.count(file.stem) == 1 else str(file) for file in arguments.files}
        for file, worn in cases:
            one = found[file, worn]
            told = (
                (
                    f"{one['frames']}", f"{one['frames_in_collision']}", f"{one['dips_between_frames']}",
                    f"{1e3 * one['deepest']:.2f}", f"{1e3 * one['deepest_between']:.2f}", f"{one['jerk']:.0f}",
                )
                if "refused" not in one
                else (f"[red]{escape(one['refused'])}[/]",)
            )  # fmt: skip
            made.add_row(escape(names[file]), escape(worn), *told)
        console(WIDE).print(made)
    return 0 if all(one.get("free") and not one["limits"] for one in found.values()) else 1


def _check_one(arguments: argparse.Namespace, file: Path, worn: str, depth: float) -> dict[str, Any]:
    """Check a motion in a process of its own; what `ClipCheck.as_dict` gives, or why it was refused."""
    try:
        scene = put_on(scene_of(arguments), worn)
        return check(read_clip(file, scene.figure), scene, depth=depth).as_dict()
    except WholebodyError as error:
        return {"refused": str(error)}


def show(found: ClipCheck) -> None:
    """Print the tables."""
    shown, clip = console(WIDE), found.clip
    told = f"[bold]{escape(clip.name)}[/]: {len(clip)} frames, {clip.duration:.3f} s, {escape(clip.figure.name)}"
    shown.print(told, highlight=False)
    kinds = [contact.kind for contact in found.contacts]
    apart = ", ".join(f"{kinds.count(kind)} {name}" for kind, name in KINDS.items() if kind in kinds)
    verdict = "[green]free[/]" if found.free else f"[red]{len(kinds)} pairs overlap[/] ({apart})"
    shown.print(f"{verdict} at a depth of {1e3 * found.tolerance:g} mm\n", highlight=False)
    whole = table("judged", "")
    whole.add_row("frames in contact", f"{found.colliding} of {len(clip)}")
    whole.add_row("dips between free frames", f"{found.dips}")
    whole.add_row("deepest in a frame", f"{1e3 * found.deepest:.3f} mm")
    whole.add_row("deepest at any time", f"{1e3 * found.deepest_between:.3f} mm")
    whole.add_row("jerk, root mean square", f"{found.mean_jerk:.1f} rad/s^3")
    shown.print(whole)
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
        shown.print(made)
    for title, beyond in (("joints beyond limits", found.limits), ("joints faster than limits", found.speeds)):
        if beyond:
            made = table(title, "frames", "worst at s", "value", "limit")
            for worst in beyond[:MOST]:
                numbers = f"{worst.frames}", f"{worst.frame * dt:.3f}", f"{worst.value:.4g}", f"{worst.limit:.4g}"
                made.add_row(escape(worst.joint), *numbers)
            if len(beyond) > MOST:
                made.add_row(f"and {len(beyond) - MOST} more")
            shown.print(made)
    if found.sliding:
        made = table("feet", "frames standing", "slides mm", "farthest at s")
        for point in found.sliding:
            made.add_row(point.frame, f"{point.stands.sum()}", f"{1e3 * point.distance:.2f}", f"{point.at * dt:.3f}")
        shown.print(made)


KINDS = {"self": "of the figure with itself", "equipment": "with what it carries", "thing": "with things around it"}
