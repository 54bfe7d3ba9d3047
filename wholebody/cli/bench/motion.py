"""`wholebody bench motion`: clips freed of collisions by each method."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import Chart, check_count, measuring, publish

CAPTION = "Deviation, jerk and sliding against seconds for each second of motion; hollow: not free; dotted: asked"
CAPTION_OF_CHECKS = "CPU time of a check of each clip with each piece of equipment; black: as it is, coloured: freed"


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "motion",
        help="clips freed of collisions by each method, with each piece of equipment",
        description="Free clips of collisions by each method, with each piece of equipment, and judge every frame and "
        "every motion between frames; clips that need no recordings, and the recordings of a folder. Each case runs in "
        "a process of its own. A run that was ended goes on where its folder holds what was measured.",
    )
    parser.add_argument(
        "--clips", type=Path, metavar="DIR", help="folder of recordings (BVH), beside the built-in clips"
    )
    parser.add_argument("--only", nargs="+", metavar="CLIP", help="names of clips (default: all)")
    parser.add_argument("--equipment", nargs="+", metavar="NAME", help="what is worn (default: all)")
    parser.add_argument("--methods", nargs="+", metavar="NAME", help="methods, and check (default: all)")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="cases at a time (default: 1)")
    parser.add_argument(
        "--figures", action="store_true", help="redraw figures 4.1 to 4.7 of Degenhardt's thesis instead; needs --clips"
    )


def run(arguments: argparse.Namespace) -> int:
    """Measure, or go on; --quick takes two clips with two pieces of equipment."""
    from wholebody.bench.machine import machine
    from wholebody.bench.motion import cases, measuring, report
    from wholebody.motion.avoidance import METHODS

    check_count(arguments.jobs, "--jobs")
    if arguments.figures:
        return _figures(arguments)
    recordings = {path.stem: path for path in cases.recordings(arguments.clips)}
    known: dict[str, Path | None] = {**dict.fromkeys(cases.SYNTHETIC), **recordings}
    names = cases.chosen(arguments.only, tuple(known), "--only")
    worn = cases.chosen(arguments.equipment, cases.EQUIPMENT, "--equipment")
    ways = cases.chosen(arguments.methods, (measuring.CHECKED, *METHODS), "--methods")
    if arguments.quick:
        names, worn = names[:2], worn[:2]
    facts = machine()
    rows = measuring.run(
        {name: known[name] for name in names}, worn, ways, arguments.out, facts, arguments.jobs, _tell
    )  # fmt: skip
    charts = {}
    if any(row.measured and row.method != measuring.CHECKED for row in rows):
        charts["motion"] = Chart(partial(report.chart, rows), CAPTION)
    if any(row.measured for row in rows):
        charts["motion-check"] = Chart(partial(report.check_chart, rows), CAPTION_OF_CHECKS)
    publish("motion", report.report(rows, facts), arguments, charts=charts)
    return 0


def _figures(arguments: argparse.Namespace) -> int:
    import shutil

    from wholebody.bench.motion import cases, figures
    from wholebody.bench.report import render
    from wholebody.figures import load
    from wholebody.files import make_folder

    recordings = {path.stem: path for path in cases.recordings(arguments.clips)}
    names = cases.chosen(arguments.only, [drawing.number for drawing in figures.DRAWINGS], "--only")
    folder, figure, drawn = arguments.out / "figures", load("human"), []
    for drawing in figures.DRAWINGS:
        if drawing.number in names:
            drawn.append(figures.redraw(drawing, recordings, figure, folder, arguments.jobs))
            print(f"figure {drawing.number}: {drawn[-1].strip}, {drawn[-1].curves}", flush=True)
    publish("motion-figures", render("motion_figures.md", figures=drawn), arguments)
    if arguments.update_docs is not None:
        place = arguments.update_docs / "assets" / "motion"
        make_folder(place)
        for one in drawn:
            for path in (one.strip, one.curves):
                shutil.copyfile(path, place / path.name)
    return 0


def _tell(done: int, count: int, said: str) -> None:
    print(f"{done} of {count}: {said}", flush=True)
