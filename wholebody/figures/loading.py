"""`load`: a figure by name or by path; `join`: several figures as one."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import with_values
from wholebody.base.checks import listed, path, shown, text, whole
from wholebody.base.errors import FileFormatError, InputError, UnknownNameError
from wholebody.base.files import check_file, is_file, is_folder
from wholebody.figures.description import Member
from wholebody.figures.figure import Figure
from wholebody.figures.joining import check_single, joined_parts, turned_cone
from wholebody.geometry.placement import placement


def load(spec: str | PathLike[str], **options: Any) -> Figure:
    """Return a figure.

    Args:
        spec: "human", "avatar", "hand", or the path of a URDF or MJCF file.
        **options: for "human" and "avatar": `sex` ("male", "female"), `stature` in metres, `mass` in kilograms,
            `percentile` (1 to 99) for those of the two that are left out, `proportions` such as ``{"sitting_height":
            0.93}`` in metres (dimensions of ANSUR II, by the names of `docs/human.md`; the others follow as they go
            together in people), `age` in years (17 to 69; from 45 on some ranges of motion are smaller), `shoes`, the
            thickness of soles, `clothing`, that of cloth on trunk and limbs, both in metres, and `detail`
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
        if not ending and not (is_file(name) or is_folder(name)):
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
    from wholebody.figures.anthropometry import make_person

    own = inspect.signature(builder).parameters
    known = [name for name in own if name not in ("path", "who")]
    known += inspect.signature(make_person).parameters if "who" in own else ()
    for option, value in options.items():
        what = f"{where}: {option}"
        if option not in known:
            raise UnknownNameError("option", option, known, where)
        if option == "srdf" and value is not None:
            check_file(str(path(value, what)), "SRDF")
        elif option == "package_dirs":
            folders = [value] if isinstance(value, (str, PathLike)) else listed(value, what, "['share']")
            options[option] = [path(folder, what) for folder in folders]
        elif option in ("detail", "side", "hands") or (option == "root" and value is not None):
            text(value, what)
        elif option == "samples":
            # Most random postures for finding pairs that always overlap: more take minutes.
            whole(value, what, 0, 100_000)


def join(figures: Mapping[str, Figure | tuple[Figure, Any]]) -> Figure:
    """Return one figure of several, each with its name before the names of its parts: "anna/right_palm".

    Every pair of pieces of two figures can touch, beside the pairs of each. The postures are those of the figures: a
    name poses all that have it, "anna/sitting" one of them, and the others are in their first one; `Figure.posture`
    takes a mapping too. Each name of a figure is also that of a group: of all its joints without a root.

    Args:
        figures: name to a figure, or to a figure and where its world is: (x, y, z), (x, y, z, qx, qy, qz, qw), a 4x4
            matrix or a pin.SE3. That places a fixed root, and the named postures of a free one.

    Raises:
        InputError: no figures, no figure, a name with a slash, the name "root", a figure that was joined already or
            that meets things with pieces of their own (detail "spheres"), or a placement that cannot be read.

    Examples:
        >>> both = wb.figures.join({"anna": human, "ben": (human, (1.0, 0.0, 0.0))})
        >>> both.model.nv == 2 * human.model.nv
        True
    """
    if not isinstance(figures, Mapping) or not figures:
        raise InputError(
            f"several figures are {checks.shown(figures)}; give them by name, such as "
            "{'anna': wb.load('human'), 'arm': (wb.load('arm.urdf'), (1, 0, 0))}"
        )
    members = {name: member(name, given) for name, given in figures.items()}
    detail = {figure.detail for figure, _ in members.values()}
    model, geometry, description, visual = joined_parts(members)
    model.name = " and ".join(members)
    return Figure(model.name, model, geometry, detail.pop() if len(detail) == 1 else "own", description, visual)


def member(name: str, given: Figure | tuple[Figure, Any]) -> Member:
    """One of several figures, by its name and what `join` takes of it; an InputError where it cannot be one."""
    figure, at = given if isinstance(given, (tuple, list)) and len(given) == 2 else (given, (0.0, 0.0, 0.0))
    if "/" in checks.text(name, "the name of a figure"):
        raise InputError(f"the name of a figure is {checks.shown(name)}; leave the slash out: it ends a name")
    if name == "root":
        raise InputError("a figure is named 'root', which is that of a placement; give it another name")
    one = checks.instance(figure, Figure, f"figure {name!r}", "load one with wb.load('human')")
    check_single(one, name)
    return Member(one, placement(at, f"{name!r}: at"))


def one_figure(figure: object, what: str) -> Figure:
    """A figure that is one alone; an InputError for something else, and for several that were joined."""
    found = checks.instance(figure, Figure, what, "load one with wb.load('human')")
    if found.root == "several":
        name = next(iter(found.members), next(iter(found.bodies)))
        raise InputError(
            f"{what} is several figures; give one of them, figure.members[{name!r}].figure, with its postures, "
            f"figure.part({name!r}, q), or its clip, clip.part({name!r})"
        )
    return found


def stood(figure: Figure, at: pin.SE3, start: Any) -> tuple[Figure, Any]:
    """A figure whose world is elsewhere, and its start; as in `join` that places a fixed root, or a named posture."""
    if figure.roots:
        first = figure.postures[0] if start is None else start
        return figure, join({"one": (figure, at)}).posture({"one": first})
    known = figure.describe()
    model, geometry, visual = pin.Model(figure.model), figure.geometry.copy(), figure.visual.copy()
    for joint in np.flatnonzero(np.array(model.parents) == 0).tolist()[1:]:
        model.jointPlacements[joint] = at * model.jointPlacements[joint]
    for one in (*list(model.frames)[1:], *geometry.geometryObjects, *visual.geometryObjects):
        if not one.parentJoint:
            one.placement = at * one.placement
    model.inertias[0] = at.act(model.inertias[0])
    cones = {name: turned_cone(cone, at.rotation) for name, cone in known.cones.items()}
    drawn = None if figure.visual is figure.geometry else visual
    return Figure(figure.name, model, geometry, figure.detail, with_values(known, cones=cones), drawn), start
