"""`wholebody demo`: pose one of the packaged tasks."""

from __future__ import annotations

import argparse
from pathlib import Path

from wholebody.cli.command import command, flag, option


@command(
    "demo",
    "pose a packaged task",
    """\
Pose a packaged task (by default a person who reaches between the boards of a shelf), and print where the pictures are.
You can copy and change the task file.""",
    option("name", nargs="?", default="shelf", metavar="NAME", help="which task (default: shelf)"),
    flag("--list", "list the tasks"),
    option("--out", type=Path, default=Path("demo"), metavar="DIR", help="folder (default: demo)"),
)
def run(arguments: argparse.Namespace) -> int:
    """List the tasks, or pose one."""
    from wholebody.base.errors import UnknownNameError
    from wholebody.cli.pose import pose
    from wholebody.figures.packaged_urdf import task_paths

    tasks = task_paths()
    if arguments.list:
        for name, path in tasks.items():
            print(f"{name:25} {path}")
        return 0
    if arguments.name not in tasks:
        raise UnknownNameError("demo", arguments.name, tasks)
    code = pose(tasks[arguments.name], None, arguments.out)
    print(f"the task is {tasks[arguments.name]}; to turn the scene about, open {arguments.out / 'scene.html'}")
    return code
