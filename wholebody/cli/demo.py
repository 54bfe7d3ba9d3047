"""`wholebody demo` and `gallery`: the packaged tasks and example scripts."""

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
def demo(arguments: argparse.Namespace) -> int:
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


@command(
    "gallery",
    "run the example scripts, and show them on one page",
    """\
Run the packaged example scripts, and write one page that opens without a network. It has the picture of each, its
story, what it printed, its code, and its scene to turn. All of them take some minutes.""",
    option("names", nargs="*", metavar="NAME", help="which scripts (default: all)"),
    option("--out", type=Path, default=Path("gallery.html"), metavar="PAGE", help="page (default: gallery.html)"),
)
def gallery(arguments: argparse.Namespace) -> int:
    """Run the scripts, and write the page."""
    from wholebody.base.checks import known
    from wholebody.base.files import checked_target
    from wholebody.figures.packaged_urdf import script_paths
    from wholebody.view.gallery import Exhibit, write_gallery

    def say(made: Exhibit) -> None:
        print(f"{made.name}: {'failed' if made.failed else 'done'} in {made.seconds:.0f} s", flush=True)

    path = checked_target(arguments.out, "--out", "a page", (".htm", ".html"))
    scripts = script_paths()
    chosen = [known(name, scripts, "example", "gallery") for name in arguments.names] or list(scripts)
    made = write_gallery([scripts[name] for name in chosen], path, say)
    failed = [one.name for one in made if one.failed]
    print(f"{path}: {len(made)} scenes" + (f"; failed: {', '.join(failed)}" if failed else ""))
    return 1 if failed else 0
