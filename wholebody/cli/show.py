"""`wholebody show`: show a figure, the start of a task, or a result; viewers and pictures for other commands too."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError, MissingPackageError
from wholebody.base.files import checked_target
from wholebody.cli.arguments import person_options
from wholebody.figures import load
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.taskfile import read_task, result
from wholebody.taskfile.task import View
from wholebody.view import Viewer
from wholebody.view.screenshot import Screenshots
from wholebody.view.viewer import SAVED


def viewer_of(problem: Problem, view: View, title: str, **settings: Any) -> Viewer:
    """A viewer of the problem's scene with the task's camera; the settings are others of the viewer."""
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
        picture, note = None, ""
        if screenshots is not None:
            try:
                picture = viewer.begin_picture(folder / "scene.png")
            except MissingPackageError as error:
                note = f"no picture: {error}"
        written = [viewer.save(folder / "scene.html")]  # while the browser draws
        if picture is not None:
            written.append(picture())
    return written, note


def run(arguments: argparse.Namespace, screenshots: Screenshots) -> int:
    """Show, and wait until the first tab is opened and the last one is closed."""
    save: Path | None = arguments.save
    if save is not None:
        checked_target(save, "--save", "a scene", SAVED)
    if save is not None and (arguments.port or arguments.host != "127.0.0.1"):
        raise InputError("--port and --host are for the live page; leave them out beside --save")
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
