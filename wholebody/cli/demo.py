"""`wholebody demo` and `gallery`: the packaged tasks and example scripts."""

from __future__ import annotations

import argparse

from wholebody.base.checks import known
from wholebody.base.errors import UnknownNameError
from wholebody.base.files import checked_target
from wholebody.cli.pose import pose
from wholebody.figures.packaged_urdf import script_paths, task_paths
from wholebody.view.gallery import Exhibit, write_gallery


def demo(arguments: argparse.Namespace) -> int:
    """List the tasks, or pose one."""
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


def gallery(arguments: argparse.Namespace) -> int:
    """Run the scripts, and write the page."""

    def say(made: Exhibit) -> None:
        print(f"{made.name}: {'failed' if made.failed else 'done'} in {made.seconds:.0f} s", flush=True)

    path = checked_target(arguments.out, "--out", "a page", (".htm", ".html"))
    scripts = script_paths()
    chosen = [known(name, scripts, "example", "gallery") for name in arguments.names] or list(scripts)
    made = write_gallery([scripts[name] for name in chosen], path, say)
    failed = [one.name for one in made if one.failed]
    print(f"{path}: {len(made)} scenes" + (f"; failed: {', '.join(failed)}" if failed else ""))
    return 1 if failed else 0
