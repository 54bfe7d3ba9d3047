"""`wholebody clip avoid`: free motions of collisions."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from rich.markup import escape

from wholebody.base.errors import InputError, millimetres
from wholebody.base.files import check_writable, checked_target, write
from wholebody.cli.clip.arguments import (
    figure_of,
    scene_of,
    skeleton_of,
)
from wholebody.cli.tables import bar, console, table
from wholebody.figures.strength import Strength
from wholebody.motion.avoidance import as_avoider, avoid
from wholebody.motion.avoider import Avoider, has_setting
from wholebody.motion.batch import BatchProgress, avoid_many
from wholebody.motion.batch_table import AvoidedCase
from wholebody.motion.files import check_ending
from wholebody.motion.judging import Avoided
from wholebody.motion.reading import read_clip
from wholebody.motion.worn_equipment import put_on
from wholebody.view.motion_curves import motion_curves


def run(arguments: argparse.Namespace) -> int:
    """Free the clips, write them, and say what was found."""
    methods, worn = arguments.method or ["trajectory"], arguments.equipment or ["nothing"]
    if len(arguments.files) * len(methods) * len(worn) > 1:
        return _batch(arguments, methods, worn)
    (file,) = arguments.files
    out = check_writable(check_ending(arguments.out or file.with_name(f"{file.stem}-free.npz")), [file])
    if arguments.html is not None:
        checked_target(arguments.html, "--html", "a page", (".htm", ".html"))
        if arguments.stretch is not None:
            raise InputError("--html draws frames of before beside those of after; leave out --stretch")
    method, scene = _method(methods[0], arguments), put_on(scene_of(arguments), worn[0])
    clip = read_clip(file, scene.figure)
    with bar(clip.name) as tell:
        # it goes on: a bar says nothing
        avoided = avoid(clip, scene, method=method, progress=lambda report: bool(tell(report.share, report.note)))
    _tell(avoided, avoided.clip.write(out))
    if arguments.html is not None:
        motion = skeleton_of(file, len(clip))
        before = "before" if motion is None else "retargeted"
        page = motion_curves(motion, {before: clip, "freed": avoided.clip}, scene)
        print(f"wrote {write(arguments.html, page)}")
    return 0 if avoided.report.solved else 1


def _method(name: str, arguments: argparse.Namespace) -> Avoider:
    """The method, which may slow the motion, and keep to the strength of a person of the sex that was asked for."""
    method, settings = as_avoider(name), {}
    if arguments.stretch is not None:
        if not has_setting(method, "stretch"):
            raise InputError(f"--stretch: the method {method.name} does not slow motions; leave out --method")
        settings["stretch"] = arguments.stretch
    if arguments.dynamics:
        if not has_setting(method, "dynamics"):
            raise InputError(f"--dynamics: the method {method.name} does not take dynamics; leave out --method")
        settings["dynamics"] = Strength(sex=arguments.sex)
    return replace(method, **settings) if settings else method  # type: ignore[type-var]


def _tell(avoided: Avoided, written: Path) -> None:
    shown = console()
    report, clip = avoided.report, avoided.clip
    color = "green" if report.solved else "red"
    rate = report.seconds / max(clip.duration, clip.dt)
    shown.print(f"[{color}]{escape(report.message)}[/]", highlight=False)
    made = table("", "before", "after")
    made.add_row("frames in collision", str(report.before.colliding), str(report.after.colliding))
    made.add_row("deepest in a frame", millimetres(report.before.deepest), millimetres(report.after.deepest))
    made.add_row("dips between frames", str(report.before.dips), str(report.after.dips))
    made.add_row("jerk, parts of the original's", "1", f"{report.jerk:.3g}")
    made.add_row("speed, parts of the original's", "1", f"{report.speed:.3g}")
    if report.loads is not None:
        was, now = report.loads.before, report.loads.after
        made.add_row("largest torque", f"{was.largest_share:.0%} of strength", f"{now.largest_share:.0%} of strength")
        far = [f"{1e3 * each.outside.max():.0f} mm" for each in (was, now)]
        made.add_row("zero moment point outside of the feet", *far)
    if report.stretch > 1.0:
        made.add_row("duration", f"{report.before.clip.duration:.2f} s", f"{report.duration:.2f} s")
    shown.print(made)
    print(
        f"{report.method}: {report.seconds:.2f} s, {rate:.2f} s a second of motion; {report.programs} programs, "
        f"{report.posture_solves} postures; {report.frames_changed} of {len(clip)} frames changed\nwritten: {written}"
    )


def _batch(arguments: argparse.Namespace, methods: list[str], worn: list[str]) -> int:
    if arguments.html is not None:
        raise InputError("--html is for one motion with one equipment by one method; give one of each")
    if arguments.scene is not None:
        raise InputError("--scene is for one motion with one equipment by one method; give one of each")
    folder = arguments.out or Path("freed")
    avoiders = [_method(name, arguments) for name in methods]
    count = len(arguments.files) * len(methods) * len(worn)
    try:
        with bar("reading the motions", count) as tell:

            def said(now: BatchProgress) -> None:
                done = "freeing" if now.case is None else f"{now.case.clip}, {now.case.equipment}, {now.case.method}"
                tell(now.done, done)

            rows = avoid_many(
                arguments.files, folder, figure=figure_of(arguments), equipment=worn, methods=avoiders,
                jobs=arguments.at_once, cluster=arguments.cluster, progress=said,
            )  # fmt: skip
    except KeyboardInterrupt:
        print(f"ended; {folder} keeps what is done, and the same command goes on")
        raise
    _table(rows)
    print(f"written: {folder}")
    return 0 if all(row.outcome == "free" for row in rows) else 1


def _table(rows: tuple[AvoidedCase, ...]) -> None:
    made = table(
        "motion", "wears", "method", "", "collide", "after", "dips", "deepest mm", "deviation mm", "s a second"
    )
    for column in made.columns[1:4]:
        column.justify = "left"
    for row in rows:
        color = {"free": "green", "left": "yellow"}.get(row.outcome, "red")
        rate = row.seconds / row.duration if row.duration else 0.0
        numbers = (
            f"{row.colliding_before}", f"{row.colliding}", f"{row.dips}", f"{1e3 * row.deepest_between:.2f}",
            f"{1e3 * row.distance:.1f}", f"{rate:.2f}",
        )  # fmt: skip
        made.add_row(
            escape(row.clip), escape(row.equipment), escape(row.method), f"[{color}]{row.outcome}[/]",
            *(numbers if row.frames else ()),
        )  # fmt: skip
    console(120).print(made)  # letters that a line needs
    for row in rows:
        if row.outcome != "free":
            print(f"{row.clip}, {row.equipment}, {row.method}: {row.message}")
