"""`wholebody bench human`, `robots`, `daily`: the person beside people, robots as they come, what is done every day."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

from wholebody.base.files import make_folder
from wholebody.bench.machine import machine
from wholebody.bench.tables import write_text
from wholebody.cli.bench.command import listed, measuring, option, publish, publish_page

PARTS = "maps", "drag", "pictures"
"""What is measured of every day's work, each into a table of its own."""


@measuring(
    "human",
    "compare the person with people: sizes, ranges, self-contacts, everyday tasks",
    "Measure the dimensions, circumferences and ranges of motion of the person beside those of people, "
    "bring parts of the body together, and solve thirteen everyday tasks. With --update-docs the page becomes "
    "docs/human.md, with a picture of each contact and task.",
)
def human(arguments: argparse.Namespace) -> None:
    """Measure; --quick measures one design case and three tasks, and draws nothing."""
    from wholebody.bench.human import Measured, figures, measure, page
    from wholebody.view.browser import find_chromium

    facts = machine()
    drawn = not arguments.quick and find_chromium() is not None
    pictures = arguments.out / "human"
    make_folder(pictures)
    found = None
    for told in measure(pictures if drawn else None, quick=arguments.quick):
        if isinstance(told, Measured):
            found = told
        else:
            print(told, flush=True)
    assert found is not None
    write_text(arguments.out / "human.json", figures(found, facts))
    publish_page("human.md", page(found, facts, pictures=drawn), arguments)
    if arguments.update_docs is not None and drawn:
        folder = arguments.update_docs / "assets" / "human"
        make_folder(folder)
        names = [row.picture for row in found.contacts if row.drawn] + [row.picture for row in found.tasks]
        for name in names:
            shutil.copyfile(pictures / name, folder / name)


@measuring(
    "robots",
    "load every robot description of a folder, and reach with its tips",
    "Load every URDF and MJCF file below a folder, with an empty cache and again, and bring the tips "
    "of each robot to where random postures free of contact have them. With --update-docs the table becomes "
    "docs/robots.md.",
    option("folder", type=Path, metavar="FOLDER", help="folder that holds robot descriptions"),
)
def robots(arguments: argparse.Namespace) -> None:
    """Measure all descriptions; --quick makes three reaches instead of twelve."""
    from wholebody.bench.robots import REACHES, measure, page

    facts, reaches, found = machine(), 3 if arguments.quick else REACHES, []
    for robot in measure(arguments.folder, reaches):
        found.append(robot)
        again = robot.again
        told = f"{again.solved} of {len(again.times)} solved" if again is not None else robot.first.refused
        print(f"{robot.name}: {robot.first.seconds:.2f} s; {told}", flush=True)
    publish_page("robots.md", page(found, facts, reaches), arguments)


@measuring(
    "daily",
    "measure reach maps, dragging in a browser, pictures and movies",
    "Measure what is done every day, in seconds of the processor: reach maps of 50 to 10,000 places, "
    "frames of `wholebody drag --live`, pictures and movies. Each part has a table of its own. Needs viser for the "
    "drag, Chromium for pictures, and Linux. Takes seven minutes, of which the maps are six.",
    listed("--parts", "what to measure (default: all)", None, choices=PARTS, default=PARTS),
)
def daily(arguments: argparse.Namespace) -> None:
    """Measure; --quick makes the smallest map and few frames."""
    from wholebody.bench.daily import measure, report

    facts = machine()
    for part in dict.fromkeys(arguments.parts):
        rows = []
        for row in measure(part, quick=arguments.quick):
            rows.append(row)
            print(f"{row.what}, {row.count}, processes {row.processes}: {1e3 * row.cpu:.1f} ms", flush=True)
        publish(f"daily-{part}", report(rows, facts), arguments, facts=facts, tables={f"daily-{part}": rows})
