"""A filmstrip: several postures of a scene side by side in one picture."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from wholebody.base.checks import a, listed
from wholebody.base.errors import InputError
from wholebody.base.files import Scratch, checked_target, write
from wholebody.view.screenshot import check_size
from wholebody.view.viewer import Viewer

GAP = 6  # pixels between two pictures


def write_filmstrip(
    viewer: Viewer,
    postures: Sequence[ArrayLike],
    path: str | os.PathLike[str],
    size: tuple[int, int] = (400, 560),
    *,
    ghosts: Sequence[ArrayLike] | None = None,
) -> Path:
    """Write postures as one PNG, the first one left; the camera should have been set with `viewer.look`.

    Args:
        viewer: shows the postures one after the other, and the last one afterwards.
        postures: each (nq,).
        path: of the file, which is returned.
        size: width and height of each picture, pixels.
        ghosts: as many postures, each (nq,), shown transparent beside the others; those of the viewer stay if left out.

    Raises:
        InputError: no posture, one of a wrong shape, another number of ghosts, or a file that cannot be written.
        MissingPackageError: there is no Chromium.
    """
    from PIL import Image

    if not isinstance(viewer, Viewer):
        raise InputError(f"write_filmstrip: viewer is {a(type(viewer))}, not a Viewer; make one with wb.Viewer(scene)")
    postures = listed(postures, "postures", "[q], each of shape (nq,)")
    if not postures:
        raise InputError("a filmstrip has at least one posture; give a list of postures, each of shape (nq,)")
    beside = None if ghosts is None else listed(ghosts, "ghosts", "[q], each of shape (nq,)")
    if beside is not None and len(beside) != len(postures):
        raise InputError(f"{len(beside)} ghosts for {len(postures)} postures; give one for each")
    width, height = check_size(size)
    strip = Image.new("RGB", (len(postures) * (width + GAP) - GAP, height), "white")
    place = checked_target(path, "write_filmstrip: path", "a filmstrip", (".png",))
    with Scratch() as folder:
        for number, q in enumerate(postures):
            if beside is not None:
                viewer.ghosts([beside[number]])
            viewer.show(q)
            with Image.open(viewer.picture(folder / "one.png", size, legend=False)) as picture:
                strip.paste(picture, (number * (width + GAP), 0))
    made = io.BytesIO()
    strip.save(made, format="PNG")
    return write(place, made.getvalue())
