"""`wholebody show`: show a figure, the start of a task, or a result; viewers and pictures for other commands too."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wholebody.base.errors import MissingPackageError
from wholebody.cli.arguments import add_person, person_options
from wholebody.cli.command import command, flag, option

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from wholebody.base.arrays import Array
    from wholebody.problem import Problem
    from wholebody.taskfile.task import View
    from wholebody.view import Viewer
    from wholebody.view.screenshot import Screenshots


def viewer_of(problem: Problem, view: View, title: str, **settings: Any) -> Viewer:
    """A viewer of the problem's scene with the task's camera; the settings are others of the viewer."""
    from wholebody.view import Viewer

    viewer = Viewer(problem.scene, see_through=view.see_through, title=title, **settings)
    if view.eye is not None:
        viewer.look(view.eye, view.target)
    return viewer


def draw(
    problem: Problem, q: Array, view: View, folder: Path, title: str, screenshots: Screenshots | None
) -> tuple[list[Path], str]:
    """Write scene.html and, by a browser if any, scene.png: the files, and a sentence if there is no picture."""
    with viewer_of(problem, view, title, screenshots=screenshots) as viewer:
        viewer.show(q, problem=problem)
        written = [viewer.save(folder / "scene.html")]
        if screenshots is None:
            return written, ""
        try:
            written.append(viewer.picture(folder / "scene.png"))
        except MissingPackageError as error:
            return written, f"no picture: {error}"
    return written, ""


LOCAL = "127.0.0.1"


@command(
    "show",
    "show a figure, a task or a result",
    """\
Show in a browser. The command waits for the first tab, and ends when the last one is closed, or with Ctrl-C:

  a figure   human, avatar, hand, or the path of a URDF
  a task     the start of a task file, with its goals
  a result   result.json, written by `wholebody pose`""",
    option("what", metavar="FIGURE|TASK|RESULT", help="what to show"),
    add_person,
    option("--posture", metavar="NAME", help="name of a posture of the figure"),
    flag("--pieces", "draw the pieces that contacts are measured with"),
    option("--save", type=Path, metavar="FILE", help="write FILE.html, FILE.png or FILE.glb (glTF); open no browser"),
    option("--port", type=int, default=0, metavar="N", help="port of the live page (default: a free one from 7000)"),
    option(
        "--host",
        default=LOCAL,
        metavar="ADDRESS",
        help=f"address of the live page (default: {LOCAL}; 0.0.0.0 allows access from other machines)",
    ),
    epilog="""\
examples:
  wholebody show human --posture sitting
  wholebody show human --sex female --stature 1.55
  wholebody show human --pieces                    # what contacts are measured with, instead of the body's surface
  wholebody show out/shelf/result.json
  wholebody show shelf.toml --port 7777            # on another machine: ssh -L 7777:localhost:7777 HOST, then this
  wholebody show shelf.toml --save shelf.png""",
)
def run(arguments: argparse.Namespace) -> int:
    """Show, and wait until the first tab is opened and the last one is closed."""
    from wholebody.base.errors import InputError
    from wholebody.base.files import checked_target
    from wholebody.cli.show import viewer_of
    from wholebody.view.screenshot import Screenshots
    from wholebody.view.viewer import SAVED

    save: Path | None = arguments.save
    if save is not None:
        checked_target(save, "--save", "a scene", SAVED)
    if save is not None and (arguments.port or arguments.host != LOCAL):
        raise InputError("--port and --host are for the live page; leave them out beside --save")
    with Screenshots() as screenshots:
        if save is not None and save.suffix.lower() == ".png":
            screenshots.start()  # it gets ready while the figure is loaded
        problem, q, view, title = _subject(arguments.what, person_options(arguments))
        if arguments.posture is not None:
            q = problem.scene.figure.posture(arguments.posture)
        served = {"host": arguments.host, "port": arguments.port, "screenshots": screenshots}
        with viewer_of(problem, view, title, **served) as viewer:
            viewer.show(q, problem=problem, pieces=arguments.pieces)
            if save is None:
                print(f"showing {title} at {viewer.url}; Ctrl-C ends it", flush=True)
                viewer.open()
                viewer.wait(math.inf)
                viewer.wait_until_closed()
            else:
                print(f"wrote {viewer.save(save)}")
    return 0


def _subject(what: str, options: Mapping[str, Any]) -> tuple[Problem, NDArray[np.float64], View, str]:
    """Problem, posture, view and title of the subject."""
    from wholebody.base.errors import InputError
    from wholebody.figures import load
    from wholebody.problem import Problem
    from wholebody.scene.scene import Scene
    from wholebody.taskfile import read_task, result
    from wholebody.taskfile.task import View

    path = Path(what)
    if options and path.suffix.lower() in (".json", ".toml"):
        raise InputError(f"{path} says which person it shows; leave out --{next(iter(options))}")
    if path.suffix.lower() == ".json":
        found = result.read_result(path)
        return found.task.problem, found.q, found.task.view, found.task.title
    if path.suffix.lower() == ".toml":
        task = read_task(path)
        return task.problem, task.problem.start, task.view, task.title
    problem = Problem(Scene(load(what, **options)))
    return problem, problem.start, View(), what
