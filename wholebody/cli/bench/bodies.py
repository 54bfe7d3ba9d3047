"""`wholebody bench robots`: robots as they come."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.bench.machine import machine
from wholebody.cli.bench.command import measuring, publish_page
from wholebody.cli.command import option


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
    from wholebody.bench.measure.robots import REACHES, measure, page

    facts, reaches, found = machine(), 3 if arguments.quick else REACHES, []
    for robot in measure(arguments.folder, reaches):
        found.append(robot)
        again = robot.again
        told = f"{again.solved} of {len(again.times)} solved" if again is not None else robot.first.refused
        print(f"{robot.name}: {robot.first.seconds:.2f} s; {told}", flush=True)
    publish_page("robots.md", page(found, facts, reaches), arguments)
