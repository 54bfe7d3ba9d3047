"""Viewers of problems, and scene and picture of a posture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from wholebody.base.errors import MissingPackageError

if TYPE_CHECKING:
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
