"""`wholebody bench robots`: every robot description of a folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.arguments import Commands
from wholebody.cli.bench.publishing import measuring


def add_to(commands: Commands) -> None:
    """Add the command."""
    parser = measuring(
        commands,
        run,
        "robots",
        help="load every robot description of a folder, and reach with its tips",
        description="Load every URDF and MJCF file below a folder, with an empty cache and again, and bring the tips "
        "of each robot to where random postures free of contact have them. With --update-docs the table becomes "
        "docs/robots.md.",
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="folder that holds robot descriptions")


def run(arguments: argparse.Namespace) -> int:
    """Measure all descriptions; --quick makes three reaches instead of twelve."""
    from wholebody.bench.machine import machine
    from wholebody.bench.robots import REACHES, measure, page
    from wholebody.bench.tables import write_text

    facts, reaches = machine(), 3 if arguments.quick else REACHES
    robots = []
    for robot in measure(arguments.folder, reaches):
        robots.append(robot)
        again = robot.again
        told = f"{again.solved} of {len(again.times)} solved" if again is not None else robot.first.refused
        print(f"{robot.name}: {robot.first.seconds:.2f} s; {told}", flush=True)
    text = page(robots, facts, reaches)
    write_text(arguments.out / "robots.md", text)
    print(f"wrote {arguments.out / 'robots.md'}")
    if arguments.update_docs is not None:
        write_text(arguments.update_docs / "robots.md", text)
        print(f"wrote {arguments.update_docs / 'robots.md'}")
    return 0
