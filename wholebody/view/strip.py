"""A film strip: several postures of a scene side by side in one picture."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from numpy.typing import ArrayLike

from wholebody.errors import InputError
from wholebody.view.movie import replacing
from wholebody.view.viewer import Viewer

GAP = 6  # pixels between two pictures


def write_strip(
    viewer: Viewer,
    postures: Sequence[ArrayLike],
    path: str | os.PathLike[str],
    size: tuple[int, int] = (400, 560),
) -> Path:
    """Write postures as one PNG, the first one left; the camera should have been aimed with `viewer.look`.

    Args:
        viewer: shows the postures one after the other, and the last one afterwards.
        postures: each (nq,).
        path: of the file.
        size: width and height of each picture, pixels.

    Returns:
        The path.

    Raises:
        InputError: there is no posture, one has the wrong shape, or the file cannot be written.
        MissingPackageError: there is no Chromium.
    """
    from PIL import Image

    if not len(postures):
        raise InputError("a film strip has at least one posture; give a list of postures, each of shape (nq,)")
    width, height = size
    strip = Image.new("RGB", (len(postures) * (width + GAP) - GAP, height), "white")
    with TemporaryDirectory() as folder:
        for number, q in enumerate(postures):
            viewer.show(q)
            with Image.open(viewer.picture(Path(folder) / "one.png", size)) as picture:
                strip.paste(picture, (number * (width + GAP), 0))
    with replacing(Path(path)) as temporary:
        strip.save(temporary, format="PNG")
    return Path(path)
