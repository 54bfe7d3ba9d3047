"""`load`: a figure by name or by path."""

from __future__ import annotations

from os import PathLike, fspath
from typing import Any

from wholebody.errors import InputError, UnknownNameError
from wholebody.figures.figure import Figure


def load(spec: str | PathLike[str], **options: Any) -> Figure:
    """Return a figure.

    Args:
        spec: "human", "avatar", "hand", or the path of a URDF file.
        **options: for "human" and "avatar": `sex` ("male", "female"), `stature` in metres, `mass` in kilograms and `detail`
            ("spheres", "capsules", "hulls"); for "hand": `side` ("left", "right"), `sex`, `stature`, `mass`; for a URDF:
            `root` ("fixed", "free") and `package_dirs`, folders in which ``package://`` names are looked up.

    Raises:
        UnknownNameError: an unknown name or option.
        InputError: a value that no body has.
        FileFormatError: a URDF that cannot be read.
    """
    from wholebody.figures.human_figure import human_figure

    text = fspath(spec)
    builders = {"human": human_figure}
    if text in builders:
        try:
            return builders[text](**options)
        except TypeError as error:
            raise InputError(str(error)) from None
    raise UnknownNameError("figure", text, builders)
