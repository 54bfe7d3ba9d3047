"""Several figures as one, and checks of what takes one alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wholebody.base import checks
from wholebody.base.errors import InputError
from wholebody.figures.description import Member
from wholebody.figures.figure import Figure
from wholebody.figures.joining import check_single, joined_parts
from wholebody.geometry.placement import placement


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


def welded(figure: Figure) -> Figure:
    """The figure with its free root fixed as in its first posture; itself where it is fixed."""
    return figure.reduced(figure.joints) if figure.roots else figure


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
