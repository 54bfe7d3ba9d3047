"""A figure from any URDF: its own collision geometry as convex pieces, and the pairs that can touch."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path

from wholebody.base.arrays import with_values
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.link_pieces import Concavity, check_concavity
from wholebody.figures.robot_figure import Robot, check_size, geometry_of_links, robot_figure, visual_of_links
from wholebody.figures.urdf.extension import extended_figure
from wholebody.figures.urdf.file import read_urdf
from wholebody.figures.urdf.model import urdf_model
from wholebody.figures.urdf.srdf import read_srdf

SAMPLES = 400
"""Number of random postures for finding pairs that always overlap."""


def urdf_figure(
    path: str | PathLike[str],
    root: str | None = None,
    package_dirs: Iterable[str | PathLike[str]] = (),
    concavity: Concavity = None,
    samples: int = SAMPLES,
    srdf: str | PathLike[str] | None = None,
) -> Figure:
    """Return the figure of a URDF file; arguments and errors as for `wholebody.load`."""
    if root not in (None, "fixed", "free"):
        raise InputError(f"root is {root!r}; give 'fixed' or 'free'")
    folders = [package_dirs] if isinstance(package_dirs, (str, PathLike)) else package_dirs
    urdf = read_urdf(Path(path), [Path(folder) for folder in folders])
    extension = urdf.extension
    if root is None:
        root = "free" if extension is not None and extension.get("root") == "free" else "fixed"
    model, remarks = urdf_model(urdf, root)
    check_size(model, urdf.path)
    hollows = check_concavity(concavity, urdf.links)
    geometry, notes, _ = geometry_of_links(
        model, urdf.shapes, hollows, urdf.path, named=extension is not None, colors=urdf.colors
    )
    if extension is not None:
        return extended_figure(urdf.path, extension, urdf.name, model, geometry, (*urdf.notes, *remarks, *notes))
    robot = Robot(
        urdf.name, model, urdf.links, geometry, (*urdf.notes, *remarks, *notes), visual_of_links(model, urdf.visuals)
    )
    return robot_figure(robot if srdf is None else _described(robot, Path(srdf)), samples)


def _described(robot: Robot, path: Path) -> Robot:
    """The robot with what its SRDF says."""
    known = read_srdf(path, robot.model, robot.links)
    owners = [robot.model.frames[piece.parentFrame].name for piece in robot.geometry.geometryObjects]
    return with_values(
        robot,
        notes=(*robot.notes, *known.notes),
        groups=known.groups,
        postures=known.postures,
        untested=lambda first, second: known.disabled.get(frozenset((owners[first], owners[second]))),
    )
