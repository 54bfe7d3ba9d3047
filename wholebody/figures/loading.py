"""`load`: a figure by name or by path."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from wholebody.errors import FileFormatError, UnknownNameError
from wholebody.figures.figure import Figure


def load(spec: str | PathLike[str], **options: Any) -> Figure:
    """Return a figure.

    Args:
        spec: "human", "avatar", "hand", or the path of a URDF or MJCF file.
        **options: for "human" and "avatar": `sex` ("male", "female"), `stature` in metres, `mass` in kilograms and
            `detail` ("spheres", "capsules", "hulls"); for "hand": `side` ("left", "right"), `sex`, `stature`, `mass`;
            for a file: `root` ("fixed", "free"), `package_dirs`, folders for ``package://`` names, and `concavity`,
            a number or a mapping from link to number, which asks for the decomposition of meshes into convex pieces
            (0.01 is close, 1 is a hull); without it every mesh becomes its convex hull.

    Raises:
        UnknownNameError: an unknown name or option.
        InputError: a value that no body has.
        FileFormatError: a file that cannot be read.
    """
    from wholebody.figures.avatar import avatar_figure
    from wholebody.figures.hand import hand_figure
    from wholebody.figures.human_figure import human_figure
    from wholebody.figures.mjcf_figure import xml_figure
    from wholebody.figures.urdf_figure import urdf_figure

    builders: dict[str, Callable[..., Figure]] = {"human": human_figure, "avatar": avatar_figure, "hand": hand_figure}
    name = fspath(spec)
    if name in builders:
        _check_options(builders[name], options, f"load({name!r})")
        return builders[name](**options)
    if Path(name).suffix == "" and not Path(name).exists():
        raise UnknownNameError("figure", name, builders, "load")
    if Path(name).suffix and Path(name).suffix.lower() not in (".urdf", ".xml", ".xacro"):
        raise FileFormatError(f"{name}: a figure is a URDF or MJCF file, or 'human', 'avatar', 'hand'; convert it")
    builder = xml_figure if Path(name).suffix.lower() == ".xml" else urdf_figure
    _check_options(builder, options, f"load({name!r})")
    return builder(name, **options)


def _check_options(builder: Callable[..., Figure], options: dict[str, Any], where: str) -> None:
    known = [name for name in inspect.signature(builder).parameters if name != "path"]
    for option in options:
        if option not in known:
            raise UnknownNameError("option", option, known, where)
