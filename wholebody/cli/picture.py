"""Scene and picture of a posture, into a folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wholebody.base import files
from wholebody.base.errors import InputError, MissingPackageError
from wholebody.problem import Problem
from wholebody.taskfile.task import View

if TYPE_CHECKING:
    from wholebody.view import Viewer


def make_folder(folder: Path) -> None:
    """Make a folder, before anything is computed.

    Raises:
        InputError: it cannot be made.
    """
    try:
        files.make_folder(folder)
    except InputError as error:
        raise InputError(f"--out: {error}") from None


def viewer_of(problem: Problem, view: View, title: str, **served: Any) -> Viewer:
    """A viewer of the problem's scene with the task's camera; `served` is the viewer's host and port."""
    from wholebody.view import Viewer

    viewer = Viewer(problem.scene, see_through=view.see_through, title=title, **served)
    if view.eye is not None:
        viewer.look(view.eye, view.target)
    return viewer


def draw(
    problem: Problem, q: NDArray[np.float64], view: View, folder: Path, title: str, *, picture: bool = True
) -> tuple[list[Path], str]:
    """Write scene.html and, if requested and if there is a Chromium, scene.png.

    Args:
        problem: its scene and goals are drawn.
        q: (nq,) the posture.
        view: the camera.
        folder: an existing folder.
        title: of the page.
        picture: whether to draw scene.png.

    Returns:
        The files, and a sentence if the picture could not be drawn.
    """
    with viewer_of(problem, view, title) as viewer:
        viewer.show(q, problem=problem)
        written = [viewer.save(folder / "scene.html")]
        if not picture:
            return written, ""
        try:
            written.append(viewer.picture(folder / "scene.png"))
        except MissingPackageError as error:
            return written, f"no picture: {error}"
    return written, ""
