"""`load`: a figure by name or by path."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from wholebody.base.checks import listed, path, shown, text, whole
from wholebody.base.errors import FileFormatError, InputError, UnknownNameError
from wholebody.base.files import check_file, is_file
from wholebody.figures.figure import Figure


def load(spec: str | PathLike[str], **options: Any) -> Figure:
    """Return a figure.

    Args:
        spec: "human", "avatar", "hand", or the path of a URDF or MJCF file.
        **options: for "human" and "avatar": `sex` ("male", "female"), `stature` in metres, `mass` in kilograms,
            `percentile` (1 to 99) for those of the two that are left out, `proportions` such as ``{"sitting_height":
            0.93}`` in metres (dimensions of ANSUR II, by the names of `docs/human.md`; the others follow as they go
            together in people), `age` in years (17 to 69; from 45 on some ranges of motion are smaller), and `detail`
            ("spheres", "capsules", "hulls"): with "spheres" the body is tested against itself and what it carries
            by its 39 spheres, and against things by its hulls; for "human": `hands` ("rigid", "fingers");
            for "hand": `side` ("left", "right"), `sex`, `stature`, `mass`, `percentile`;
            for a file: `root` ("fixed", "free"), `package_dirs`, folders for ``package://`` names, and `concavity`,
            a number or a mapping from link to number, which asks for the decomposition of meshes into convex pieces
            (0.01 is close, 1 is a hull); without it every mesh becomes its convex hull; for a URDF: `srdf`, the path of
            its SRDF.

    Raises:
        UnknownNameError: an unknown name or option.
        InputError: a value that is impossible for a body.
        FileFormatError: a file that cannot be read.

    Examples:
        >>> woman = wb.load("human", sex="female", stature=1.65)
        >>> woman.model.nv
        55
    """
    from wholebody.figures.hand import hand_figure
    from wholebody.figures.human.figure import avatar_figure, human_figure
    from wholebody.figures.mjcf.figure import xml_figure
    from wholebody.figures.urdf.figure import urdf_figure

    if not isinstance(spec, (str, PathLike)):
        raise InputError(f"load: spec is {shown(spec)}; give 'human', 'avatar', 'hand', or the path of a URDF")
    builders: dict[str, Callable[..., Figure]] = {"human": human_figure, "avatar": avatar_figure, "hand": hand_figure}
    name = str(path(spec, "load: spec"))
    if name in builders:
        known, builder = name, builders[name]
    else:
        ending = Path(name).suffix.lower()
        if not ending and not is_file(name):
            raise UnknownNameError("figure", name, builders, "load")
        if ending not in ("", ".urdf", ".xml", ".xacro"):
            raise FileFormatError(f"{name}: a figure is a URDF or MJCF file, or 'human', 'avatar', 'hand'; convert it")
        check_file(name, "figure")
        known, builder = str(Path(name).resolve()), partial(xml_figure if ending == ".xml" else urdf_figure, name)
    _check_options(builder, options, f"load({name!r})")
    figure = builder(**options)
    figure.loaded_as = (known, dict(options))
    return figure


def _check_options(builder: Callable[..., Figure], options: dict[str, Any], where: str) -> None:
    known = [name for name in inspect.signature(builder).parameters if name != "path"]
    for option, value in options.items():
        if option not in known:
            raise UnknownNameError("option", option, known, where)
        if option == "srdf" and value is not None:
            check_file(str(path(value, f"{where}: {option}")), "SRDF")
        elif option == "package_dirs":
            folders = (
                [value] if isinstance(value, (str, PathLike)) else listed(value, f"{where}: {option}", "['share']")
            )
            options[option] = [path(folder, f"{where}: {option}") for folder in folders]
        elif option in ("detail", "side", "hands") or (option == "root" and value is not None):
            text(value, f"{where}: {option}")
        elif option == "samples":
            # Most random postures for finding pairs that always overlap: more take minutes.
            whole(value, f"{where}: {option}", 0, 100_000)
